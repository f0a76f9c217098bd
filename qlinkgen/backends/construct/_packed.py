"""Decimal digits, padding, and arrays of a few bits in a row: classes that only some protocols need.

Copied next to the modules that need it, unchanged.
"""

from __future__ import annotations

from typing import BinaryIO

from construct import (
    Construct,
    Container,
    IntegerError,
    StringError,
    ValidationError,
    stream_read,
    stream_read_entire,
    stream_write,
)

from ._fields import ArrayField, BytesField, Row


class BcdInteger(Construct):
    """An integer of two decimal digits a byte; ``swapped``: the least significant ones come first."""

    def __init__(self, size: int, *, swapped: bool = False) -> None:
        super().__init__()
        self.size = size
        self.step = -1 if swapped else 1

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> int:
        digits = stream_read(stream, self.size, path)[:: self.step].hex()
        if not digits.isdecimal():
            raise ValidationError(f"{digits} has digits above 9", path=path)
        return int(digits)

    def _build(
        self, obj: object, stream: BinaryIO, context: Container, path: str
    ) -> object:
        if not isinstance(obj, int) or not 0 <= obj < 100**self.size:
            raise IntegerError(
                f"{obj!r} does not have {2 * self.size} digits", path=path
            )
        data = bytes.fromhex(f"{obj:0{2 * self.size}d}")[:: self.step]
        stream_write(stream, data, self.size, path)
        return obj

    def _sizeof(self, context: Container, path: str) -> int:
        return self.size


class PackedField(ArrayField):
    """A list of items of a few bits in a row, padded with zero bits to whole bytes.

    The first item has the least significant bits of the first byte, or the most significant ones if ``most``.
    Items are constructs of Bits. It takes all bytes, which the Message limits.
    """

    def __init__(
        self, item: Construct, bits: int, most: bool, minimum: int, maximum: int
    ) -> None:
        super().__init__(_Sized(), minimum, maximum)
        self.item = item
        self.bits = bits
        self.most = most

    def extent(self, number: int) -> int:
        """Size of so many items."""
        return (number * self.bits + 7) // 8

    def _shift(self, index: int, size: int) -> int:
        """The place of the least significant bit of an item."""
        at = index * self.bits
        return 8 * size - at - self.bits if self.most else at

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> Row:
        data = stream_read_entire(stream, path)
        whole = int.from_bytes(data, "big" if self.most else "little")
        known = context.get("number")
        number = self.maximum if known is None else known
        return [
            self.item._parsereport(
                stream, Container(bits=whole >> self._shift(index, len(data))), path
            )
            for index in range(number)
        ]

    def _build(self, obj: Row, stream: BinaryIO, context: Container, path: str) -> Row:
        size = self.extent(self.checked(len(obj), path))
        whole = 0
        for index, item in enumerate(obj):
            place = Container(bits=0)
            self.item._build(item, stream, place, path)
            whole |= place.bits << self._shift(index, size)
        data = whole.to_bytes(size, "big" if self.most else "little")
        stream_write(stream, data, size, path)
        return obj


class PaddedBytesField(BytesField):
    """A byte string of a constant size, filled up with ``pad``, with which the value does not end."""

    def __init__(self, pad: bytes, minimum: int, maximum: int) -> None:
        super().__init__(minimum, maximum)
        self.pad = pad

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> bytes | str:
        data: bytes = stream_read_entire(stream, path).rstrip(self.pad)
        return data

    def _build(self, obj: Row, stream: BinaryIO, context: Container, path: str) -> Row:
        data = bytes(obj)  # type: ignore[arg-type]
        if len(data) > self.maximum or data.endswith(self.pad):
            text = f"{obj!r} is too long, or ends with {self.pad!r}"
            raise ValidationError(text, path=path)
        stream_write(stream, data.ljust(self.maximum, self.pad), self.maximum, path)
        return obj


class PaddedTextField(PaddedBytesField):
    """7-bit text of a constant size, filled up like PaddedBytesField."""

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> str:
        data: bytes = stream_read_entire(stream, path).rstrip(self.pad)
        if not data.isascii():
            raise StringError(f"{data!r} is not 7-bit text", path=path)
        return data.decode("ascii")

    def _build(self, obj: Row, stream: BinaryIO, context: Container, path: str) -> Row:
        if not isinstance(obj, str) or not obj.isascii():
            raise StringError(f"{obj!r} is not 7-bit text", path=path)
        super()._build(obj.encode("ascii"), stream, context, path)
        return obj


class _Sized(Construct):
    """Stands for the size of an item, which a packed one does not have."""

    def _sizeof(self, context: Container, path: str) -> int:
        return 0
