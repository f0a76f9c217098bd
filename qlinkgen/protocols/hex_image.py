"""The memory image of an Intel HEX program, and the reader of virtual nodes.

The reader takes the text in pieces of any size, as received, needs no package, and shares no code with
`hexfile`, which reads files for the master, so that each verifies the other.
"""

from __future__ import annotations

import re
from binascii import Error as NoHex
from binascii import unhexlify
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

_SPACE = re.compile(rb"[ \t\r\n]*")
_SEGMENT = 0x1_0000
_LINEAR = 0x1_0000_0000
#: Data bytes of every type of record except data.
SIZES = {1: 0, 2: 2, 3: 4, 4: 2, 5: 4}


@dataclass(frozen=True, slots=True)
class HexImage:
    """A whole program.

    Attributes:
        text: the Intel HEX text, byte for byte as on the wire.
        segments: address and bytes of each contiguous block, sorted.
        entry: start address, None if the program has none. CS:IP is represented as CS * 65536 + IP.
    """

    text: bytes
    segments: tuple[tuple[int, bytes], ...]
    entry: int | None = None

    @property
    def size(self) -> int:
        """Number of bytes that the program puts into memory."""
        return sum(len(data) for _, data in self.segments)

    @property
    def start(self) -> int:
        """Lowest address of the program; 0 of an empty one."""
        return self.segments[0][0] if self.segments else 0

    @property
    def end(self) -> int:
        """Address after the highest of the program; 0 of an empty one."""
        return self.segments[-1][0] + len(self.segments[-1][1]) if self.segments else 0

    def memory(self) -> dict[int, int]:
        """Return every byte by its address."""
        return {start + index: byte for start, data in self.segments for index, byte in enumerate(data)}


class BrokenRecord(ValueError):
    """The text is not Intel HEX. The reader that raised it cannot continue."""


class HexReader:
    """Reads the records of a text in pieces, and builds the memory image.

    Attributes:
        records: records read.
        segments: as in HexImage, None until the end record has been read.
        entry: as in HexImage.
    """

    def __init__(self) -> None:
        self.records = 0
        self.segments: tuple[tuple[int, bytes], ...] | None = None
        self.entry: int | None = None
        self._rest = b""
        self._chunks: list[tuple[int, bytearray]] = []
        self._base = 0
        self._room = _SEGMENT  # addresses from the base up that a record may reach

    def feed(self, piece: bytes) -> None:
        """Read on.

        Raises:
            BrokenRecord: with the number of the record, counted from 1.
        """
        text = self._rest + piece
        at = 0
        try:
            while (begin := _SPACE.match(text, at).end()) < len(text):  # type: ignore[union-attr]
                at = self._end_of(text, begin)
                if at > len(text):
                    break
                self._take(_digits(text[begin + 1 : at]))
                self.records += 1
        except BrokenRecord as fault:
            raise BrokenRecord(f"record {self.records + 1}: {fault}") from None
        self._rest = text[begin:]

    def _end_of(self, text: bytes, begin: int) -> int:
        """Return the end of the record from its count; beyond the text if the count is not known yet."""
        if self.segments is not None:
            raise BrokenRecord(f"{text[begin : begin + 8]!r} seen; nothing follows the end record")
        if text[begin : begin + 1] != b":":
            raise BrokenRecord(f"{text[begin : begin + 8]!r} seen; a record begins with ':'")
        if len(text) < begin + 3:
            return len(text) + 1
        return begin + 11 + 2 * _digits(text[begin + 1 : begin + 3])[0]

    def _take(self, record: bytes) -> None:
        if sum(record) & 0xFF:
            raise BrokenRecord(f"checksum {record[-1]:02X}, must be {-sum(record[:-1]) & 0xFF:02X}")
        kind, data = record[3], record[4:-1]
        if kind == 0:
            self._store(int.from_bytes(record[1:3], "big"), data)
            return
        if kind not in SIZES:
            raise BrokenRecord(f"type {kind:02X}; types are 00 to 05")
        if len(data) != SIZES[kind]:
            raise BrokenRecord(f"{len(data)} data bytes; type {kind:02X} has {SIZES[kind]}")
        number = int.from_bytes(data, "big")
        if kind == 1:
            self.segments = segments_of(self._chunks)
        elif kind in {2, 4}:
            self._base, self._room = (number << 4, _SEGMENT) if kind == 2 else (number << 16, _LINEAR)
        else:
            self.entry = number

    def _store(self, offset: int, data: bytes) -> None:
        start = self._base + offset
        if offset + len(data) > self._room or start + len(data) > _LINEAR:
            raise BrokenRecord(f"{len(data)} bytes at {start:#x} exceed the end of their segment")
        if self._chunks and self._chunks[-1][0] + len(self._chunks[-1][1]) == start:
            self._chunks[-1][1].extend(data)
        else:
            self._chunks.append((start, bytearray(data)))


def segments_of(chunks: Iterable[tuple[int, bytes | bytearray]]) -> tuple[tuple[int, bytes], ...]:
    """Sort and join chunks of memory.

    Raises:
        BrokenRecord: two of them overlap.
    """
    ordered = sorted((start, bytes(data)) for start, data in chunks if data)
    for (start, data), (following, _) in pairwise(ordered):
        if following < start + len(data):
            raise BrokenRecord(f"overlapping data at {following:#x}")
    joined: list[tuple[int, bytearray]] = []
    for start, data in ordered:
        if joined and joined[-1][0] + len(joined[-1][1]) == start:
            joined[-1][1].extend(data)
        else:
            joined.append((start, bytearray(data)))
    return tuple((start, bytes(data)) for start, data in joined)


def _digits(text: bytes | bytearray) -> bytes:
    try:
        return unhexlify(text)
    except NoHex:
        raise BrokenRecord(f"{bytes(text)!r} has a character that is not a hexadecimal digit") from None
