"""Conditions on values of a message, which decide whether a later field is present."""

from __future__ import annotations

from collections.abc import Iterable

from qlinkgen._dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Test:
    """A condition on one value: its raw number is in one of the ranges; ``negated``: in none of them."""

    value: str
    ranges: tuple[tuple[int, int], ...]
    negated: bool = False

    def holds(self, raw: int) -> bool:
        """Whether the condition is true of a raw number."""
        return any(first <= raw <= last for first, last in self.ranges) != self.negated


#: Tests that all hold; () is always true.
Condition = tuple[Test, ...]


def exclusive(one: Condition, other: Condition) -> bool:
    """Whether tests of the same value keep two conditions from holding both."""
    return any(
        first.value == second.value
        and not any(first.holds(raw) and second.holds(raw) for raw in turning_points((first, second)))
        for first in one
        for second in other
    )


def turning_points(tests: Iterable[Test]) -> set[int]:
    """Numbers at which the tests have every combination of outcomes that they can have for one number."""
    ranges = [each for test in tests for each in test.ranges]
    before = min((first for first, _ in ranges), default=0) - 1
    return {before, *(first for first, _ in ranges), *(last + 1 for _, last in ranges)}
