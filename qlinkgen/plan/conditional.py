"""Parts of a frame that only some frames have: values of its header decide."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from qlinkgen.model.condition import Condition, Test
from qlinkgen.plan.parts import CellPart, Part
from qlinkgen.plan.payload import Member


@dataclass(frozen=True, slots=True)
class Selector:
    """Bits of a part, as an unsigned number that meets a condition."""

    part: CellPart
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
    """Adjacent parts with values, which a frame has where values of its header meet a condition.

    A frame without them has the defaults of their values.

    Attributes:
        parts: the integers with the values.
        selectors: conditions that all hold.
        tests: the same on the values by name.
    """

    parts: tuple[CellPart, ...]
    selectors: tuple[Selector, ...]
    tests: Condition

    @property
    def size(self) -> int:
        """Bytes of all parts."""
        return sum(part.size for part in self.parts)

    @property
    def values(self) -> tuple[Member, ...]:
        """The values in them."""
        return tuple(member for part in self.parts for member in part.values)

    @property
    def initial(self) -> bytes:
        """The bytes of all parts with the defaults of their values."""
        return b"".join(part.integer.pack(part.initial) for part in self.parts)

    def holds(self, cells: Mapping[str, bytes]) -> bool:
        """Whether a frame with these parts in its header has them."""
        return all(each.holds(cells) for each in self.selectors)


def conditional(parts: Iterable[Part], conditions: Mapping[str, Condition]) -> Conditional | None:
    """Those of these parts that have a condition, which is the same for all; None without any."""
    cells = [part for part in parts if isinstance(part, CellPart)]
    found = tuple(part for part in cells if part.name in conditions)
    if not found:
        return None
    tests = conditions[found[0].name]
    held = {member.name: (part, member) for part in cells for member in part.values}
    return Conditional(found, tuple(_selector(*held[test.value], test) for test in tests), tests)


def _selector(part: CellPart, member: Member, test: Test) -> Selector:
    ranges = (each for low, high in test.ranges for each in _unsigned(low, high, member.bits))
    return Selector(part, member.shift, member.bits, Test(test.value, tuple(ranges), test.negated))


def _unsigned(low: int, high: int, bits: int) -> Iterator[tuple[int, int]]:
    """The numbers of a range as their bits, which are in one range or in two."""
    if low < 0:
        yield low + (1 << bits), min(high, -1) + (1 << bits)
    if high >= 0:
        yield max(low, 0), high
