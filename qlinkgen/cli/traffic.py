"""Decodes the records of a capture: which bytes belong together, and where and when each frame began.

A frame whose capture states its direction is decoded in that direction. Captures of two ports, each of which
has one direction, are told apart as well; which of them has the requests is seen from the frames.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple, TypeAlias, cast

from qlinkgen.captures.pcapng import Direction as Way
from qlinkgen.captures.records import NANO, Record
from qlinkgen.cli.codec import MessageObject
from qlinkgen.cli.streams import Bad, Event, OneWay, Stream, Telling, open_untold
from qlinkgen.link.gaps import silence_of
from qlinkgen.model.message import Direction
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan.framing import frame_plan

if TYPE_CHECKING:
    from qlinkgen.link.codec import Module

#: Bytes in which a frame is searched, more than it has.
_BYTES = 1 << 17


class Source(NamedTuple):
    """Where bytes come from, as the capture states it."""

    port: str
    way: Way | None


#: The direction of the frames of each source; those of others are not known.
Sides = Mapping[Source, Direction]


class Place(NamedTuple):
    """Where a frame is."""

    #: Of its first byte in a raw capture, else of the packet or line with it.
    offset: int
    #: Nanoseconds, None if the capture has no time.
    at: int | None
    #: Bytes of the frame on the wire.
    size: int = 0


Placed: TypeAlias = tuple[Event, Place]


def source_of(record: Record) -> Source:
    """Return where the bytes of a record come from."""
    return Source(record.port, record.direction)


#: Bits per second, where neither the schema nor the user states it.
_USUAL = 9600

#: Returns the bytes of a message on the wire.
Wire: TypeAlias = Callable[[MessageObject], bytes]


def framed(message: MessageObject) -> bytes:
    """Return the frame of a message."""
    return message.to_frame()


class Lane:
    """A stream of bytes of which each event has a place."""

    def __init__(
        self,
        stream: Stream,
        *,
        exact: bool,
        wire: Wire = framed,
        hear: Callable[[Direction | None], None] | None = None,
    ) -> None:
        """Take the events of a stream.

        Args:
            stream: decodes the bytes.
            exact: the offset of a record is that of its bytes, not of a packet or a line.
            wire: gives the bytes of a message.
            hear: is told the direction of the bytes that follow.
        """
        self.hear = hear
        self._stream = stream
        self._wire = wire
        self._exact = exact
        #: Where the records that have bytes of `_kept` begin in the stream, and in the file.
        self._starts: deque[int] = deque()
        self._places: deque[Place] = deque()
        self._size = 0
        self._kept = b""  # in which the next frame begins
        self._first = 0  # offset of these
        self._next = 0  # offset at which it begins at the earliest
        self._end = 0  # of the last frame

    def feed(self, record: Record) -> Iterator[Placed]:
        """Take the bytes of a record."""
        self._kept = self._kept[max(0, self._next - self._first) :][-_BYTES:]
        self._first = self._size - len(self._kept)
        while len(self._starts) > 1 and self._starts[1] <= self._first:
            self._starts.popleft()
            self._places.popleft()
        self._starts.append(self._size)
        self._places.append(Place(record.offset, record.at))
        self._kept += record.data
        self._size += len(record.data)
        return self._placed(self._stream.feed(record.data))

    def finish(self) -> Iterator[Placed]:
        """The end of the stream, or a silence that ends a frame."""
        return self._placed(self._stream.finish())

    def _placed(self, events: Iterable[Event]) -> Iterator[Placed]:
        for event in events:
            if isinstance(event, Bad):
                start, size = event.offset, len(event.raw)
                self._next = max(self._next, start + 1)  # a frame may begin in it
            else:
                wire = self._wire(event)
                start, size = self._found(wire), len(wire)
                self._next = start + size
            self._end = max(self._end, start + size)
            yield event, self._place(start)._replace(size=size)

    def _found(self, wire: bytes) -> int:
        """Return the offset of a frame: after the last one, if it has other bytes than it is encoded to."""
        at = self._kept.find(wire, max(0, self._next - self._first))
        return self._end if at < 0 else self._first + at

    def _place(self, start: int) -> Place:
        if not self._starts:
            return Place(start, None)
        index = max(0, bisect_right(self._starts, start) - 1)
        place = self._places[index]
        return place._replace(offset=place.offset + start - self._starts[index]) if self._exact else place


class Traffic:
    """Decodes a capture."""

    def __init__(
        self,
        protocol: Protocol,
        codec: ModuleType,
        sides: Sides,
        *,
        exact: bool,
        alone: Lane | None = None,
        baud: int | None = None,
    ) -> None:
        """Decode frames of known or unknown directions.

        Args:
            protocol: what they belong to.
            codec: its generated module.
            sides: the direction of the frames of each source.
            exact: see `Lane`.
            alone: decodes all bytes, wherever they come from.
            baud: bits per second of the line, those of the schema by default.
        """
        self._protocol, self._codec, self._sides = protocol, codec, sides
        self._exact = exact
        self._alone = alone
        self._telling = Telling(codec) if protocol.carrier is not None and alone is None else None
        self._lanes: dict[tuple[str, Direction | None], Lane] = {}
        byte = protocol.bus.bits_per_byte / (baud or protocol.bus.baud or _USUAL)
        self._silent = frame_plan(protocol.frame).silent
        #: Nanoseconds between the beginnings of two bytes with a silence between them.
        self._apart: int = round((byte + silence_of(cast("Module", codec), byte)) * NANO)

    def decode(self, records: Iterable[Record]) -> Iterator[Placed]:
        """Return the messages and faults of a capture."""
        last: Record | None = None
        for record in records:
            if self._silent and last is not None and not self._follows(last, record):
                yield from self.finish()
            yield from self._told(self._lane(record).feed(record))
            last = record
        yield from self.finish()

    def _follows(self, last: Record, record: Record) -> bool:
        """Whether bytes follow others without a silence: single ones that are near in time."""
        if last.at is None or record.at is None or len(last.data) > 1:
            return False
        return record.at - last.at < self._apart

    def finish(self) -> Iterator[Placed]:
        """The end, or a silence that ends a frame."""
        for lane in self._every():
            yield from self._told(lane.finish())

    def _every(self) -> Sequence[Lane]:
        return [self._alone] if self._alone else [*self._lanes.values()]

    def _lane(self, record: Record) -> Lane:
        way = self._sides.get(source_of(record))
        if self._alone is not None:
            if self._alone.hear is not None:
                self._alone.hear(way)
            return self._alone
        key = ("" if way else record.port, way)
        lane = self._lanes.get(key)
        if lane is None:
            stream = OneWay(self._codec, way) if way else open_untold(self._protocol, self._codec, None)
            lane = self._lanes[key] = Lane(stream, exact=self._exact)
        return lane

    def _told(self, events: Iterator[Placed]) -> Iterator[Placed]:
        telling = self._telling
        return events if telling is None else ((telling.told(event), place) for event, place in events)


def sides_of(sources: Sequence[Source], protocol: Protocol) -> list[Sides]:
    """Return the directions that the frames of these sources can have, the likeliest first.

    What a program sent is a request if it is the master, and a response if it simulates a slave.
    """
    found: list[Sides] = []
    if protocol.directions != ("message",):
        ways = {each.way for each in sources}
        if ways == {"sent", "received"}:
            first = {each: _way(each.way == "sent") for each in sources}
        elif len(sources) == 2:
            first = {each: _way(each is sources[0]) for each in sources}
        else:
            first = {}
        if first:
            found = [first, {each: _way(way == "response") for each, way in first.items()}]
    return [*found, {}]


def _way(asks: bool) -> Direction:
    return "request" if asks else "response"
