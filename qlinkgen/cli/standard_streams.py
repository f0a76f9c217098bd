"""Standard input and output as the commands need them: always there, and able to take any text."""

from __future__ import annotations

import io
import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class _Nothing(io.RawIOBase):
    """Takes everything, and keeps nothing."""

    def writable(self) -> bool:
        return True

    def write(self, data: ReadableBuffer) -> int:
        return memoryview(data).nbytes


def prepare() -> None:
    """Replace streams that are closed, and let no character fail that an encoding does not have.

    A program that was started with a closed stream has None in its place. It runs as with /dev/null: a
    simulator started by a supervisor may have no output at all. The free descriptors 0 to 2 are taken: the
    first file or port to be opened would get them, and with them what a library writes to standard output.
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
    """Return a stream that takes everything, and keeps nothing."""
    return io.TextIOWrapper(io.BufferedWriter(_Nothing()), encoding="utf-8", errors="backslashreplace")


def _occupy(descriptor: int) -> None:
    try:
        os.fstat(descriptor)
    except OSError:
        got = os.open(os.devnull, os.O_RDWR)  # the lowest that is free
        if got != descriptor:
            os.close(got)
