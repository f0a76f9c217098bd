"""Writes pcapng files."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterable
from types import TracebackType
from typing import Self

from qlinkgen.captures.pcapng import (
    COMMENT,
    DIRECTIONS,
    END,
    FLAGS,
    FRAME,
    INTERFACE,
    MAGIC,
    NAME,
    PACKET,
    PROGRAM,
    RESOLUTION,
    SECTION,
    SPEED,
    USER0,
    Direction,
)

#: Longest text of an option in bytes: its length has 16 bits.
_LONGEST = 0xFFFF
#: Exponent of a power of ten: times are nanoseconds.
_NANOSECONDS = bytes((9,))


class Writer:
    """Appends packets to a new file.

    Each block is given to the system as a whole, at once: a program that is killed leaves a file that can be
    read up to its last packet.
    """

    def __init__(self, path: str | os.PathLike[str], program: str) -> None:
        """Create or replace a file; `program` is what writes it.

        Raises:
            OSError: it cannot be written.
        """
        self._file = open(path, "wb", buffering=0)  # noqa: SIM115, PTH123  # closed by `close`
        self._interfaces = 0
        #: Without a length of the section, since more packets come.
        body = struct.pack("<IHHq", MAGIC, 1, 0, -1)
        self._block(SECTION, body, [(PROGRAM, _text(program))])

    def add_interface(self, name: str, comments: Iterable[str] = (), speed: int | None = None) -> int:
        """Describe a port, and return its number; `speed` is in bits per second.

        Raises:
            OSError: the file cannot be written.
        """
        options = [(COMMENT, _text(each)) for each in comments]
        options += [(NAME, _text(name)), (RESOLUTION, _NANOSECONDS)]
        if speed is not None:
            options.append((SPEED, struct.pack("<Q", speed)))
        self._block(INTERFACE, struct.pack("<HHI", USER0, 0, 0), options)
        self._interfaces += 1
        return self._interfaces - 1

    def write(
        self,
        interface: int,
        at: int,
        data: bytes,
        direction: Direction | None = None,
        comments: Iterable[str] = (),
    ) -> None:
        """Append a packet.

        Args:
            interface: number that `add_interface` has returned.
            at: nanoseconds since 1970-01-01 00:00 UTC.
            data: the bytes.
            direction: as seen from the interface.
            comments: texts.

        Raises:
            ValueError: the interface is unknown, or the time is before 1970.
            OSError: the file cannot be written.
        """
        if not 0 <= interface < self._interfaces:
            raise ValueError(f"no interface {interface}; add_interface returns the numbers")
        if not 0 <= at < 1 << 64:
            raise ValueError(f"time {at} is out of range; it is 0 or more nanoseconds since 1970")
        options = [(COMMENT, _text(each)) for each in comments]
        if direction is not None:
            options.append((FLAGS, struct.pack("<I", DIRECTIONS[direction])))
        size = len(data)
        head = struct.pack("<IIIII", interface, at >> 32, at & 0xFFFF_FFFF, size, size)
        self._block(PACKET, head + _padded(data), options)

    def _block(self, kind: int, body: bytes, options: Iterable[tuple[int, bytes]]) -> None:
        for code, value in options:
            body += struct.pack("<HH", code, len(value)) + _padded(value)
        body += struct.pack("<HH", END, 0)
        length = len(body) + FRAME
        rest = memoryview(struct.pack("<II", kind, length) + body + struct.pack("<I", length))
        while rest:  # less than all is written only where the disk is nearly full
            rest = rest[self._file.write(rest) :]

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def _text(text: str) -> bytes:
    """Return a text in UTF-8, cut to what an option holds."""
    return text.encode(errors="backslashreplace")[:_LONGEST].decode(errors="ignore").encode()
