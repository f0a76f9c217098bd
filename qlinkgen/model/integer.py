"""Integers on the wire: the bits that each byte carries."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Literal

from qlinkgen._dataclass import dataclass
from qlinkgen.model.digits import Digits
from qlinkgen.model.scientific import Scientific
from qlinkgen.model.words import Words

ByteOrder = Literal["big", "little"]
#: Order of numbers of a few bits in a row of bits: the first one is in the least, or most, significant bits.
BitOrder = Literal["least", "most"]
#: How a number is written as text.
TextForm = Digits | Words | Scientific


@dataclass(frozen=True, slots=True)
class Chunk:
    """The bits ``shift .. shift + bits - 1`` of an integer, carried in the low bits of one wire byte."""

    shift: int
    bits: int

    @property
    def mask(self) -> int:
        """Mask of the bits used in the wire byte; the others are zero."""
        return (1 << self.bits) - 1


def byte_chunks(size: int, byteorder: ByteOrder) -> tuple[Chunk, ...]:
    """Chunks of an integer of ``size`` whole bytes."""
    chunks = tuple(Chunk(8 * index, 8) for index in range(size))
    return chunks if byteorder == "little" else chunks[::-1]


def group_chunks(parts: tuple[tuple[int, int], ...], bits: int, least_first: bool) -> tuple[Chunk, ...]:
    """Chunks of an integer sent in groups of ``bits`` bits.

    Args:
        parts: The (first bit, last bit) ranges in wire order; each begins a new byte.
        bits: Bits in a group (7 where bit 7 marks the header).
        least_first: The group with the least significant bits of a part is sent first.
    """
    chunks: list[Chunk] = []
    for first, last in parts:
        groups = [Chunk(at, min(bits, last + 1 - at)) for at in range(first, last + 1, bits)]
        chunks += groups if least_first else groups[::-1]
    return tuple(chunks)


def pack_chunks(value: int, chunks: tuple[Chunk, ...]) -> bytes:
    """The wire bytes of an integer; bits outside of the chunks are dropped."""
    return bytes(value >> chunk.shift & chunk.mask for chunk in chunks)


def unpack_chunks(data: bytes, chunks: tuple[Chunk, ...]) -> int:
    """The unsigned integer in its wire bytes; unused bits are ignored."""
    return sum((byte & chunk.mask) << chunk.shift for byte, chunk in zip(data, chunks, strict=True))


def packed_size(number: int, bits: int) -> int:
    """Bytes of a row of so many numbers; the bits after them are unused."""
    return (number * bits + 7) // 8


def pack_row(numbers: Sequence[int], bits: int, order: BitOrder) -> bytes:
    """The bytes of unsigned numbers of a few bits in a row; unused bits are zero."""
    size, whole = packed_size(len(numbers), bits), 0
    for number in numbers if order == "most" else reversed(numbers):
        whole = whole << bits | number
    if order == "least":
        return whole.to_bytes(size, "little")
    return (whole << 8 * size - bits * len(numbers)).to_bytes(size, "big")


def unpack_row(data: bytes, number: int, bits: int, order: BitOrder) -> list[int]:
    """The unsigned numbers of `pack_row`; unused bits are ignored."""
    mask, starts = (1 << bits) - 1, range(0, number * bits, bits)
    if order == "least":
        whole = int.from_bytes(data, "little")
        return [whole >> at & mask for at in starts]
    whole = int.from_bytes(data, "big") >> 8 * len(data) - bits * number
    return [whole >> at & mask for at in reversed(starts)]


@dataclass(frozen=True)
class Integer:
    """The wire layout of an integer, without its meaning."""

    bits: int
    signed: bool
    chunks: tuple[Chunk, ...]
    #: Binary-coded decimal: each four bits are a digit.
    bcd: bool = False
    #: Its digits, or the words for it, if it is sent as text; it has no chunks then.
    text: TextForm | None = None

    @cached_property
    def size(self) -> int:
        """Bytes on the wire, the maximum of a text."""
        return self.text.most if self.text else len(self.chunks)

    @property
    def notation(self) -> str:
        """Its type and how its digits are written, for descriptions; the size of words."""
        if isinstance(self.text, Words):
            return str(self.text)
        form = f" {self.text}" if self.text else " bcd" if self.bcd else ""
        return f"{'i' if self.signed else 'u'}{self.bits}{form}"

    @cached_property
    def minimum(self) -> int:
        """Minimum value that the bits can hold."""
        least = -(1 << (self.bits - 1)) if self.signed else 0
        return max(least, self.text.lowest) if self.text else least

    @cached_property
    def maximum(self) -> int:
        """Maximum value that the bits can hold."""
        if self.bcd:
            return int("9" * (self.bits // 4))
        most = (1 << (self.bits - self.signed)) - 1
        return min(most, self.text.highest) if self.text else most

    @cached_property
    def mask(self) -> int:
        """All bits set."""
        return (1 << self.bits) - 1

    @cached_property
    def byteorder(self) -> ByteOrder | None:
        """Byte order of an integer of whole bytes; None if it is sent in smaller groups."""
        orders: tuple[ByteOrder, ...] = ("big", "little")
        for order in orders:
            if self.bits == 8 * self.size and self.chunks == byte_chunks(self.size, order):
                return order
        return None

    def pack(self, value: int) -> bytes:
        """The wire bytes of a value. Raises ValueError if it does not fit."""
        if not self.minimum <= value <= self.maximum:
            raise ValueError(f"{value} does not fit {self.bits} bits")
        if self.text:
            return self.text.text(value)
        if self.byteorder and not self.bcd:
            return (value & self.mask).to_bytes(self.size, self.byteorder)
        return pack_chunks(int(str(value), 16) if self.bcd else value, self.chunks)

    def unpack(self, data: bytes) -> int:
        """The value in its wire bytes; unused bits and wrong digits are not refused, see `stray`.

        Raises ValueError for another number of bytes.
        """
        if self.text:
            return self.text.number(data) or 0
        if self.byteorder and not self.bcd:
            if len(data) != self.size:
                raise ValueError(f"{len(data)} bytes are not {self.bits} bits")
            return int.from_bytes(data, self.byteorder, signed=self.signed)
        pattern = unpack_chunks(data, self.chunks)
        if self.bcd:
            return sum((pattern >> 4 * place & 0xF) * 10**place for place in range(self.bits // 4))
        return self.signed_value(pattern)

    def signed_value(self, bits: int) -> int:
        """The value of a bit pattern: two's complement if the integer is signed."""
        return bits - (1 << self.bits) if self.signed and bits >> (self.bits - 1) else bits

    def stray(self, data: bytes) -> bool:
        """Whether unused bits are set or digits are wrong, so that the bytes are invalid."""
        if self.text:
            number = self.text.number(data)
            digits = self.text.trimmed(data) if isinstance(self.text, Digits) else b""
            signed = digits[:1] in (b"+", b"-") and self.minimum >= 0
            return number is None or signed or not self.minimum <= number <= self.maximum
        if self.bcd:
            return not data.hex().isdecimal()
        return any(byte & ~chunk.mask for byte, chunk in zip(data, self.chunks, strict=True))
