"""Floating-point numbers as text, with a decimal exponent."""

from __future__ import annotations

import re
import struct
from fractions import Fraction

from qlinkgen._dataclass import dataclass

_NUMBER = re.compile(rb"[+-]?(?=\.?[0-9])([0-9]*)\.?([0-9]*)(?:[Ee]([+-]?[0-9]+))?\Z")
_FORMATS = {32: ">f", 64: ">d"}
#: Digits with which every number can be told from all others.
_DIGITS = {32: 9, 64: 17}
#: Bits of the significand with the hidden one, and exponent of the last bit of the smallest numbers.
_SIGNIFICANDS = {32: (24, -149), 64: (53, -1074)}
#: A text of no number.
_TOO_LARGE = b"1E+9999"
#: A greater exponent is out of range whatever the digits are.
_MOST_EXPONENT = 9999


@dataclass(frozen=True, slots=True)
class Scientific:
    """The bits of a floating-point number of 32 or 64 bits as ``-1.5E-03``.

    Sent are the fewest significant digits with which the text is read as the same number, and an exponent of
    at least two digits. Received is any decimal number of ``most`` characters, with or without an exponent;
    it is the nearest floating-point number, ties to even.
    """

    bits: int

    #: Characters that are sent at least: 1E+00.
    least = 5
    #: Maximum number of characters: -1.2345678901234567E+300.
    most = 24
    #: Minimum number of characters that are received.
    shortest = 1
    #: Whether the number of characters is constant.
    fixed = False
    #: The form as written in a schema.
    name = "scientific"
    #: The bytes of a text.
    alphabet = frozenset(b"+-.0123456789Ee")

    @property
    def highest(self) -> int:
        """The greatest pattern of bits."""
        return (1 << self.bits) - 1

    @property
    def lowest(self) -> int:
        """The least one."""
        return 0

    @property
    def digits(self) -> int:
        """Significant digits that are sent at most."""
        return _DIGITS[self.bits]

    def text(self, number: int) -> bytes:
        """The text of bits; one that is out of range for an infinity or NaN."""
        value = struct.unpack(_FORMATS[self.bits], number.to_bytes(self.bits // 8, "big"))[0]
        texts = (b"%.*E" % (after, value) for after in range(self.digits))
        return next((text for text in texts if self.number(text) == number), _TOO_LARGE)

    def number(self, text: bytes) -> int | None:
        """The bits of a text, None if it is not a number or is too large."""
        found = _NUMBER.match(text)
        if found is None:
            return None
        negative = text.startswith(b"-") << self.bits - 1
        digits, exponent = int(found[1] + found[2]), int(found[3] or b"0") - len(found[2])
        if digits == 0 or exponent < -_MOST_EXPONENT:
            return negative
        if exponent > _MOST_EXPONENT:
            return None
        magnitude = self._nearest(digits * Fraction(10) ** exponent)
        return None if magnitude is None else negative | magnitude

    def _nearest(self, value: Fraction) -> int | None:
        """The bits of the nearest number to a positive one, None if that is infinite."""
        size, last = _SIGNIFICANDS[self.bits]
        estimate = value.numerator.bit_length() - value.denominator.bit_length() - size
        unit = max(last, estimate)
        steps = round(value / Fraction(2) ** unit)
        if steps >> size:  # the estimate is one too small, or rounding carries
            unit += 1
            steps = round(value / Fraction(2) ** unit)
        pattern = steps + (unit - last << size - 1)
        return None if pattern >> size - 1 >= (1 << self.bits - size) - 1 else pattern

    @property
    def wrong(self) -> bytes:
        """A text of the greatest size that is not a number."""
        return b"G" * self.most

    def __str__(self) -> str:
        """As written in a schema."""
        return self.name
