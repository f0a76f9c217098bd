"""The lines of a capture in text."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from qlinkgen.captures.records import Problems

#: Longest line in bytes; the rest of a longer one is a line of its own, so that memory is bounded.
LONGEST = 1 << 20


class Line(NamedTuple):
    """A line without its end; bytes that are not UTF-8 are U+FFFD."""

    #: Of its first byte in the file.
    offset: int
    text: str


def lines(file: BinaryIO, problems: Problems) -> Iterator[Line]:
    """Return the lines of a file in UTF-8; problems found meanwhile are in the line returned last."""
    offset = 0
    while line := file.readline(LONGEST):
        problems.line += 1
        text = line.removeprefix(codecs.BOM_UTF8) if offset == 0 else line
        yield Line(offset, text.decode(errors="replace").rstrip("\r\n"))
        offset += len(line)


def head_lines(head: bytes) -> list[str]:
    """Return the lines with which a file begins, without a last one that may be cut."""
    found = head.removeprefix(codecs.BOM_UTF8).decode(errors="replace").splitlines()
    return found if head.endswith((b"\n", b"\r")) else found[:-1] or found
