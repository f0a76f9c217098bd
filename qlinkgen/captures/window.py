"""A file that is read once, in which one can go back a little to search damaged places."""

from __future__ import annotations

from typing import BinaryIO

#: Bytes that are read at once.
_CHUNK = 1 << 16


class Window:
    """Reads a file from its start.

    Attributes:
        at: offset of the next byte.
    """

    def __init__(self, file: BinaryIO) -> None:
        """Read a binary file; it need not be seekable."""
        self.at = 0
        self._file = file
        self._kept = bytearray()
        self._first = 0  # offset of what is kept

    def keep(self) -> None:
        """Allow to go back to this place, and no longer to those before it."""
        if self.at - self._first >= _CHUNK:
            del self._kept[: self.at - self._first]
            self._first = self.at

    def go(self, at: int) -> None:
        """Go to a place since the last one that is kept, and not after the bytes that were taken."""
        self.at = at

    def take(self, size: int) -> bytes:
        """Return this many bytes, fewer at the end of the file."""
        begin = self.at - self._first
        while len(self._kept) < begin + size and (more := self._file.read(_CHUNK)):
            self._kept += more
        data = bytes(self._kept[begin : begin + size])
        self.at += len(data)
        return data
