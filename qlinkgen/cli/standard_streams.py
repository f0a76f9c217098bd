"""Makes the standard streams always available and able to encode any text."""

from __future__ import annotations

import io
import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class _Nothing(io.RawIOBase):
    """Discards everything written."""

    def writable(self) -> bool:
        return True

    def write(self, data: ReadableBuffer) -> int:
        return memoryview(data).nbytes


def prepare() -> None:
    """Replace closed streams, and escape characters that an encoding lacks.

    In a program started with a closed stream, the stream is None. It is replaced by /dev/null: a simulator
    started by a supervisor may have no output. Free descriptors 0 to 2 are occupied: otherwise the first file
    or port opened would get them, and receive what a library writes to standard output.
    """
    for descriptor in range(3):
        _occupy(descriptor)
    if sys.stdin is None:
        sys.stdin = io.TextIOWrapper(io.BytesIO())
    if sys.stdout is None:
        sys.stdout = nothing()
    if sys.stderr is None:
        sys.stderr = nothing()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def nothing() -> io.TextIOWrapper:
    """Return a stream that discards everything written."""
    return io.TextIOWrapper(io.BufferedWriter(_Nothing()), encoding="utf-8", errors="backslashreplace")


def _occupy(descriptor: int) -> None:
    try:
        os.fstat(descriptor)
    except OSError:
        got = os.open(os.devnull, os.O_RDWR)  # returns the lowest free descriptor
        if got != descriptor:
            os.close(got)
