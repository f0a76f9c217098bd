"""Formatting of the items of PRINT: text, numbers with `[width, decimals]`, control characters."""

from __future__ import annotations

import math
from collections.abc import Iterator
from decimal import Decimal
from fractions import Fraction
from typing import NamedTuple

from qlinkgen.protocols.trio.facts import DECIMALS, LONGEST_TEXT

#: A number that BASIC can print.
Number = int | float | Decimal | Fraction
#: Largest width of a printed number.
WIDEST = 127


class Formatted(NamedTuple):
    """A number with its format; `VALUE` makes it."""

    number: Number
    width: int
    decimals: int

    def __str__(self) -> str:
        """Return the number, right-aligned in its field; asterisks if the field is too narrow."""
        text = f"{Decimal(self.number) if isinstance(self.number, int) else self.number:.{self.decimals}f}"
        if not text.strip("-0."):
            text = text.lstrip("-")  # a display does not show -0.0
        return text.rjust(self.width) if len(text) <= self.width or not self.width else "*" * self.width


def VALUE(number: Number, width: int = 0, decimals: int = DECIMALS) -> Formatted:  # noqa: N802  # as CHR
    """Return `number[width, decimals]` of BASIC, and with `width=0` `number[decimals]`.

    Args:
        number: number to print, rounded half to even.
        width: characters of the field, including point, sign and decimals; 0 for as many as needed. A field
            that is too narrow is filled with asterisks.
        decimals: digits after the point, 0 for none and no point.

    Raises:
        TypeError: `number` is not a number.
        ValueError: width or decimals is out of range, or the number is not finite.
    """
    if isinstance(number, bool) or not isinstance(number, Number):
        raise TypeError(f"number: {number!r} was given; give an int, a float, a Decimal or a Fraction")
    if isinstance(number, Fraction):
        number = Decimal(number.numerator) / Decimal(number.denominator)
    if not -math.inf < number < math.inf:
        raise ValueError(f"number: {number} was given; give a finite number")
    for name, given in (("width", width), ("decimals", decimals)):
        if type(given) is not int or not 0 <= given <= WIDEST:
            raise ValueError(f"{name}: {given!r} was given; give 0 to {WIDEST}")
    return Formatted(number, width, decimals)


def CHR(code: int) -> str:  # noqa: N802  # programs of the document read as they are written there
    """Return a character by its number, 0-127.

    Raises:
        ValueError: the ring cannot carry it.
    """
    if type(code) is not int or not 0 <= code <= 127:
        raise ValueError(f"CHR: {code!r} was given; the ring carries characters 0 to 127")
    return chr(code)


def CURSOR(position: int) -> str:  # noqa: N802
    """Return the sequence that moves the cursor, 0 being the upper left: `CHR(27);CHR(72);CHR(position)`.

    Raises:
        ValueError: the position is out of range.
    """
    if type(position) is not int or not 0 <= position <= 127:
        raise ValueError(f"CURSOR: {position!r} was given; places have the numbers 0 to 127")
    return CHR(27) + CHR(72) + CHR(position)


def printed(items: tuple[str | Number | Formatted, ...], sep: str, end: str) -> str:
    """Return the text that one PRINT sends.

    Raises:
        TypeError: an item is neither text nor a number.
        ValueError: a character that the ring cannot carry.
    """
    text = sep.join(map(_text, items)) + end
    if not text.isascii():
        bad = next(character for character in text if not character.isascii())
        raise ValueError(f"PRINT: {bad!r} was given; the ring carries seven-bit characters")
    return text


def _text(item: str | Number | Formatted) -> str:
    if isinstance(item, str):
        return item
    if isinstance(item, Formatted):
        return str(item)
    return str(VALUE(item))


def pieces(text: str) -> Iterator[str]:
    """Cut a text into pieces for one message each."""
    for start in range(0, len(text), LONGEST_TEXT):
        yield text[start : start + LONGEST_TEXT]
