"""Checks of what a user hands in: the error says what was seen, the rule, and the name of the argument."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf


def whole(name: str, value: object, low: int, high: int) -> int:
    """Return a whole number of a range.

    Raises:
        ValueError: it is no whole number, or out of the range.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise ValueError(f"{name}={value!r}: give a whole number from {low} to {high}")
    return value


def positive(name: str, value: object, unit: str, most: float | None = None) -> float:
    """Return a finite number that is not negative, and at most `most`.

    Raises:
        ValueError: it is not.
    """
    if (
        not isinstance(value, int | float)
        or not 0 <= value <= (inf if most is None else most)
        or value == inf
    ):
        limit = "0 or more" if most is None else f"0 to {most}"
        raise ValueError(f"{name}={value!r}: give {limit} {unit}")
    return value


def known(name: str, values: Iterable[str], legal: Iterable[str]) -> frozenset[str]:
    """Return names that are all legal.

    A single text is taken as one name: its letters are none.

    Raises:
        ValueError: one of them is not.
    """
    names = frozenset({values} if isinstance(values, str) else values)
    if strange := names - set(legal):
        seen = ", ".join(sorted(map(repr, strange)))
        raise ValueError(f"{name}: {seen} not known; there are {', '.join(sorted(legal))}")
    return names
