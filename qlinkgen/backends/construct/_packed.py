"""Arrays of a few bits in a row: a class that only some protocols need.

Copied next to the modules that need it, unchanged.
"""

from __future__ import annotations

from typing import BinaryIO

from construct import Construct, Container, stream_read_entire, stream_write

from ._fields import ArrayField, Row


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
        number = self.maximum if context.number is None else context.number
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


class _Sized(Construct):
    """Stands for the size of an item, which a packed one does not have."""

    def _sizeof(self, context: Container, path: str) -> int:
        return 0
