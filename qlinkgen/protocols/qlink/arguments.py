"""Checks of user arguments: errors state the argument, its value and the rule."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf


def whole(name: str, value: object, low: int, high: int) -> int:
    """Return an integer of a range.

    Raises:
        ValueError: the value is not an integer, or out of range.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise ValueError(f"{name}={value!r} must be an integer from {low} to {high}")
    return value


def positive(name: str, value: object, unit: str, most: float | None = None) -> float:
    """Return a finite number from 0 to `most`.

    Raises:
        ValueError: the value is not such a number.
    """
    if (
        not isinstance(value, int | float)
        or not 0 <= value <= (inf if most is None else most)
        or value == inf
    ):
        limit = "0 or more" if most is None else f"0 to {most}"
        raise ValueError(f"{name}={value!r} must be {limit} {unit}")
    return value


def known(name: str, values: Iterable[str], legal: Iterable[str]) -> frozenset[str]:
    """Return names after checking that all are legal.

    A string is a single name.

    Raises:
        ValueError: a name is unknown.
    """
    names = frozenset({values} if isinstance(values, str) else values)
    if strange := names - set(legal):
        seen = ", ".join(sorted(map(repr, strange)))
        raise ValueError(f"{name}: unknown {seen}; known are {', '.join(sorted(legal))}")
    return names
