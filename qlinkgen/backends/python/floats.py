"""Floating-point numbers in Python: struct converts them, in either byte order."""

from __future__ import annotations

from qlinkgen.backends import python_text
from qlinkgen.backends.python import integers
from qlinkgen.model.integer import ByteOrder, Integer
from qlinkgen.model.types import Float, Scalar

#: Format letters of struct by the number of bits.
_LETTERS = {16: "e", 32: "f", 64: "d"}


def letter(number: Scalar, integer: Integer, byteorder: ByteOrder) -> str:
    """The format letter of a number or of its raw integer, "" if struct has none in this byte order."""
    if isinstance(number.meaning, Float):
        return _LETTERS[number.bits] if integer.byteorder == byteorder else ""
    return integers.letter(integer, byteorder)


def format_of(kind: Float, integer: Integer, count: str = "") -> str:
    """The format of a number, or of several, in its own byte order."""
    return f"{'>' if integer.byteorder == 'big' else '<'}{count}{_LETTERS[kind.bits]}"


def holds(kind: Float, number: str) -> list[str]:
    """The expression that is true if a number is legal, none if all are."""
    if not kind.bounds:
        return []
    low, high = map(python_text.real, kind.bounds)
    return [f"{low} <= {number} <= {high}"]
