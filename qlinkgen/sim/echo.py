"""The local echo of a two-wire adapter, whole or flawed."""

from __future__ import annotations

import math
import random

from qlinkgen.sim.errors import FaultPlanError


class Echo:
    """What the outside hears of its own transmissions.

    An adapter that leaves its receiver on hears what it sends. Some switch it on too late or off too soon, so
    a head or a tail is missing; and on a bad line bytes come back changed.

    Attributes:
        partial: chance of a missing head or tail, 0 to 1.
        changed: chance of one to three changed bytes, 0 to 1.
        seed: of the random numbers.
        counts: how often each of "partial" and "changed" has happened, and "whole" for an echo without flaw.
    """

    def __init__(self, *, partial: float = 0.0, changed: float = 0.0, seed: int = 0) -> None:
        for name, rate in (("partial", partial), ("changed", changed)):
            if not 0 <= rate <= 1 or math.isnan(rate):
                raise FaultPlanError(f"{name} of an echo is {rate}: a chance is a number from 0 to 1")
        self.partial = partial
        self.changed = changed
        self.seed = seed
        self.counts = {"whole": 0, "partial": 0, "changed": 0}
        self._random = random.Random(f"echo {seed}")

    def hear(self, data: bytes) -> tuple[int, bytes]:
        """Return how many bytes are missing at the head, and what is heard of `data`: at least one byte."""
        chance = self._random
        cut = chance.random() < self.partial and len(data) > 1
        change = chance.random() < self.changed
        if not cut and not change:
            self.counts["whole"] += 1
            return 0, data
        lead = 0
        if cut:
            self.counts["partial"] += 1
            place = chance.randint(1, len(data) - 1)
            lead, data = (place, data[place:]) if chance.random() < 0.5 else (0, data[:place])
        if change:
            self.counts["changed"] += 1
            data = self._change(data)
        return lead, data

    def _change(self, data: bytes) -> bytes:
        out = bytearray(data)
        for index in self._random.sample(range(len(out)), min(len(out), self._random.randint(1, 3))):
            out[index] ^= self._random.randint(1, 255)
        return bytes(out)
