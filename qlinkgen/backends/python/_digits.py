"""Numbers as text, and texts between separators.

Copied next to the modules that need it, unchanged.
"""

from __future__ import annotations

from ._support import TextRule

TYPE_CHECKING = False  # as typing.TYPE_CHECKING; importing `typing` costs 5 ms
if TYPE_CHECKING:
    from collections.abc import Sequence

    from ._support import Value


def decimal(number: int, least: int, point: int) -> bytes:
    """The decimal text of a number with digits after the point, of at least so many characters."""
    whole, fraction = divmod(abs(number), 10**point)
    sign = b"-" if number < 0 else b""
    size = max(1, least - point - len(sign) - 1)
    return b"%b%0*d.%0*d" % (sign, size, whole, point, fraction)


def read_decimal(text: bytes, point: int, low: int, high: int) -> int:
    """The number of a decimal text, in steps of 10 ** -point; more than high if it is none from low to high.

    The limit low is not positive.
    """
    if point and len(text) > point and text[~point] == 0x2E:
        digits = text.replace(b".", b"", 1)
    else:
        digits = b"" if point else text
    if digits.isdigit():  # the usual form
        return int(digits)
    sign = text[:1]
    if low < 0 and sign in (b"-", b"+"):
        text = text[1:]
    whole, _, fraction = text.partition(b".")
    if not (whole + fraction).isdigit() or fraction[point:].strip(b"0"):
        return high + 1
    number = int(whole + fraction[:point].ljust(point, b"0") or b"0")
    number = -number if sign == b"-" else number
    return number if low <= number <= high else high + 1


def read_hexadecimal(text: bytes, high: int) -> int:
    """The number of hexadecimal digits of either case; high + 1 if it is not one up to high."""
    number = (
        int(text, 16)
        if text.isalnum() and not text.upper().strip(b"0123456789ABCDEF")
        else high + 1
    )
    return min(number, high + 1)


def start_of(texts: Sequence[bytes], index: int) -> int:
    """The offset of a text in the payload that they are from."""
    return sum(map(len, texts[:index])) + index


class BetweenRule(TextRule):
    """Text of seven-bit characters without some of them: those that separate or end it."""

    __slots__ = ("excluded",)

    def __init__(self, name: str, fewest: int, most: int, excluded: bytes) -> None:
        super().__init__(name, fewest, most)
        self.excluded = excluded.decode()
        self.legal += f" without {self.excluded!r}"

    def allows(self, value: Value) -> bool:
        """Whether the value is legal text, and none of its characters is excluded."""
        return super().allows(value) and not {*value} & {*self.excluded}
