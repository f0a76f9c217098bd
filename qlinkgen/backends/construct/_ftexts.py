"""Numbers as text.

Copied next to the modules that need it, unchanged.
"""

from __future__ import annotations

import re
from typing import BinaryIO

from construct import (
    Construct,
    Container,
    IntegerError,
    ValidationError,
    stream_read,
    stream_read_entire,
    stream_write,
)

_DECIMAL = re.compile(rb"[+-]?([0-9]*)\.?([0-9]*)\Z")
_HEXADECIMAL = re.compile(rb"[0-9A-Fa-f]+\Z")


class TextNumber(Construct):
    """An integer from low to high as text of ``least`` to ``most`` characters.

    ``point`` digits follow the decimal point. One of variable size is all bytes, which the Message limits.
    """

    def __init__(
        self,
        base: int,
        least: int,
        most: int,
        *,
        low: int,
        high: int,
        point: int = 0,
    ) -> None:
        super().__init__()
        self.base = base
        self.least = least
        self.most = most
        self.low = low
        self.high = high
        self.point = point

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> int:
        if self.least == self.most:
            text = stream_read(stream, self.most, path)
        else:
            text = stream_read_entire(stream, path)
        number = self._number(text)
        if number is None or not self.low <= number <= self.high:
            raise ValidationError(f"{text!r} is not a number in range", path=path)
        return number

    def _number(self, text: bytes) -> int | None:
        if self.base == 16:
            return int(text, 16) if _HEXADECIMAL.match(text) else None
        found = _DECIMAL.match(text)
        if found is None or (self.low >= 0 and text[:1] in (b"+", b"-")):
            return None
        whole, fraction = found[1], found[2]
        if not whole + fraction or fraction[self.point :].strip(b"0"):
            return None
        digits = whole + fraction[: self.point].ljust(self.point, b"0")
        number = int(digits or b"0")
        return -number if text[:1] == b"-" else number

    def _build(
        self, obj: object, stream: BinaryIO, context: Container, path: str
    ) -> object:
        if not isinstance(obj, int) or not self.low <= obj <= self.high:
            raise IntegerError(f"{obj!r} is not in range", path=path)
        if self.base == 16:
            text = f"{obj:0{self.least}X}"
        else:
            sign, digits = "-" * (obj < 0), f"{abs(obj):0{self.point + 1}d}"
            if self.point:
                digits = f"{digits[: -self.point]}.{digits[-self.point :]}"
            text = sign + digits.rjust(self.least - len(sign), "0")
        stream_write(stream, text.encode(), len(text), path)
        return obj

    def _sizeof(self, context: Container, path: str) -> int:
        return self.most
