"""A discrete-event model of a half-duplex RS485 line.

Like the engines, the line has no clock and does no input or output: `now` is an argument, in seconds, and
must not decrease. One participant is the outside: the program under test, on a virtual clock (`virtual.py`)
or on a pty (`pty_bus.py`). The stations are engines in this process, each attached separately.

The bytes that a station sends in one call are a transmission. A `FaultPlan` may disturb each one; the rest of
it is sent byte after byte and received by all participants except its sender.
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
"""Name of the source of noise and stray frames."""

Chunks = Literal["frame", "byte", "random"]
Hears = Literal["all", "outside"]
Tap = Callable[[float, str, bytes], object]

# Order of simultaneous events: bytes arrive, held transmissions begin, stations send.
_ARRIVE, _BEGIN, _SUBMIT, _TURN = range(4)
# Most simultaneous events; more are stations that answer one another endlessly.
_MOST_AT_ONCE = 100_000
# Two senders collide when they overlap by more than this part of a bit; a stop bit is silent.
_HARMLESS_BITS = 0.5


class Wire:
    """The line, its stations, and its faults.

    Attributes:
        baud: speed of the line in bits per second, None for an unpaced line.
        byte_time: duration of one byte in seconds, 0.0 on an unpaced line.
        chunks: chunks in which a transmission arrives.
        faults: the fault plan, if any.
        collisions: number of transmissions that began during another one.
        taps: functions called with (seconds, source, bytes) for all arriving bytes, including damage. The
            source is OUTSIDE, LINE, or the name of a station.
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
        """Make a line without stations.

        Args:
            baud: bits per second, or None: bytes arrive immediately, without collisions.
            bits_per_byte: start, data, parity and stop bits.
            faults: fault plan, None for none. A plan belongs to one line.
            echo: the outside receives its own bytes, as with most two-wire adapters.
            collisions: simultaneous transmissions are garbled; if not, both arrive.
            chunks: a transmission arrives as a whole at its end ("frame"), byte by byte, or in chunks of
                random size; each chunk arrives at the end of its last byte.

        Raises:
            SimulationError: an argument is out of range.
        """
        if baud is not None and baud <= 0:
            raise SimulationError(f"baud must be above 0, or None for an unpaced line, not {baud}")
        if bits_per_byte <= 0:
            raise SimulationError(f"bits_per_byte must be above 0, usually 10, not {bits_per_byte}")
        if chunks not in {"frame", "byte", "random"}:
            raise SimulationError(f"chunks must be 'frame', 'byte' or 'random', not {chunks!r}")
        self.baud = baud
        self.byte_time = bits_per_byte / baud if baud else 0.0
        self.chunks = chunks
        self.faults = faults
        self.collisions = 0
        self.taps: list[Tap] = []
        self._collide_at_all = collisions and baud is not None
        self._harmless = _HARMLESS_BITS / baud if baud else 0.0
        self._echo = (echo if isinstance(echo, Echo) else Echo()) if echo else None
        # Separate random streams, so that collisions and splits do not change later faults.
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
            name: name for taps and error texts; by default "station 1" and so on.
            hears: "all" traffic of the line, or only "outside", not other stations, which saves most of the
                time of long runs with many stations.

        Raises:
            SimulationError: the name is taken, or `hears` is something else.
        """
        if hears not in {"all", "outside"}:
            raise SimulationError(f"hears must be 'all' or 'outside', not {hears!r}")
        self._attached += 1
        name = name or f"station {self._attached}"
        if name in {OUTSIDE, LINE, *(station.name for station in self._stations)}:
            raise SimulationError(f"duplicate station {name!r}; names must be unique")
        station = Sender(name, engine, hears_stations=hears == "all")
        self._stations.append(station)
        self._connect()
        self._watch(station)
        return name

    def detach(self, engine: Engine) -> None:
        """Remove a station from the line; its sent bytes still arrive.

        Raises:
            SimulationError: it is not on this line.
        """
        station = self._station(engine)
        station.due = None
        self._stations.remove(station)
        self._connect()

    def wake(self, engine: Engine) -> None:
        """Read the timer of a station again, after a change from outside the line.

        Raises:
            SimulationError: it is not on this line.
        """
        self._watch(self._station(engine))

    def _station(self, engine: Engine) -> Sender:
        for station in self._stations:
            if station.engine is engine:
                return station
        raise SimulationError(f"{engine!r} is not on this line; attach it first")

    def _connect(self) -> None:
        # On a bus all stations hear all others. Other topologies fill in these routes differently.
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
        """Let the outside send. Bytes are queued after earlier ones, like in a UART.

        Raises:
            SimulationError: `now` runs backwards.
        """
        self.advance(now)
        if data:
            self._send(self._outside, bytes(data), now)

    def take(self, now: float) -> bytes:
        """Return bytes received by the outside until `now` and not taken yet.

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
        """Return the same as `take`, but only the first chunk."""
        self.advance(now)
        return self._heard.pop(0) if self._heard else b""

    # time

    def next_timer(self) -> float | None:
        """Return the time of the next event, None if there is none."""
        queue = self._queue
        while queue:
            at, _, _, item = queue[0]
            if isinstance(item, Chunk) or item.due == at:
                return at
            heappop(queue)
        return None

    def advance(self, now: float) -> None:
        """Process all events until `now`, in order of time.

        Raises:
            SimulationError: `now` decreases, or stations answer one another endlessly.
        """
        if not self._now <= now < math.inf:
            raise SimulationError(
                f"now must be finite and not before {self._now}, the time of the line, not {now}"
            )
        queue = self._queue
        if queue and queue[0][0] <= now:
            self._run(now, until_heard=False)
        self._now = now

    def run(self, until: float) -> float | None:
        """Advance until the outside has received bytes, at most to `until`, which may be infinite.

        Returns:
            The time of reception. None if no bytes were received; the line is then at `until` if that is
            finite.

        Raises:
            SimulationError: stations answer one another endlessly.
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
            # A past timer of a station means now.
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
            "not stay due without sending; stations that answer one another need a baud or a turnaround"
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
        """Return the receivers of noise and strays: here all participants."""
        return self._line.route

    def _submit(self, at: float, chunk: Chunk) -> float:
        """Queue a chunk after earlier ones of its sender, like a UART; return the end of transmission."""
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
            # An echo shows the collision of its transmission; it does not collide itself.
            if chunk.route.on_line:
                other.mark(begin, end, self.byte_time, self._harmless)
            if other.route.on_line:
                chunk.mark(begin, end, self.byte_time, self._harmless)
                met = chunk.route.on_line
        self.collisions += met

    def _cut(self, chunk: Chunk) -> None:
        """Determine the end of the next piece of a chunk, and schedule its arrival."""
        size = len(chunk.data)
        if self.chunks == "frame":
            stop = size
        elif self.chunks == "byte":
            stop = chunk.position + 1
        else:
            stop = self._split.randint(chunk.position + 1, size)
        chunk.stop = stop
        # Keep the order of chunks: pieces of simultaneous chunks must not be mixed.
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
