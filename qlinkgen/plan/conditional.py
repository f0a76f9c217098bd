"""Parts of a frame that only some frames have: values of its header decide."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.model.condition import Condition, Test
from qlinkgen.plan.parts import CellPart, CheckPart, ConstantPart, LengthPart, Part
from qlinkgen.plan.payload import Member

#: A part that only some frames have.
ConditionalPart = CellPart | LengthPart | ConstantPart | CheckPart


@dataclass(frozen=True, slots=True)
class Selector:
    """Bits of a part, as an unsigned number that meets a condition."""

    part: CellPart | LengthPart
    shift: int
    bits: int
    test: Test

    @property
    def mask(self) -> int:
        """Mask of the bits, before they are shifted into place."""
        return (1 << self.bits) - 1

    def holds(self, cells: Mapping[str, bytes]) -> bool:
        """Whether the condition is true of the bytes of parts; not if the part is missing."""
        data = cells.get(self.part.name, b"")
        if len(data) < self.part.size:
            return False
        return self.test.holds(self.part.integer.unpack(data) >> self.shift & self.mask)


@dataclass(frozen=True, slots=True)
class Conditional:
    """Adjacent parts, which a frame has where values of its header meet a condition.

    They hold values, of which a frame without them has the defaults; or a length, if the first hands over. At
    the end of a frame there are constants and check values, too.

    Attributes:
        parts: the integers with the values, or with the length; constants and check values.
        selectors: conditions that all hold.
        tests: the same on the values by name.
    """

    parts: tuple[ConditionalPart, ...]
    selectors: tuple[Selector, ...]
    tests: Condition

    @property
    def size(self) -> int:
        """Bytes of all parts."""
        return sum(part.size for part in self.parts)

    @property
    def values(self) -> tuple[Member, ...]:
        """The values in them."""
        cells = (part for part in self.parts if isinstance(part, CellPart))
        return tuple(member for part in cells for member in part.values)

    @property
    def length(self) -> LengthPart | None:
        """The length of long frames, None if the parts hold values."""
        return next((part for part in self.parts if isinstance(part, LengthPart)), None)

    @property
    def checks(self) -> tuple[CheckPart, ...]:
        """The check values among them."""
        return tuple(part for part in self.parts if isinstance(part, CheckPart))

    @property
    def packed(self) -> tuple[bytes, ...]:
        """The bytes of each part with the defaults of its values; zeros for a length or a check value."""
        return tuple(map(_packed, self.parts))

    @property
    def initial(self) -> bytes:
        """The bytes of all parts with the defaults of their values."""
        return b"".join(self.packed)

    def holds(self, cells: Mapping[str, bytes]) -> bool:
        """Whether a frame with these parts in its header has them."""
        return all(each.holds(cells) for each in self.selectors)


def conditional(parts: Iterable[Part], conditions: Mapping[str, Condition]) -> Conditional | None:
    """Those of these parts that have a condition, which is the same for all; None without any."""
    able = [part for part in parts if isinstance(part, ConditionalPart)]
    found = tuple(part for part in able if part.name in conditions)
    if not found:
        return None
    tests = conditions[found[0].name]
    held = dict[str, tuple[CellPart | LengthPart, Member | None]]()
    for part in able:
        if isinstance(part, ConstantPart | CheckPart):
            continue
        held[part.name] = part, None
        held |= {member.name: (part, member) for member in part.values} if isinstance(part, CellPart) else {}
    return Conditional(found, tuple(_selector(*held[test.value], test) for test in tests), tests)


def _packed(part: ConditionalPart) -> bytes:
    match part:
        case CellPart():
            return part.integer.pack(part.initial)
        case ConstantPart():
            return part.data
        case LengthPart() | CheckPart():
            return bytes(part.size)
        case _:
            assert_never(part)


def _selector(part: CellPart | LengthPart, member: Member | None, test: Test) -> Selector:
    if member is None:
        return Selector(part, 0, part.integer.bits, test)
    ranges = (each for low, high in test.ranges for each in _unsigned(low, high, member.bits))
    return Selector(part, member.shift, member.bits, Test(test.value, tuple(ranges), test.negated))


def _unsigned(low: int, high: int, bits: int) -> Iterator[tuple[int, int]]:
    """The numbers of a range as their bits, which are in one range or in two."""
    if low < 0:
        yield low + (1 << bits), min(high, -1) + (1 << bits)
    if high >= 0:
        yield max(low, 0), high
