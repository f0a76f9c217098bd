"""Numbers as text: decimal or hexadecimal digits."""

from __future__ import annotations

import re
from typing import Literal

from qlinkgen._dataclass import dataclass

_DECIMAL = re.compile(rb"[+-]?([0-9]*)\.?([0-9]*)\Z")
_HEXADECIMAL = re.compile(rb"[0-9A-Fa-f]+\Z")


@dataclass(frozen=True, slots=True)
class Digits:
    """A number as text.

    Attributes:
        base: decimal numbers have a sign if they may be negative.
        least: characters that are sent at least; zeros fill them up.
        most: maximum number of characters.
        point: number of digits after the decimal point, 0 without one.
        spaced: spaces fill up a decimal number, before its sign. Zeros are received too.
        plain: digits alone are received, neither a sign nor a decimal point.
    """

    base: Literal[10, 16]
    least: int
    most: int
    point: int = 0
    spaced: bool = False
    plain: bool = False

    @property
    def fixed(self) -> bool:
        """Whether the number of characters is constant."""
        return self.least == self.most

    @property
    def shortest(self) -> int:
        """Minimum number of characters that are received."""
        return self.least if self.fixed else 1

    @property
    def highest(self) -> int:
        """Greatest number whose text is not too long."""
        return int(self.base ** max(0, self.most - bool(self.point))) - 1

    @property
    def lowest(self) -> int:
        """Least number whose text is not too long."""
        digits = self.most - bool(self.point) - 1
        return 1 - 10**digits if self.base == 10 and digits > self.point else 0

    @property
    def alphabet(self) -> frozenset[int]:
        """The bytes of a text."""
        spaces = frozenset(b" " if self.spaced else b"")
        if self.base == 16:
            return frozenset(b"0123456789ABCDEFabcdef")
        return spaces | frozenset(b"0123456789" if self.plain else b"+-.0123456789")

    def text(self, number: int) -> bytes:
        """The text of a number; it is longer than ``most`` if the number is not in range."""
        if self.base == 16:
            return b"%0*X" % (self.least, number)
        digits = b"%0*d" % (self.point + 1, abs(number))
        whole = digits[: -self.point] + b"." + digits[-self.point :] if self.point else digits
        sign = b"-" if number < 0 else b""
        if self.spaced:
            return (sign + whole).rjust(self.least)
        return sign + whole.rjust(self.least - len(sign), b"0")

    def number(self, text: bytes) -> int | None:
        """The number of a text, None if it has none in these steps. Digits beyond the point may be zeros."""
        if self.base == 16:
            return int(text, 16) if _HEXADECIMAL.match(text) else None
        if self.plain:
            return int(text) if text.isdigit() else None
        text = self.trimmed(text)
        found = _DECIMAL.match(text)
        if found is None or not found[1] + found[2] or found[2][self.point :].strip(b"0"):
            return None
        number = int(found[1] + found[2][: self.point].ljust(self.point, b"0") or b"0")
        return -number if text.startswith(b"-") else number

    @property
    def wrong(self) -> bytes:
        """A text of the greatest size that is not a number."""
        return b"G" * self.most

    def trimmed(self, text: bytes) -> bytes:
        """A text without what fills it up."""
        return text.lstrip(b" ") if self.spaced else text

    @property
    def name(self) -> str:
        """The form as written in a schema, without the number of characters."""
        return "decimal" if self.base == 10 else "hex"

    def __str__(self) -> str:
        """As written in a schema."""
        size = str(self.least) if self.fixed else f"{self.least}..{self.most}"
        return f"{self.name}[{size}]{' after spaces' if self.spaced else ''}"
