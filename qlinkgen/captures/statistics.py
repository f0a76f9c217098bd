"""Statistics of traffic in bounded memory: counts, response times, load over time."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from qlinkgen.captures.records import NANO

What = Literal["request", "response", "message", "fault", "unanswered", "stray"]


class Seen(NamedTuple):
    """Something that happened on a line."""

    what: What
    #: Command of a request or response, name of another message, kind of a fault.
    name: str
    node: int | None
    #: Nanoseconds, None in captures without times.
    at: int | None
    #: Bytes on the wire.
    size: int = 0
    #: Seconds from a request to its response.
    delay: float | None = None
    #: A response after its deadline.
    late: bool = False
    #: A request that was sent before and not answered.
    repeat: bool = False
    #: A response that refuses.
    refused: bool = False


class Histogram:
    """Counts of times, in steps of 2 %, from a microsecond to an hour.

    Attributes:
        count: number of times.
        least: shortest in seconds.
        most: longest in seconds.
    """

    _STEP = math.log(1.02)
    _FIRST = 1e-6

    def __init__(self) -> None:
        self.count = 0
        self.least, self.most = math.inf, 0.0
        self._total = 0.0
        self._counts = Counter[int]()

    def add(self, seconds: float) -> None:
        """Count a time."""
        self.count += 1
        self.least, self.most = min(self.least, seconds), max(self.most, seconds)
        self._total += seconds
        self._counts[self._place(seconds)] += 1

    def _place(self, seconds: float) -> int:
        return int(math.log(min(max(seconds, self._FIRST), 3600.0) / self._FIRST) / self._STEP)

    def mean(self) -> float:
        """Return the mean in seconds, 0 without any."""
        return self._total / self.count if self.count else 0.0

    def quantile(self, part: float) -> float:
        """Return the time that this part of all do not exceed, exact to 2 %; 0 without any."""
        due = math.ceil(part * self.count)
        for place, count in sorted(self._counts.items()):
            due -= count
            if due <= 0:
                upper = self._FIRST * math.exp((place + 1) * self._STEP)
                return min(max(upper, self.least), self.most)
        return self.most

    def bars(self, wide: int) -> Iterator[tuple[float, float, int]]:
        """Return from, to and count of at most so many bars, which are equal in the logarithm."""
        if not self.count:
            return
        first, last = min(self._counts), max(self._counts)
        per = max(1, math.ceil((last - first + 1) / wide))
        for begin in range(first, last + 1, per):
            count = sum(self._counts[each] for each in range(begin, begin + per))
            yield (
                self._FIRST * math.exp(begin * self._STEP),
                self._FIRST * math.exp((begin + per) * self._STEP),
                count,
            )


class Load:
    """Bytes over time, in at most 240 equal pieces whose length doubles as the capture gets longer.

    Attributes:
        piece: nanoseconds of each.
    """

    _MOST = 240

    def __init__(self) -> None:
        self.piece = NANO // 1000
        self._first: int | None = None
        self._bytes: list[int] = []

    def add(self, at: int, size: int) -> None:
        """Count bytes at a time; those before the first ones count as these."""
        if self._first is None:
            self._first = at
        while (place := max(0, at - self._first) // self.piece) >= self._MOST:
            self.piece *= 2
            pairs = range(0, len(self._bytes), 2)
            self._bytes = [sum(self._bytes[each : each + 2]) for each in pairs]
        self._bytes += [0] * (place + 1 - len(self._bytes))
        self._bytes[place] += size

    def bytes(self) -> list[int]:
        """Return the bytes of each piece."""
        return list(self._bytes)


@dataclass
class Row:
    """What a node did with a command, or a message outside commands."""

    requests: int = 0
    repeats: int = 0
    responses: int = 0
    late: int = 0
    unanswered: int = 0
    refused: int = 0
    strays: int = 0
    messages: int = 0
    times: Histogram = field(default_factory=Histogram)


class Statistics:
    """Counts what happens on a line.

    Attributes:
        rows: by node and command.
        faults: by kind.
        blamed: damaged answers, by the node that was asked.
        frames: without damaged ones.
        size: bytes in frames and damaged frames.
        first: nanoseconds of the first event with a time, None without any.
        last: of the last one.
        load: bytes over time.
    """

    def __init__(self) -> None:
        self.rows: dict[tuple[int | None, str], Row] = {}
        self.faults = Counter[str]()
        self.blamed = Counter[int | None]()
        self.frames = self.size = 0
        self.first: int | None = None
        self.last: int | None = None
        self.load = Load()

    @property
    def duration(self) -> float:
        """Seconds from the first event to the last one, 0 without times."""
        return 0.0 if self.first is None or self.last is None else (self.last - self.first) / NANO

    def take(self, seen: Seen) -> None:
        """Count an event."""
        self._at(seen)
        self.size += seen.size
        if seen.what == "fault":
            self.faults[seen.name] += 1
            self.blamed[seen.node] += 1
            return
        row = self.rows.setdefault((seen.node, seen.name), Row())
        self.frames += seen.what != "unanswered"
        match seen.what:
            case "request":
                row.requests += 1
                row.repeats += seen.repeat
            case "response":
                row.responses += 1
                row.late += seen.late
                row.refused += seen.refused
                if seen.delay is not None:
                    row.times.add(seen.delay)
            case "unanswered":
                row.unanswered += 1
            case "stray":
                row.strays += 1
            case "message":
                row.messages += 1

    def _at(self, seen: Seen) -> None:
        if seen.at is None:
            return
        if self.first is None:
            self.first = seen.at
        self.last = seen.at if self.last is None else max(self.last, seen.at)
        if seen.size:
            self.load.add(seen.at, seen.size)

    def utilisation(self, baud: int, bits_per_byte: int) -> float | None:
        """Return the part of the time in which bytes were on the line; None without times."""
        return self.size * bits_per_byte / baud / self.duration if self.duration else None
