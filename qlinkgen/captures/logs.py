"""Logs: lines of a time, a direction and bytes, and hex text without either."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from qlinkgen.captures.hexes import hex_bytes, leading_bytes, without_comment
from qlinkgen.captures.lines import Line, lines
from qlinkgen.captures.pcapng import Direction
from qlinkgen.captures.records import Problems, Record
from qlinkgen.captures.times import DAY, TIME, direction, nanoseconds, way_of
from qlinkgen.errors import CaptureError

#: Groups of `--line-regex`.
GROUPS = ("time", "direction", "hex", "text")

#: What may be between a heading and the bytes: their number. It has a word or brackets: frames may begin
#: with the number of bytes that follow as well.
_COUNT = re.compile(
    r"(?:[\[(]\s*(?:(?:len(?:gth)?|size|n)\s*[=:]?\s*)?(\d{1,5})\s*(?:bytes?|B)?\s*[\])]"
    r"|(?:len(?:gth)?|size|n)\s*[=:]?\s*(\d{1,5})(?:\s*bytes?\b)?"
    r"|(\d{1,5})\s*bytes?\b)\s*[:|,-]?\s*",
    re.IGNORECASE,
)
_BEGIN = re.compile(r"(?<![\w.])(?=[0-9a-fA-F\\$]|0x)", re.IGNORECASE)
#: What may follow the bytes: the characters that they are.
_SHOWN = re.compile(r"\s*$|\s{2}|\s*\t|\s*[]|;\"'<(\[]|\s*\.{2}")


class Entry(NamedTuple):
    """What a line of a log states."""

    data: bytes
    at: int | None
    direction: Direction | None


def entry(text: str) -> Entry | None:
    """Return what a line states; None if it has neither time nor direction, or no bytes."""
    text = text.strip()
    time = TIME.match(text)
    at = nanoseconds(time) if time else None
    rest = text[time.end() :] if time and at is not None else text
    for begin in _BEGIN.finditer(rest):
        heading = rest[: begin.start()]
        data = _data(rest[begin.start() :])
        if data is None:
            continue
        way = direction(heading)
        return Entry(data, at, way) if at is not None or way else None
    return None


def _data(text: str) -> bytes | None:
    """Return bytes that fill a text, after their number and before their characters, if there are any."""
    counted = _COUNT.match(text)
    if counted and counted.end() < len(text):
        data, end = leading_bytes(text[counted.end() :])
        if len(data) == int(counted[counted.lastindex or 1]) and _SHOWN.match(text, counted.end() + end):
            return data
    data, end = leading_bytes(text)
    return data if data and _SHOWN.match(text, end) else None


def is_entry(text: str) -> bool:
    """Whether a line is one of a log with a time or a direction."""
    return entry(text) is not None


def read_log(file: BinaryIO, problems: Problems) -> Iterator[Record]:
    """Return a record for each line with bytes; times of day that run backwards begin a new day."""
    clock = _Days()
    for line in lines(file, problems):
        if found := entry(without_comment(line.text) if line.text.lstrip().startswith("#") else line.text):
            yield Record(found.data, line.offset, clock.later(found.at), found.direction)
        elif line.text.strip() and not line.text.lstrip().startswith(("#", "//", ";")):
            problems.add(line.offset, f"no time or direction with bytes in '{_cut(line.text)}'; passed over")


class _Days:
    """Adds days to times of day that pass midnight."""

    def __init__(self) -> None:
        self._added = 0
        self._last = 0

    def later(self, at: int | None) -> int | None:
        if at is None or at >= DAY:
            return at
        if at + self._added < self._last - DAY // 2:
            self._added += DAY
        self._last = at + self._added
        return self._last


def is_hex(text: str) -> bool:
    """Whether a line is hex text, with or without a comment."""
    return hex_bytes(without_comment(text)) is not None


def read_hex(file: BinaryIO, problems: Problems) -> Iterator[Record]:
    """Return a record for each line with bytes; a line that is not hex text gives what precedes the fault."""
    for line in lines(file, problems):
        text = without_comment(line.text)
        data = hex_bytes(text)
        if data is None:
            data, end = leading_bytes(text.lstrip())
            what = _cut(text.lstrip()[end:].lstrip())
            problems.add(line.offset, f"'{what}' is not hex text; the rest of the line is passed over")
        if data:
            yield Record(data, line.offset)


class LineRegex:
    """Reads lines by an expression that the user gives.

    The named groups are `hex` or `text` (the characters themselves), `time` and `direction`.
    """

    def __init__(self, expression: str) -> None:
        """Compile it.

        Raises:
            CaptureError: it is not an expression, or its groups are wrong.
        """
        try:
            self._pattern = re.compile(expression)
        except re.error as error:
            raise CaptureError(f"{expression!r} is not a regular expression: {error}") from None
        unknown = sorted(set(self._pattern.groupindex) - set(GROUPS))
        if unknown:
            raise CaptureError(
                f"{expression!r} has a group {unknown[0]!r}; the groups are {', '.join(GROUPS)}"
            )
        if ("hex" in self._pattern.groupindex) == ("text" in self._pattern.groupindex):
            raise CaptureError(f"{expression!r} has not one group (?P<hex>...) or (?P<text>...)")

    def read(self, file: BinaryIO, problems: Problems) -> Iterator[Record]:
        """Return a record for each line that matches; others are passed over and counted."""
        clock = _Days()
        for line in lines(file, problems):
            found = self._pattern.search(line.text)
            if found is None:
                if line.text.strip():
                    problems.add(line.offset, f"'{_cut(line.text)}' does not match; passed over")
                continue
            if record := self._record(line, found.groupdict(), problems):
                yield record._replace(at=clock.later(record.at))

    @staticmethod
    def _record(line: Line, groups: dict[str, str | None], problems: Problems) -> Record | None:
        digits = groups.get("hex")
        data = (groups.get("text") or "").encode() if digits is None else hex_bytes(digits)
        if data is None:
            problems.add(line.offset, f"'{_cut(digits or '')}' is not hex text; passed over")
            return None
        time = groups.get("time")
        told = TIME.match(f"{time.strip()} ") if time else None
        at = nanoseconds(told) if told else None
        if time and at is None:
            problems.add(line.offset, f"'{_cut(time)}' is not a time; the bytes are read without one")
        way = groups.get("direction")
        return Record(data, line.offset, at, (way_of(way.strip()) or direction(f"{way}:")) if way else None)


def _cut(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:36]}..."
