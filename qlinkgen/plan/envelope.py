"""The parts of a frame in wire order: offsets, coverage of check values, places of id and address."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property

from qlinkgen._dataclass import dataclass
from qlinkgen.model.frame import ATTRIBUTE
from qlinkgen.plan.check import Check
from qlinkgen.plan.conditional import Conditional
from qlinkgen.plan.parts import (
    AddressPart,
    AddressSlot,
    Bits,
    BlocksPart,
    CellPart,
    CheckPart,
    ConstantPart,
    ConstantSlot,
    EqualPart,
    IdPart,
    IdSlot,
    LeadingPart,
    LengthPart,
    Part,
    PayloadPart,
    Seed,
    Slot,
)
from qlinkgen.plan.payload import Member


@dataclass(frozen=True)
class Envelope:
    """The parts of a frame in wire order, before stuffing.

    Attributes:
        parts: all of them; sizes and offsets are those of a frame that has them all.
        before: the last parts before the payload, if not every frame has them.
        after: the last parts of the frame, if not every frame has them.
    """

    parts: tuple[Part, ...]
    before: Conditional | None = None
    after: Conditional | None = None

    def fixing(self, numbers: Mapping[str, int]) -> Envelope:
        """The frame where values are always the same, by name."""
        if not numbers:
            return self
        cells = {id(part): part.fixing(numbers) for part in self.parts if isinstance(part, CellPart)}
        # What is derived from a part still refers to the same one.
        return replace(self, parts=tuple(_fixing(part, cells) for part in self.parts))

    @cached_property
    def conditional(self) -> tuple[Conditional, ...]:
        """The parts that not every frame has."""
        return tuple(each for each in (self.before, self.after) if each is not None)

    @cached_property
    def inner(self) -> Envelope:
        """The frame without the parts at its end that not every frame has."""
        if self.after is None:
            return self
        return replace(self, parts=self.parts[: -len(self.after.parts)], after=None)

    def absent(self, part: Part, cells: Mapping[str, bytes]) -> bool:
        """Whether a frame with these parts in its header does not have a part."""
        conditional = self.conditional
        return bool(conditional) and any(part in each.parts and not each.holds(cells) for each in conditional)

    @property
    def least_overhead(self) -> int:
        """Bytes before and after the payload of a frame without conditional parts."""
        return self.overhead - sum(each.size for each in self.conditional)

    @cached_property
    def payload_at(self) -> int:
        """Index of the payload among the parts."""
        return next(index for index, part in enumerate(self.parts) if isinstance(part, PayloadPart))

    @cached_property
    def payload(self) -> PayloadPart:
        """The payload."""
        part = self.parts[self.payload_at]
        assert isinstance(part, PayloadPart)
        return part

    @cached_property
    def front(self) -> tuple[Part, ...]:
        """Parts before the payload."""
        return self.parts[: self.payload_at]

    @cached_property
    def back(self) -> tuple[Part, ...]:
        """Parts after the payload."""
        return self.parts[self.payload_at + 1 :]

    @cached_property
    def header_size(self) -> int:
        """Bytes before the payload."""
        return sum(part.size for part in self.front)

    @cached_property
    def trailer_size(self) -> int:
        """Bytes after the payload."""
        return sum(part.size for part in self.back)

    @property
    def overhead(self) -> int:
        """Bytes before and after the payload."""
        return self.header_size + self.trailer_size

    @property
    def max_frame(self) -> int:
        """Maximum size of a frame, with the payload as a length counts it."""
        blocks = self.blocks.added(self.payload.most_sent) if self.blocks else 0
        return self.overhead + self.payload.most_sent + blocks

    @property
    def preamble(self) -> bytes:
        """Constant bytes at the start of the frame, b"" if there are none."""
        first = self.parts[0]
        return first.data if isinstance(first, ConstantPart) else b""

    @cached_property
    def starts(self) -> tuple[bytes, ...]:
        """The bytes that a frame may begin with: a constant, or each number of the first part; () if any."""
        first = self.parts[0] if self.parts else None
        return first.starts if isinstance(first, ConstantPart | LeadingPart) else ()

    @property
    def length(self) -> LengthPart | None:
        """The length that each frame has, None if there is none."""
        return next((part for part in self.parts if isinstance(part, LengthPart)), None)

    @cached_property
    def id(self) -> tuple[Bits, ...]:
        """The pieces of the message number in wire order, () if it shares a marked byte or is not sent."""
        return tuple(bits for part in self.parts for bits in _bits_of(part, IdPart, IdSlot))

    @cached_property
    def address(self) -> tuple[Bits, ...]:
        """The bits of the address, () if it shares a marked byte or is not sent."""
        return tuple(bits for part in self.parts for bits in _bits_of(part, AddressPart, AddressSlot))

    @cached_property
    def checks(self) -> tuple[CheckPart, ...]:
        """The check values that each frame has, in wire order."""
        held = self.conditional_checks
        return tuple(part for part in self.parts if isinstance(part, CheckPart) and part not in held)

    @property
    def conditional_checks(self) -> tuple[CheckPart, ...]:
        """The check values that only some frames have; they cover no others."""
        return self.after.checks if self.after else ()

    @cached_property
    def check(self) -> CheckPart | None:
        """The check value whose algorithm can be replaced: the last over the payload, else the last."""
        over = [part for part in self.checks if self.payload.name in part.check.over]
        return (over or self.checks or (None,))[-1]

    @cached_property
    def blocks(self) -> BlocksPart | None:
        """The check values of the blocks of the payload, None if there are none."""
        return next((part for part in self.parts if isinstance(part, BlocksPart)), None)

    @cached_property
    def algorithms(self) -> tuple[Check, ...]:
        """The check values, the main one first, each algorithm perhaps several times."""
        checks = [part.check for part in sorted(self.checks, key=lambda part: part is not self.check)]
        checks += [part.check for part in self.conditional_checks]
        return tuple(checks + ([self.blocks.check] if self.blocks else []))

    @cached_property
    def header_checks(self) -> tuple[CheckPart, ...]:
        """Check values of the header alone, which a receiver verifies before the payload."""
        front = {part.name for part in self.front}
        return tuple(part for part in self.checks if part in self.front and front.issuperset(part.check.over))

    @cached_property
    def filling(self) -> tuple[CheckPart, ...]:
        """The check values in the order in which they are computed: after those that they cover."""
        left, done = list(self.checks), list[CheckPart]()
        while left:
            names = {part.name for part in left}
            part = next(part for part in left if names.isdisjoint(part.check.over))
            left.remove(part)
            done.append(part)
        return tuple(done)

    @cached_property
    def values(self) -> tuple[tuple[CellPart, Member], ...]:
        """Values of every frame, each with the part that holds it."""
        return tuple(
            (part, member) for part in self.parts if isinstance(part, CellPart) for member in part.values
        )

    def known_at(self, part: Part, pieces: tuple[Bits, ...]) -> bool:
        """Whether a receiver of the header knows all pieces at the end of this part."""
        done = self.front[: self.front.index(part) + 1]
        return all(bits.part in done for bits in pieces)

    def identifies(self, part: Part) -> bool:
        """Whether the part holds bits of the message number, or of an address beside it."""
        return id(part) in self._identifying

    @cached_property
    def _identifying(self) -> frozenset[int]:
        if self.payload.opening:
            return frozenset()
        return frozenset(id(bits.part) for bits in (*self.id, *self.address))

    def offset(self, wanted: Part) -> int:
        """Offset of a part; the payload counts as empty."""
        return sum(part.size for part in self.parts[: self.parts.index(wanted)])

    def from_end(self, wanted: Part) -> int:
        """Distance of a part after the payload from the end of the frame."""
        return sum(part.size for part in self.parts[self.parts.index(wanted) :])

    def between(self, front: int, back: int) -> tuple[Part, ...]:
        """All parts except those in the first ``front`` and last ``back`` bytes."""
        return tuple(
            part
            for index, part in enumerate(self.parts)
            if (index >= self.payload_at or self.offset(part) >= front)
            and (index <= self.payload_at or self.from_end(part) > back)
        )

    def covered(self, part: Part) -> bool:
        """Whether the main check value covers the part."""
        return self.check is not None and part.name in self.check.check.over

    def coverage(self, check: CheckPart) -> tuple[tuple[Part, ...] | Seed, ...]:
        """What a check value covers, in order: adjacent parts as one run, and seeds."""
        found: list[list[Part] | Seed] = []
        places = {part.name: index for index, part in enumerate(self.parts)}
        last = -2
        for name in check.check.over:
            if name.startswith(ATTRIBUTE):
                found.append(Seed(name.removeprefix(ATTRIBUTE)))
                last = -2
                continue
            if name not in places:  # the id of a packet, which its response does not repeat
                continue
            if places[name] == last + 1 and found and isinstance(found[-1], list):
                found[-1].append(self.parts[places[name]])
            else:
                found.append([self.parts[places[name]]])
            last = places[name]
        return tuple(each if isinstance(each, Seed) else tuple(each) for each in found)

    def seeds(self, check: CheckPart) -> tuple[Seed, ...]:
        """The seeds that a check value covers."""
        return tuple(each for each in self.coverage(check) if isinstance(each, Seed))

    @cached_property
    def seeded(self) -> tuple[CheckPart, ...]:
        """Check values that cover a seed, so that they can be verified only if the message is known."""
        return tuple(part for part in self.checks if self.seeds(part))


def _fixing(part: Part, cells: Mapping[int, CellPart]) -> Part:
    """A part among those in which values are always the same, by the identity of the original."""
    match part:
        case CellPart():
            return cells[id(part)]
        case EqualPart(of=CellPart() as of):
            return replace(part, of=cells[id(of)])
        case _:
            return part


def _bits_of(part: Part, whole: type[Part], slot: type[Slot]) -> Iterator[Bits]:
    if isinstance(part, IdPart | AddressPart) and isinstance(part, whole):
        yield Bits(part, 0, part.integer.bits, 0)
    elif isinstance(part, CellPart):
        yield from (
            Bits(part, each.shift, each.bits, each.at)
            for each in part.slots
            if isinstance(each, slot) and not isinstance(each, ConstantSlot | Member)
        )
