"""Sizes that depend on counts, and conditions on numbers: the expressions that targets print."""

from __future__ import annotations

from collections.abc import Mapping
from math import gcd

from qlinkgen._dataclass import dataclass
from qlinkgen.model.integer import packed_size
from qlinkgen.model.types import Characters


@dataclass(frozen=True, slots=True)
class Term:
    """``factor`` bytes for each item of the run ``run``, or bits if they are ``packed`` to whole bytes.

    ``more`` is added to that: bytes that a count counts beside the run, less its offset.
    """

    run: str
    factor: int
    packed: bool = False
    more: int = 0

    def value(self, number: int) -> int:
        """The size in bytes of so many items."""
        return self.more + (packed_size(number, self.factor) if self.packed else number * self.factor)

    def items_in(self, size: int) -> int:
        """The number of items that fit a size."""
        own = size - self.more
        return 8 * own // self.factor if self.packed else own // self.factor

    @property
    def per_byte(self) -> tuple[int, int]:
        """The number of items in a byte as a fraction in lowest terms."""
        units = 8 if self.packed else 1
        common = gcd(units, self.factor)
        return units // common, self.factor // common


@dataclass(frozen=True, slots=True)
class Size:
    """A size: ``fixed`` bytes plus a term for each run of variable size, in wire order."""

    fixed: int = 0
    terms: tuple[Term, ...] = ()

    def __add__(self, other: int) -> Size:
        """This size with more fixed bytes."""
        return Size(self.fixed + other, self.terms)

    def plus(self, term: Term) -> Size:
        """This size with a term for one more run."""
        return Size(self.fixed, (*self.terms, term))

    def since(self, other: Size) -> Size:
        """What this size adds to another one, which it begins with."""
        return Size(self.fixed - other.fixed, self.terms[len(other.terms) :])

    def value(self, counts: Mapping[str, int]) -> int:
        """The size in bytes for the given number of items of each run."""
        return self.fixed + sum(term.value(counts[term.run]) for term in self.terms)


@dataclass(frozen=True, slots=True)
class Within:
    """The number is between two bounds, inclusive."""

    low: int
    high: int

    def holds(self, number: int) -> bool:
        """Whether the condition is true of a number."""
        return self.low <= number <= self.high


@dataclass(frozen=True, slots=True)
class Clear:
    """All bits of the mask are zero."""

    mask: int

    def holds(self, number: int) -> bool:
        """Whether the condition is true of a number."""
        return number & self.mask == 0


@dataclass(frozen=True, slots=True)
class OneOf:
    """The number is in one of several ranges."""

    ranges: tuple[Within, ...]

    def holds(self, number: int) -> bool:
        """Whether the condition is true of a number."""
        return any(each.holds(number) for each in self.ranges)


@dataclass(frozen=True, slots=True)
class Legible:
    """The bytes of the number are legal characters."""

    characters: Characters

    def holds(self, number: int) -> bool:
        """Whether the condition is true of a number."""
        return self.characters.allows(number)


Condition = Within | Clear | OneOf | Legible
