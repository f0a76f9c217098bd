"""The local echo of a two-wire adapter, complete or faulty."""

from __future__ import annotations

import math
import random

from qlinkgen.sim.errors import FaultPlanError


class Echo:
    """The outside's echo of its own transmissions.

    An adapter with an enabled receiver receives its own bytes. Some enable it too late or disable it too
    early, so a head or a tail is missing; and on a bad line bytes are corrupted.

    Attributes:
        partial: probability of a missing head or tail, 0 to 1.
        changed: probability of one to three changed bytes, 0 to 1.
        seed: seed of the random numbers.
        counts: counts of "partial", "changed" and "whole" echoes.
    """

    def __init__(self, *, partial: float = 0.0, changed: float = 0.0, seed: int = 0) -> None:
        for name, rate in (("partial", partial), ("changed", changed)):
            if not 0 <= rate <= 1 or math.isnan(rate):
                raise FaultPlanError(f"{name} of an echo must be a probability from 0 to 1, not {rate}")
        self.partial = partial
        self.changed = changed
        self.seed = seed
        self.counts = {"whole": 0, "partial": 0, "changed": 0}
        self._random = random.Random(f"echo {seed}")

    def hear(self, data: bytes) -> tuple[int, bytes]:
        """Return the number of bytes missing at the head, and the echo of `data`: at least one byte."""
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
