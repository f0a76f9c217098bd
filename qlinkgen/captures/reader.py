"""Reads pcapng files, also those that end in the middle of a block or have damaged ones."""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Callable, Iterator
from typing import BinaryIO, Literal, NamedTuple

from qlinkgen.captures.pcapng import (
    COMMENT,
    DIRECTIONS,
    END,
    FLAGS,
    FRAME,
    INTERFACE,
    MAGIC,
    MOST,
    NAME,
    OFFSET,
    PACKET,
    RESOLUTION,
    SECTION,
    SPEED,
    USER0,
    Direction,
    Interface,
    Packet,
)
from qlinkgen.captures.window import Window
from qlinkgen.errors import CaptureError

Order = Literal["<", ">"]
_WAYS: dict[int, Direction] = {number: way for way, number in DIRECTIONS.items()}
_NANO = 10**9
#: Bytes of a damaged file that are searched first for the next block.
_CHUNK = 1 << 12
#: Most wrong blocks of a file that is read on.
_MOST_WRONG = 1000
#: The first word of blocks that matter, by the byte order.
_KINDS: dict[Order, re.Pattern[bytes]] = {
    order: re.compile(
        b"|".join(re.escape(struct.pack(f"{order}I", kind)) for kind in (PACKET, INTERFACE, SECTION))
    )
    for order in ("<", ">")
}


class _Clock(NamedTuple):
    """What the times of an interface mean."""

    #: Ticks per second.
    resolution: int = 10**6
    #: Seconds to add.
    offset: int = 0

    def nanoseconds(self, ticks: int) -> int:
        return ticks * _NANO // self.resolution + self.offset * _NANO


class Reader:
    """Iterates over the packets of a file.

    Attributes:
        interfaces: the ports of the section, by their numbers.
        whole: the file was read to its end, and does not end in the middle of a block.
        skipped: number of blocks passed over: those of other kinds, such as statistics.
    """

    def __init__(self, file: BinaryIO, wrong: Callable[[int, str], None] | None = None) -> None:
        """Read a binary file from its start; it need not be seekable.

        Args:
            file: the file.
            wrong: called with the offset of a wrong block and what is wrong with it; the next block is then
                searched. None: a wrong block raises an error.
        """
        self.interfaces: list[Interface] = []
        self.whole = False
        self.skipped = 0
        self._clocks: list[_Clock] = []
        self._file = Window(file)
        self._told = wrong
        self._order: Order = "<"
        #: Offset of the last block.
        self.at = 0
        self._wrongs = 0

    def __iter__(self) -> Iterator[Packet]:
        """Return the packets in the order of the file.

        Raises:
            CaptureError: the file is not a pcapng file, or a block is wrong and `wrong` is None, or more
                than 1000 are.
        """
        while True:
            self._file.keep()
            self.at = self._file.at
            try:
                block = self._block()
                if block is None:
                    return
                packet = self._read(*block)
            except CaptureError as error:
                self._wrongs += 1
                if self._told is None or self._wrongs > _MOST_WRONG:
                    raise
                self._told(self.at, str(error))
                self._search()
                continue
            if packet is not None:
                yield packet

    def _read(self, kind: int, body: bytes) -> Packet | None:
        """Take a block; return its packet, None if it is of another kind."""
        if kind == PACKET:
            return self._packet(body)
        if kind == INTERFACE:
            self._interface(body)
        elif kind == SECTION:
            self._section(body)
        else:
            self.skipped += 1
        return None

    def _block(self) -> tuple[int, bytes] | None:
        """Return type and body of the next block, None at the end."""
        head = self._file.take(8)
        if self.at == 0 and head[:4] != struct.pack("<I", SECTION)[: len(head)]:
            raise self._wrong(
                f"begins with {head[:4].hex(' ')}, not with a section header: not a pcapng file"
            )
        if len(head) < 8:
            self.whole = not head and self.at > 0
            return None
        (kind,) = self._unpack("I", head)
        if kind == SECTION:
            magic = self._file.take(4)
            if len(magic) < 4:
                return None
            self._set_order(magic)
        else:
            magic = b""
        (length,) = self._unpack("I", head[4:])
        self._check_length(length, FRAME + len(magic))
        rest = length - len(head) - len(magic)
        data = magic + self._file.take(rest)
        if len(data) < rest + len(magic):
            if self._told is not None and self._follows(head + data) is not None:
                raise self._wrong(f"has length {length}, and the file ends before")
            return None
        (again,) = self._unpack("I", data[-4:])
        if again != length:
            raise self._wrong(f"begins with length {length} and ends with {again}")
        return kind, data[:-4]

    def _search(self) -> None:
        """Go to the block after a wrong one: over it if only its body is wrong, else to the next whole one.

        A place is taken for a block where its kind is known and both its lengths are the same. Only so many
        bytes are searched as a block can have.
        """
        self._file.go(self.at)
        taken = self._file.take(_CHUNK)
        if size := self._whole(taken, 0):
            self._file.go(self.at + size)
            return
        at = self._follows(taken)
        while at is None and len(taken) < MOST and (more := self._file.take(len(taken))):
            taken += more
            at = self._follows(taken)
        self._file.go(self.at + (len(taken) if at is None else at))

    def _follows(self, taken: bytes) -> int | None:
        """Return the offset of a whole block in bytes, after the first one; None without one."""
        places = (each.start() for each in _KINDS[self._order].finditer(taken, 1))
        return next((at for at in places if self._whole(taken, at)), None)

    def _whole(self, taken: bytes, at: int) -> int:
        """Return the length of a block of a known kind, 0 if there is none."""
        head = taken[at : at + 8]
        if len(head) < 8:
            return 0
        _, length = self._unpack("II", head)
        if not FRAME <= length <= MOST or length % 4:
            return 0
        end = taken[at + length - 4 : at + length]
        return length if len(end) == 4 and self._unpack("I", end) == (length,) else 0

    def _check_length(self, length: int, least: int) -> None:
        if length < least or length > MOST or length % 4:
            raise self._wrong(f"has length {length}; it is a multiple of 4 from {least} to {MOST}")

    def _set_order(self, magic: bytes) -> None:
        for order in ("<", ">"):
            if magic == struct.pack(f"{order}I", MAGIC):
                self._order = order
                return
        raise self._wrong(f"has byte order mark {magic.hex(' ')}; it is 1a 2b 3c 4d in either order")

    def _section(self, body: bytes) -> None:
        if len(body) < 16:
            raise self._short(body)
        major, _ = self._unpack("HH", body[4:8])
        if major != 1:
            raise self._wrong(f"has version {major}; only version 1 is known")
        self.interfaces, self._clocks = [], []

    def _interface(self, body: bytes) -> None:
        if len(body) < 8:
            raise self._short(body)
        (link_type,) = self._unpack("H", body)
        name, comments = "", []
        speed, resolution, offset = None, _Clock().resolution, 0
        for code, value in self._options(body[8:]):
            if code == COMMENT:
                comments.append(_text(value))
            elif code == NAME:
                name = _text(value)
            elif code == SPEED:
                (speed,) = self._unpack("Q", self._sized(value, 8))
            elif code == RESOLUTION:
                (power,) = self._sized(value, 1)
                resolution = 1 << (power & 0x7F) if power & 0x80 else 10**power
            elif code == OFFSET:
                (offset,) = self._unpack("q", self._sized(value, 8))
        self.interfaces.append(Interface(name, link_type, tuple(comments), speed))
        self._clocks.append(_Clock(resolution, offset))

    def _packet(self, body: bytes) -> Packet:
        if len(body) < 20:
            raise self._short(body)
        number, high, low, size, _ = self._unpack("IIIII", body)
        if number >= len(self.interfaces):
            error = self._wrong(f"names interface {number} of {len(self.interfaces)}, counted from 0")
            if self._told is None:
                raise error
            self._told(self.at, f"{error}; its packet is read as one of a port without name")
            port, clock = Interface("", USER0), _Clock()
        else:
            port, clock = self.interfaces[number], self._clocks[number]
        if size > len(body) - 20:
            raise self._wrong(f"states {size} bytes of data and has {len(body) - 20}")
        comments: list[str] = []
        direction: Direction | None = None
        for code, value in self._options(body[20 + size + -size % 4 :]):
            if code == COMMENT:
                comments.append(_text(value))
            elif code == FLAGS:
                (flags,) = self._unpack("I", self._sized(value, 4))
                direction = _WAYS.get(flags & 3)
        at = clock.nanoseconds(high << 32 | low)
        return Packet(at, body[20 : 20 + size], port, direction, tuple(comments))

    def _options(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """Return code and value of each option; their end may be missing."""
        while data:
            code, size = self._unpack("HH", data)
            if code == END:
                return
            if size > len(data) - 4:
                raise self._wrong(f"has an option of {size} bytes, and {len(data) - 4} are left")
            yield code, data[4 : 4 + size]
            data = data[4 + size + -size % 4 :]

    def _sized(self, value: bytes, size: int) -> bytes:
        if len(value) != size:
            raise self._wrong(f"has an option of {len(value)} bytes; this one has {size}")
        return value

    def _unpack(self, form: str, data: bytes) -> tuple[int, ...]:
        return struct.unpack_from(f"{self._order}{form}", data)

    def _short(self, body: bytes) -> CaptureError:
        return self._wrong(f"has {len(body)} bytes, less than its kind needs")

    def _wrong(self, text: str) -> CaptureError:
        return CaptureError(f"the block at offset {self.at} {text}")


def read_pcapng(path: str | os.PathLike[str]) -> Iterator[Packet]:
    """Return the packets of a file, those before a cut at its end if it has one.

    Raises:
        OSError: the file cannot be read.
        CaptureError: it is not a pcapng file, or a block is wrong.
    """
    with open(path, "rb") as file:  # noqa: PTH123
        yield from Reader(file)


def _text(value: bytes) -> str:
    return value.decode(errors="replace")
