"""A half-duplex RS485 line as a model of discrete events: who hears what, and when.

Like the engines, the line has no clock and does no input or output: `now` comes in as an argument, in
seconds, and must not run backwards. One side of it is the outside: the program under test, on a virtual
clock (`virtual.py`) or behind a pty (`pty_bus.py`). The stations are engines in this process, each
attached as one of its own.

What one station sends in one go is a transmission. A `FaultPlan` may disturb each one; what is left of it
goes on the line byte behind byte and is heard by everybody but its sender.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from heapq import heappop, heappush
from typing import Final, Literal

from qlinkgen.sim.echo import Echo
from qlinkgen.sim.errors import SimulationError
from qlinkgen.sim.faults import Disturbed, FaultPlan
from qlinkgen.sim.traffic import Chunk, Engine, Route, Sender

__all__ = ["LINE", "OUTSIDE", "Chunks", "Engine", "Hears", "Tap", "Wire"]

OUTSIDE: Final = "outside"
"""Name of the outside as a source: the master, as a rule."""
LINE: Final = "line"
"""Name of the source of what no station sent: noise and stray frames."""

Chunks = Literal["frame", "byte", "random"]
Hears = Literal["all", "outside"]
Tap = Callable[[float, str, bytes], object]

# At the same instant bytes arrive first, then held transmissions begin, then the stations get their turn.
_ARRIVE, _BEGIN, _SUBMIT, _TURN = range(4)
# More events than this in one instant are stations that answer one another without end.
_MOST_AT_ONCE = 100_000
# Two senders disturb one another when they overlap by more than this part of a bit; a stop bit is silent.
_HARMLESS_BITS = 0.5


class Wire:
    """The line, its stations, and its ways to fail.

    Attributes:
        baud: speed of the line in bits a second, None where bytes take no time.
        byte_time: seconds one byte takes, 0.0 where bytes take no time.
        chunks: in what pieces a transmission arrives.
        faults: the plan of faults, if any.
        collisions: how many transmissions began while another one was on the line.
        taps: functions called with (seconds, source, bytes) for everything on the line as it arrives, damage
            included. The source is OUTSIDE, LINE, or the name of a station.
    """

    def __init__(
        self,
        *,
        baud: int | None,
        bits_per_byte: int = 10,
        faults: FaultPlan | None = None,
        echo: Echo | bool = False,
        collisions: bool = True,
        chunks: Chunks = "frame",
    ) -> None:
        """Make a line that nobody is on yet.

        Args:
            baud: bits a second, or None: what is sent arrives at once, and nothing can collide.
            bits_per_byte: start, data, parity and stop bits.
            faults: what goes wrong, None for nothing. A plan belongs to one line.
            echo: the outside also hears what it sends, as with most two-wire adapters.
            collisions: what two stations send at the same time is garbled; if not, both get through.
            chunks: a transmission arrives as a whole at its end ("frame"), byte by byte, or in pieces of
                random size; each piece arrives at the end of its last byte.

        Raises:
            SimulationError: an argument out of range.
        """
        if baud is not None and baud <= 0:
            raise SimulationError(f"baud is {baud}: it must be above 0; None makes bytes take no time")
        if bits_per_byte <= 0:
            raise SimulationError(f"bits_per_byte is {bits_per_byte}: it must be above 0, usually 10")
        if chunks not in {"frame", "byte", "random"}:
            raise SimulationError(f'chunks is {chunks!r}: it must be "frame", "byte" or "random"')
        self.baud = baud
        self.byte_time = bits_per_byte / baud if baud else 0.0
        self.chunks = chunks
        self.faults = faults
        self.collisions = 0
        self.taps: list[Tap] = []
        self._collide_at_all = collisions and baud is not None
        self._harmless = _HARMLESS_BITS / baud if baud else 0.0
        self._echo = (echo if isinstance(echo, Echo) else Echo()) if echo else None
        # Streams of their own, so that neither a collision nor a split changes which faults come after it.
        seed = faults.seed if faults else 0
        self._garble = random.Random(f"collisions {seed}")
        self._split = random.Random(f"chunks {seed}")
        self._outside = Sender(OUTSIDE)
        self._line = Sender(LINE)
        self._stations: list[Sender] = []
        self._attached = 0
        self._connect()
        self._echo_route = Route(self._outside, (), outside=True, on_line=False)
        self._queue: list[tuple[float, int, int, Sender | Chunk]] = []
        self._order = 0
        self._now = -math.inf
        self._sending: list[Chunk] = []
        self._line_free = -math.inf
        self._heard: list[bytes] = []

    # stations

    def attach(self, engine: Engine, name: str = "", *, hears: Hears = "all") -> str:
        """Put a station on the line and return its name.

        Args:
            engine: the station.
            name: as taps and error texts call it; "station 1" and so on when it is empty.
            hears: "all" that is on the line, as it is; or "outside", not what other stations send. With many
                stations most of the time goes into answers to others, so this is for long runs.

        Raises:
            SimulationError: the name is taken, or `hears` is something else.
        """
        if hears not in {"all", "outside"}:
            raise SimulationError(f'hears is {hears!r}: it must be "all" or "outside"')
        self._attached += 1
        name = name or f"station {self._attached}"
        if name in {OUTSIDE, LINE, *(station.name for station in self._stations)}:
            raise SimulationError(f"there is a station {name!r} already: give each one a name of its own")
        station = Sender(name, engine, hears_stations=hears == "all")
        self._stations.append(station)
        self._connect()
        self._watch(station)
        return name

    def detach(self, engine: Engine) -> None:
        """Take a station off the line; what it has already sent still arrives.

        Raises:
            SimulationError: it is not on this line.
        """
        station = self._station(engine)
        station.due = None
        self._stations.remove(station)
        self._connect()

    def wake(self, engine: Engine) -> None:
        """Ask a station for its timer again, after it was changed by something other than this line.

        Raises:
            SimulationError: it is not on this line.
        """
        self._watch(self._station(engine))

    def _station(self, engine: Engine) -> Sender:
        for station in self._stations:
            if station.engine is engine:
                return station
        raise SimulationError(f"{engine!r} is not on this line: attach it first")

    def _connect(self) -> None:
        # On a bus everybody hears everybody else. Another topology is another way to fill in these routes.
        everybody = tuple(self._stations)
        listeners = [station for station in everybody if station.hears_stations]
        for station in everybody:
            station.route.hearers = tuple(other for other in listeners if other is not station)
            station.route.outside = True
        self._outside.route.hearers = everybody
        self._line.route.hearers = everybody
        self._line.route.outside = True

    # the outside

    def transmit(self, data: bytes, now: float) -> None:
        """Let the outside send. While it still sends, this waits behind it like in a UART.

        Raises:
            SimulationError: `now` runs backwards.
        """
        self.advance(now)
        if data:
            self._send(self._outside, bytes(data), now)

    def take(self, now: float) -> bytes:
        """Return what the outside has heard by `now` and has not taken yet.

        Raises:
            SimulationError: `now` runs backwards.
        """
        self.advance(now)
        heard = self._heard
        if not heard:
            return b""
        self._heard = []
        return heard[0] if len(heard) == 1 else b"".join(heard)

    def take_piece(self, now: float) -> bytes:
        """Return what `take` would, but only up to the end of the first piece as `chunks` has cut it."""
        self.advance(now)
        return self._heard.pop(0) if self._heard else b""

    # time

    def next_timer(self) -> float | None:
        """Return when something happens next, None when nothing ever will unless the outside sends."""
        queue = self._queue
        while queue:
            at, _, _, item = queue[0]
            if isinstance(item, Chunk) or item.due == at:
                return at
            heappop(queue)
        return None

    def advance(self, now: float) -> None:
        """Let everything happen that is due by `now`, in the order of its time.

        Raises:
            SimulationError: `now` runs backwards, or stations answer one another without end.
        """
        if not self._now <= now < math.inf:
            raise SimulationError(
                f"now is {now}, but the line is at {self._now}: time moves on, and never ends"
            )
        queue = self._queue
        if queue and queue[0][0] <= now:
            self._run(now, until_heard=False)
        self._now = now

    def run(self, until: float) -> float | None:
        """Advance until the outside has heard something, but not beyond `until`, which may be infinite.

        Returns:
            The time when it heard something. None when it did not; the line is then at `until` if that
            is finite.

        Raises:
            SimulationError: stations answer one another without end.
        """
        if self._heard or self._run(until, until_heard=True):
            return self._now
        if self._now < until < math.inf:
            self._now = until
        return None

    def _run(self, until: float, *, until_heard: bool) -> bool:
        queue, at_once, last = self._queue, 0, self._now
        while queue and queue[0][0] <= until:
            at, kind, _, item = heappop(queue)
            if isinstance(item, Sender) and item.due != at:
                continue  # its timer has changed since
            # A station that names a time gone by means now.
            if at > last:
                last = self._now = at
                at_once = 0
            else:
                at_once += 1
                if at_once > _MOST_AT_ONCE:
                    self._give_up(item)
            if isinstance(item, Sender):
                self._turn(last, item)
            elif kind == _ARRIVE:
                self._arrive(last, item)
                if until_heard and self._heard:
                    return True
            elif kind == _BEGIN:
                self._begin(last, item)
            else:
                self._submit(last, item)
        return False

    def _give_up(self, item: Sender | Chunk) -> None:
        station = item if isinstance(item, Sender) else item.route.sender
        raise SimulationError(
            f"more than {_MOST_AT_ONCE} events at {self._now} s, the last at {station.name!r}: a timer must "
            "not stay due while nothing is sent, and who answers one another needs a baud or a turnaround"
        )

    # events

    def _push(self, at: float, kind: int, item: Sender | Chunk) -> None:
        self._order = order = self._order + 1
        heappush(self._queue, (at, kind, order, item))

    def _watch(self, station: Sender) -> None:
        due = station.next_timer()
        if due != station.due:
            station.due = due = None if due == math.inf else due
            if due is not None:
                self._push(due, _TURN, station)

    def _turn(self, now: float, station: Sender) -> None:
        data = station.bytes_to_send(now)
        station.due = None
        self._watch(station)
        if data:
            self._send(station, data, now)

    def _send(self, station: Sender, data: bytes, now: float) -> None:
        own = data if station is self._outside and self._echo is not None else None
        if self.faults is not None:
            disturbed = self.faults.disturb(data, now, station.name, to_master=station is not self._outside)
            if disturbed is not None:
                self._send_disturbed(station, own, now, disturbed)
                return
        self._submit(now, Chunk(station.route, data, own))

    def _send_disturbed(self, sender: Sender, own: bytes | None, now: float, what: Disturbed) -> None:
        extra = self._extra_route(sender)
        begin = max(now + what.wait, sender.free)
        for data in what.before:
            self._submit(begin, Chunk(extra, data))
            begin += len(data) * self.byte_time
        end = self._submit(begin, Chunk(sender.route, what.data, own, what.lead, what.tail))
        if what.again is not None:
            copy = Chunk(sender.route, what.data, own, what.lead, what.tail)
            self._push(end + what.again, _SUBMIT, copy)
        for gap, data in what.after:
            self._push(end + gap, _SUBMIT, Chunk(extra, data))

    def _extra_route(self, _sender: Sender) -> Route:
        """Who hears what is on the line by itself: here everybody, whoever was sending."""
        return self._line.route

    def _submit(self, at: float, chunk: Chunk) -> float:
        """Put a chunk behind what its sender has to send, like a UART; return when that is all sent."""
        sender = chunk.route.sender
        begin = max(at, sender.free)
        sender.free = end = begin + (chunk.lead + len(chunk.data) + chunk.tail) * self.byte_time
        if begin > self._now:
            self._push(begin, _BEGIN, chunk)
        else:
            self._begin(begin, chunk)
        return end

    def _begin(self, now: float, chunk: Chunk) -> None:
        if chunk.data:
            self._put(now + chunk.lead * self.byte_time, chunk)
        if chunk.own is not None and self._echo is not None:
            lead, heard = self._echo.hear(chunk.own)
            self._put(now + lead * self.byte_time, Chunk(self._echo_route, heard))

    def _put(self, begin: float, chunk: Chunk) -> None:
        chunk.begin = begin
        chunk.end = end = begin + len(chunk.data) * self.byte_time
        if self._collide_at_all:
            if begin < self._line_free - self._harmless:
                self._sending = [other for other in self._sending if other.end > begin]
                self._collide(chunk)
                self._sending.append(chunk)
            else:
                self._sending = [chunk]
            self._line_free = max(self._line_free, end)
        self._order = chunk.order = self._order + 1
        self._cut(chunk)

    def _collide(self, chunk: Chunk) -> None:
        begin, met = chunk.begin, False
        for other in self._sending:
            end = min(other.end, chunk.end)
            if end - begin <= self._harmless or other.route.sender is chunk.route.sender:
                continue
            # An echo shows the collision of what it is the echo of; it disturbs nobody itself.
            if chunk.route.on_line:
                other.mark(begin, end, self.byte_time, self._harmless)
            if other.route.on_line:
                chunk.mark(begin, end, self.byte_time, self._harmless)
                met = chunk.route.on_line
        self.collisions += met

    def _cut(self, chunk: Chunk) -> None:
        """Decide where the next piece of a chunk ends, and let it arrive then."""
        size = len(chunk.data)
        if self.chunks == "frame":
            stop = size
        elif self.chunks == "byte":
            stop = chunk.position + 1
        else:
            stop = self._split.randint(chunk.position + 1, size)
        chunk.stop = stop
        # The order stays that of the chunk: the pieces of two chunks of one instant must not mix.
        heappush(self._queue, (chunk.begin + stop * self.byte_time, _ARRIVE, chunk.order, chunk))

    def _arrive(self, now: float, chunk: Chunk) -> None:
        route = chunk.route
        piece = chunk.data[chunk.position : chunk.stop]
        if chunk.hits:
            piece = self._garbled(chunk, piece)
        if chunk.stop < len(chunk.data):
            chunk.position = chunk.stop
            self._cut(chunk)
        if route.outside:
            self._heard.append(piece)
        if self.taps and route.on_line:
            for tap in self.taps:
                tap(now, route.sender.name, piece)
        for station in route.hearers:
            station.receive(piece, now)
            due = station.next_timer()
            if due != station.due:
                self._watch(station)

    def _garbled(self, chunk: Chunk, piece: bytes) -> bytes:
        out, position = bytearray(piece), chunk.position
        for index in sorted(chunk.hits or ()):
            if position <= index < chunk.stop:
                out[index - position] ^= self._garble.randint(1, 255)
        return bytes(out)
