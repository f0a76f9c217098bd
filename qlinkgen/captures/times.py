"""Times and directions as logs of serial lines state them."""

from __future__ import annotations

import re
from datetime import UTC, datetime

from qlinkgen.captures.pcapng import Direction
from qlinkgen.captures.records import NANO

DAY = 86_400 * NANO

_FRACTION = r"(?:[.,:](?P<fraction>\d{1,9}))?"
#: A date and a time of day, a time of day, or seconds with a fraction; in brackets or not.
TIME = re.compile(
    rf"""[\[(<]?(?:
        (?:(?P<year>\d{{4}})[-/.](?P<month>\d\d)[-/.](?P<day>\d\d)[T ,_]\s*)?
        (?P<hour>\d\d):(?P<minute>\d\d):(?P<second>\d\d){_FRACTION}(?P<zone>Z|[+-]\d\d:?\d\d)?
        | \+?(?P<seconds>\d{{1,10}})[.,](?P<parts>\d{{1,9}})(?:\s?s(?:ec)?\b)?
        | \+?(?P<milliseconds>\d{{1,12}})\s?ms\b
    )[\])>]?(?=$|[\s:;,|-])""",
    re.VERBOSE,
)

_SENT = {"tx", "txd", "sent", "send", "sending", "write", "written", "wr", "out", "output", "req", "request"}
_SENT |= {"master", "host", "transmit", "transmitted", "->", "-->", "=>", "==>", ">>", ">>>", ">", "\u2192"}
_RECEIVED = {"rx", "rxd", "recv", "received", "receive", "receiving", "read", "rd", "in", "input", "resp"}
_RECEIVED |= {"response", "slave", "device", "reply", "answer", "<-", "<--", "<=", "<==", "<<", "<<<", "<"}
_RECEIVED |= {"\u2190"}
#: Single letters count only in brackets or before a colon.
_LETTERS: dict[str, Direction] = {"w": "sent", "s": "sent", "t": "sent", "r": "received"}

_MARK = re.compile(
    r"(?<![\w<>=-])(?:[A-Za-z]+|-{1,2}>|<-{1,2}|={1,2}>|<={1,2}|>{1,3}|<{1,3}|[\u2190\u2192])(?![\w<>=-])"
)


def nanoseconds(found: re.Match[str]) -> int | None:
    """Return the time of a match of `TIME`: since 1970 with a date, else since midnight or the start.

    A date without zone is taken as UTC. None if it is not a time, as 25:00:00.
    """
    if found["seconds"] is not None:
        return int(found["seconds"]) * NANO + _fraction(found["parts"])
    if found["milliseconds"] is not None:
        return int(found["milliseconds"]) * 10**6
    hour, minute, second = int(found["hour"]), int(found["minute"]), int(found["second"])
    if hour > 23 or minute > 59 or second > 60:
        return None
    of_day = (hour * 3600 + minute * 60 + second) * NANO + _fraction(found["fraction"])
    if found["year"] is None:
        return of_day
    try:
        date = datetime(int(found["year"]), int(found["month"]), int(found["day"]), tzinfo=UTC)
    except ValueError:
        return None
    return round(date.timestamp()) * NANO + of_day - _zone(found["zone"])


def _zone(text: str | None) -> int:
    if text is None or text == "Z":
        return 0
    minutes = int(text[1:3]) * 60 + int(text[-2:])
    return (minutes if text[0] == "+" else -minutes) * 60 * NANO


def _fraction(digits: str | None) -> int:
    return int((digits or "").ljust(9, "0"))


def direction(text: str) -> Direction | None:
    """Return the direction that a text states first, as ``TX``, ``[recv]``, ``>>`` or ``R:``."""
    for found in _MARK.finditer(text):
        if way := way_of(found[0]):
            return way
        after = text[found.end() : found.end() + 1]
        if after in (":", "]", ")") and (way := _LETTERS.get(found[0].lower())):
            return way
    return None


def way_of(word: str) -> Direction | None:
    """Return the direction that a word means, None for other words."""
    word = word.lower()
    if word in _SENT:
        return "sent"
    return "received" if word in _RECEIVED else None
