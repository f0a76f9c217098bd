"""Reads files of other formats: regular ones, of a bounded size."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

from qlinkgen.errors import ImportFileError
from qlinkgen.importers.notes import Notes

#: Greatest size of an input in bytes; the largest public dialect of MAVLink has 0.4 MiB.
MOST = 4 << 20


class Unreadable(ImportFileError):
    """A file that cannot be read."""


def content(path: Path | str) -> bytes:
    """The bytes of a file. Raises Unreadable."""
    name = os.fspath(path)
    try:
        return _regular(name)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise Unreadable(f"cannot read it: {reason}; check the path", file=name) from None


def _regular(name: str) -> bytes:
    # Opening a FIFO otherwise waits for a writer.
    descriptor = os.open(name, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(descriptor, "rb") as file:
        mode = os.fstat(descriptor).st_mode
        if not stat.S_ISREG(mode):
            raise OSError(errno.EINVAL, "it is not a file", name)
        data = file.read(MOST + 1)
    if len(data) > MOST:
        raise ImportFileError(f"more than {MOST} bytes; is this the right file?", file=name)
    return data


def text_of(data: bytes, notes: Notes) -> str:
    """Text in UTF-8, or in UTF-16 with a mark; other bytes are read as Windows-1252, with a note.

    Line ends become line feeds.

    Raises:
        ImportFileError: it is not a text.
    """
    for mark, encoding in ((b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
        if data.startswith(mark):
            return _lines(_decoded(data, encoding, notes))
    if (at := data.find(0)) >= 0:
        raise notes.error(data.count(b"\n", 0, at) + 1, "a byte 00: this is not a text file")
    try:
        return _lines(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        notes.add(line, f"byte {data[error.start]:02X} is not UTF-8; the file is read as Windows-1252")
        return _lines(data.decode("cp1252", "replace"))


def _decoded(data: bytes, encoding: str, notes: Notes) -> str:
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise notes.error(0, f"byte {error.start} is not UTF-16, which the file begins with") from None


def _lines(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")
