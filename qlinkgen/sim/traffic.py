"""What moves on a line: who sends, who hears, and the bytes on their way. Internal to the simulation."""

from __future__ import annotations

import math
from typing import Protocol


class Engine(Protocol):
    """What a line needs of a station: a sans-IO engine of `qlinkgen.link`, or anything of that shape."""

    def receive(self, data: bytes, now: float, /) -> object:
        """Hear bytes whose last one arrived at `now`."""

    def bytes_to_send(self, now: float, /) -> bytes:
        """Return what goes on the line now, b"" while nothing is due."""

    def next_timer(self) -> float | None:
        """Return when `bytes_to_send` will have something, None while it will not."""


class Sender:
    """Who sends: a station, or without an engine the outside or the line itself."""

    __slots__ = (
        "bytes_to_send",
        "due",
        "engine",
        "free",
        "hears_stations",
        "name",
        "next_timer",
        "receive",
        "route",
    )

    def __init__(self, name: str, engine: Engine | None = None, *, hears_stations: bool = True) -> None:
        self.name = name
        self.engine = engine
        self.hears_stations = hears_stations
        self.due: float | None = None  # the timer of the engine that stands in the queue of events
        self.free = -math.inf  # when all that it has to send will have been sent
        self.route = Route(self, ())
        if engine is not None:  # bound once: these are called for every chunk
            self.receive = engine.receive
            self.bytes_to_send = engine.bytes_to_send
            self.next_timer = engine.next_timer


class Route:
    """Who hears what a sender sends: these stations, and the outside or not."""

    __slots__ = ("hearers", "on_line", "outside", "sender")

    def __init__(
        self, sender: Sender, hearers: tuple[Sender, ...], *, outside: bool = False, on_line: bool = True
    ) -> None:
        self.sender = sender
        self.hearers = hearers
        self.outside = outside
        self.on_line = on_line  # an echo is not: it comes from the adapter


class Chunk:
    """Bytes that are sent without a gap."""

    __slots__ = ("begin", "data", "end", "hits", "lead", "order", "own", "position", "route", "stop", "tail")

    def __init__(
        self, route: Route, data: bytes, own: bytes | None = None, lead: int = 0, tail: int = 0
    ) -> None:
        self.route = route
        self.data = data
        self.own = own  # what its sender hears of it, where there is an echo
        self.lead = lead  # byte times that pass before its first byte
        self.tail = tail  # and behind its last one, while the sender is still busy
        self.begin = self.end = 0.0
        self.order = 0
        self.position = self.stop = 0  # of the piece that arrives next
        self.hits: set[int] | None = None  # bytes that met another sender

    def mark(self, begin: float, end: float, byte_time: float, harmless: float) -> None:
        """Remember the bytes that another sender meets from `begin` to `end`."""
        first = int((begin - self.begin + harmless) / byte_time)
        last = math.ceil((end - self.begin - harmless) / byte_time)
        self.hits = (self.hits or set()) | set(range(first, last))
