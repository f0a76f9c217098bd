"""Senders, routes and bytes in transit on a line. Internal to the simulation."""

from __future__ import annotations

import math
from typing import Protocol


class Engine(Protocol):
    """The interface of stations: a sans-IO engine of `qlinkgen.link`, or a similar object."""

    def receive(self, data: bytes, now: float, /) -> object:
        """Process bytes, the last of which arrived at `now`."""

    def bytes_to_send(self, now: float, /) -> bytes:
        """Return the bytes to send now, b"" if none are due."""

    def next_timer(self) -> float | None:
        """Return the time of the next call of `bytes_to_send`, None if none is needed."""


class Sender:
    """A sender: a station, or without an engine the outside or the line itself."""

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
        self.due: float | None = None  # the queued timer of the engine
        self.free = -math.inf  # end of its queued transmissions
        self.route = Route(self, ())
        if engine is not None:  # bound once: these are called for every chunk
            self.receive = engine.receive
            self.bytes_to_send = engine.bytes_to_send
            self.next_timer = engine.next_timer


class Route:
    """Receivers of a sender's transmissions: stations, and the outside or not."""

    __slots__ = ("hearers", "on_line", "outside", "sender")

    def __init__(
        self, sender: Sender, hearers: tuple[Sender, ...], *, outside: bool = False, on_line: bool = True
    ) -> None:
        self.sender = sender
        self.hearers = hearers
        self.outside = outside
        self.on_line = on_line  # not so for an echo, which the adapter makes


class Chunk:
    """Bytes sent without a gap."""

    __slots__ = ("begin", "data", "end", "hits", "lead", "order", "own", "position", "route", "stop", "tail")

    def __init__(
        self, route: Route, data: bytes, own: bytes | None = None, lead: int = 0, tail: int = 0
    ) -> None:
        self.route = route
        self.data = data
        self.own = own  # its echo for the sender, if any
        self.lead = lead  # byte times before its first byte
        self.tail = tail  # and after its last one, while the sender is still busy
        self.begin = self.end = 0.0
        self.order = 0
        self.position = self.stop = 0  # bounds of the next piece to arrive
        self.hits: set[int] | None = None  # indices of collided bytes

    def mark(self, begin: float, end: float, byte_time: float, harmless: float) -> None:
        """Record the bytes that collide with another sender from `begin` to `end`."""
        first = int((begin - self.begin + harmless) / byte_time)
        last = math.ceil((end - self.begin - harmless) / byte_time)
        self.hits = (self.hits or set()) | set(range(first, last))
