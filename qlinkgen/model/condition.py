"""Conditions on values of a message, which decide whether a later field is present."""

from __future__ import annotations

from dataclasses import dataclass


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
