"""Frames for a device under test, drawn from a seed: valid ones at their edges, wrong and damaged ones.

Each case has its own random numbers, from the seed and its number, so that one case can be sent again alone.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from functools import cached_property

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.vectors import choice
from qlinkgen.backends.vectors.choice import Chance
from qlinkgen.backends.vectors.faults import Bad, Faults, Good
from qlinkgen.link import codec as link
from qlinkgen.link.codec import is_message
from qlinkgen.model.transaction import Command
from qlinkgen.plan import MessagePlan, Plan
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import Raw, pack
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.parts import CellPart, IdPart, IdSlot, MarkPart
from qlinkgen.plan.spans import Owner

VALID, WRONG, DAMAGED = "valid", "wrong", "damaged"
#: How often each kind is drawn.
_SHARES = {VALID: 30, WRONG: 35, DAMAGED: 35}
#: The values of valid frames; what is left is random.
_EDGES = {"smallest": choice.MINIMUM, "largest": choice.MAXIMUM, "a5": choice.A5}


@dataclass(frozen=True, slots=True)
class Case:
    """One frame.

    Attributes:
        number: from 0, of the seed.
        kind: valid, wrong or damaged.
        command: the command that it requests, or that it was made from.
        what: the values, or the error.
        wire: its bytes.
    """

    number: int
    kind: str
    command: str
    what: str
    wire: bytes


class Cases:
    """Draws the cases of one device.

    Args:
        plan: the protocol.
        codec: its generated module.
        commands: the commands to use, at least one.
        node: address of the device, None where frames have none.
        seed: any number.
        everything: also change the number of the command, to others and to unknown ones.
    """

    def __init__(
        self,
        plan: Plan,
        codec: link.Codec,
        commands: Sequence[Command],
        node: int | None,
        seed: int,
        *,
        everything: bool,
    ) -> None:
        self._seed = seed
        frames = Codec(plan), codec
        self._sources = [_Source(*frames, command, node, everything=everything) for command in commands]

    @property
    def probe(self) -> bytes:
        """A valid request, the shortest one."""
        return min((source.smallest for source in self._sources), key=len)

    def draw(self, number: int) -> Case:
        """Return the case of a number."""
        chance = random.Random(f"{self._seed} {number}")
        source = chance.choice(self._sources)
        (kind,) = chance.choices([*_SHARES], [*_SHARES.values()])
        return source.draw(number, kind, chance)


class _Source:
    """Makes the frames of one command."""

    def __init__(
        self, codec: Codec, module: link.Codec, command: Command, node: int | None, *, everything: bool
    ) -> None:
        self._codec, self._module, self._command, self._node = codec, module, command, node
        self._everything = everything
        self._message = codec.plan.message(command.request.name)

    def draw(self, number: int, kind: str, chance: random.Random) -> Case:
        """Make a frame; a valid one if there is none of that kind."""
        if kind == WRONG and self._wrong:
            bad = chance.choice(self._wrong)
            return Case(number, kind, self._command.name, f"{bad.part}: {bad.what} ({bad.kind})", bad.wire)
        if kind == DAMAGED and (damage := self._damaged(chance)) is not None:
            return Case(number, kind, self._command.name, *damage)
        what = chance.choice(("smallest", "largest", "a5", "random", "random"))
        wire = self._good(what, f"{chance.random()}").wire
        return Case(number, VALID, self._command.name, f"{what} values", wire)

    @property
    def smallest(self) -> bytes:
        """The request with the smallest values."""
        return self._good("smallest", "").wire

    def _good(self, what: str, seed: str) -> Good:
        message, rule = self._message, _EDGES.get(what) or choice.random(Chance(seed))
        values = rule.values(message.payload)
        beside: dict[str, Raw] = {member.name: member.number.default for _, member in message.envelope.values}
        wire = self._codec.encode(message.name, {**values, **beside}, self._node)
        return Good(message, self._node, values, beside, pack(message.payload, values), wire, b"")

    @cached_property
    def _wrong(self) -> list[Bad]:
        """Frames with one wrong part each; of unknown commands only where everything is tried."""
        good = self._good("random", "wrong")
        telling = {part.name for part in good.message.envelope_in(good.frame).parts if _tells(part)}
        found = Faults(self._codec).of(good, first=True)
        spared = () if self._everything else telling
        return [
            bad
            for bad in found
            if bad.wire
            and (bad.part not in spared or bad.kind == "truncated")
            and not self._has_frame(bad.wire)
        ]

    def _damaged(self, chance: random.Random) -> tuple[str, bytes] | None:
        """Damage a random frame after the number of its command; None if a frame is left."""
        wire = bytearray(self._good("random", f"{chance.random()}").wire)
        first = 0 if self._everything else _behind(self._codec.plan, self._message, bytes(wire))
        if first >= len(wire):
            return None
        at = chance.randrange(first, len(wire))
        match chance.choice(("flip", "flip", "lose", "insert", "cut")):
            case "flip":
                bit = chance.randrange(8)
                wire[at] ^= 1 << bit
                what = f"bit {bit} of byte {at} is flipped"
            case "lose":
                del wire[at]
                what = f"byte {at} is missing"
            case "insert":
                wire.insert(at, byte := chance.randrange(256))
                what = f"{byte:02x} is inserted before byte {at}"
            case _:
                del wire[at:]
                what = f"it ends after {at} bytes"
        return None if not wire or self._has_frame(bytes(wire)) else (what, bytes(wire))

    def _has_frame(self, data: bytes) -> bool:
        """Whether a receiver finds a message in the bytes."""
        decoder = self._module.StreamDecoder("request")
        return any(map(is_message, (*decoder.feed(data), *decoder.finish())))


def _tells(part: Owner) -> bool:
    """Whether a part has bits of the number of the message."""
    if isinstance(part, CellPart):
        return any(isinstance(slot, IdSlot) for slot in part.slots)
    return isinstance(part, IdPart | MarkPart)


def _behind(plan: Plan, message: MessagePlan, wire: bytes) -> int:
    """Return the offset after the number of the message in a frame, 0 if no part has it."""
    spans = dissect(plan, wire, message.direction).spans
    return max((place + 1 for span in spans if _tells(span.of) for place in span.places), default=0)
