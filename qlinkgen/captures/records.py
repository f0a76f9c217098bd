"""What every reader of captures returns: records in the order of the file, and what could not be read."""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

from qlinkgen.captures.pcapng import Direction

Format = Literal["raw", "hex", "dump", "log", "saleae", "sigrok", "samples", "pcap", "pcapng"]
FORMATS: tuple[Format, ...] = get_args(Format)

#: Nanoseconds per second.
NANO = 10**9

#: Problems that are kept; further ones are only counted.
KEPT = 20


class Record(NamedTuple):
    """Bytes of a capture that were seen together: a packet, a line of text, or a piece of a raw file."""

    data: bytes
    #: Offset of the packet, the line or the first byte in the file after decompression, from 0.
    offset: int
    #: Nanoseconds since 1970-01-01 00:00 UTC, or since another moment where the capture has no date.
    at: int | None = None
    #: As seen from the program that recorded; None if it is not stated.
    direction: Direction | None = None
    #: Name of the port, channel or analyser; empty if it is not stated.
    port: str = ""


class Problem(NamedTuple):
    """A place of a capture that could not be read."""

    #: As the offset of a record.
    offset: int
    #: What was seen, and what is read instead.
    text: str
    #: Line of a file of text, from 1; 0 in other files.
    line: int = 0


class Problems:
    """Collects problems in bounded memory.

    Attributes:
        kept: the first of them.
        count: how many there were.
        line: that which is read, 0 in binary files.
    """

    def __init__(self) -> None:
        self.line = 0
        self.kept: list[Problem] = []
        self.count = 0

    def add(self, offset: int, text: str) -> None:
        """Note a place that cannot be read."""
        self.count += 1
        if len(self.kept) < KEPT:
            self.kept.append(Problem(offset, text, self.line))
