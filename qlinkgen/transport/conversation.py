"""The loop of every driver around an engine and a port, except for waiting."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator
from typing import Protocol

from qlinkgen.link.codec import Module
from qlinkgen.link.counters import LinkCounters
from qlinkgen.link.events import Event
from qlinkgen.link.streams import Stream
from qlinkgen.link.timing import Timing
from qlinkgen.link.transaction import Question, Reply
from qlinkgen.transport.port import Ability, Port

#: Latency in seconds of a port that does not report it: that of the slowest common adapter, FTDI's default
#: timer of 16 ms.
ASSUMED_LATENCY = 0.016
#: Wake-up delay of a process without real-time priority.
WAKE_UP = 0.004
#: Wake-up delay of the program at the other end of a pty or a socket.
OTHER_PROGRAM = 0.02
#: Most reads that discard bytes received since the last transaction; the deadlines handle an endless stream.
STALE_READS = 16
#: Longest read of a driver that awaits the answers of a stream; others may ask between two of them.
PIECE = 0.005


def host_slack(port: Port) -> float:
    """Return the seconds that a port and the operating system may add to a transaction."""
    latency = port.capabilities.latency
    woken = WAKE_UP + (OTHER_PROGRAM if port.capabilities.paced is Ability.NO else 0.0)
    return woken + (ASSUMED_LATENCY if latency is None else latency)


def timing_of(codec: Module, port: Port, *, slack: float | None = None, attempts: int = 3) -> Timing:
    """Make the timing of a protocol on a port; `slack` replaces the value derived from the port."""
    return Timing.of(
        codec,
        baud=port.baud,
        host_slack=host_slack(port) if slack is None else slack,
        paced=port.capabilities.paced is Ability.YES,
        attempts=attempts,
    )


class Asker(Protocol):
    """The interface of engines that send requests: `MasterEngine` on a bus, `HostEngine` at a host port."""

    #: Events, oldest first.
    events: deque[Event]
    #: Whether every request and answer is an event.
    verbose: bool

    @property
    def busy(self) -> bool:
        """A transaction is in progress."""
        ...

    @property
    def total(self) -> LinkCounters:
        """Counts of requests, answers and faults."""
        ...

    def start(self, request: Question, now: float, *, attempts: int | None, trial: bool) -> None:
        """Begin a transaction."""
        ...

    def bytes_to_send(self, now: float) -> bytes:
        """Return the bytes to write now."""
        ...

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes."""
        ...

    def next_timer(self) -> float | None:
        """Return the time of the next call, None after the transaction."""
        ...

    def handle_timer(self, now: float) -> None:
        """Process expired timers."""
        ...

    def take(self) -> Reply:
        """Return the reply, or raise the error."""
        ...

    def abort(self, now: float) -> None:
        """Abort the transaction."""
        ...


class MasterDriver:
    """Base class of the drivers.

    Attributes:
        engine: deadlines, counters, health.
        port: the port of the bus.
    """

    def __init__(self, engine: Asker, port: Port, on_event: Callable[[Event], None] | None) -> None:
        self.engine = engine
        self.port = port
        self.on_event = on_event

    @property
    def on_event(self) -> Callable[[Event], None] | None:
        """Function called with each event, in the calling thread or task; None to discard events."""
        return self._on_event

    @on_event.setter
    def on_event(self, function: Callable[[Event], None] | None) -> None:
        self._on_event = function
        self.engine.verbose = self._tells

    @property
    def _tells(self) -> bool:
        """Whether somebody is told of every event."""
        return self._on_event is not None

    def _report(self) -> None:
        events = self.engine.events
        if self._on_event is None:
            events.clear()
        else:
            while events:
                self._on_event(events.popleft())

    def _heard(self, stream: Stream, data: bytes) -> None:
        """Process what was received for a stream, or that nothing was."""
        now = self.port.now()
        if data:
            self.engine.receive(data, now)
        if now >= stream.next_timer():
            self.engine.handle_timer(now)

    def _wait_for(self, stream: Stream) -> float:
        """Return the timeout of a read for a stream."""
        return min(PIECE, max(0.0, stream.next_timer() - self.port.now()))

    def close(self) -> None:
        """Close the port."""
        self.port.close()


def stream_of(reply: Reply) -> Stream | None:
    """Return the stream that a transaction has begun; None if it was a request without a response."""
    if reply.response is not None and type(reply.response) is not Stream:
        raise TypeError("the answers of the request have an end; use transact")
    return reply.response


def conversation(
    engine: Asker, port: Port, request: Question, attempts: int | None, *, trial: bool
) -> Generator[float, bytes, Reply]:
    """Perform one transaction: yields the timeout of a read, takes the bytes read.

    Closing it early aborts the transaction; the next one then waits for a quiet line.
    """
    now = port.now()
    for _ in range(STALE_READS):
        if not (stale := port.read(0)):
            break
        engine.receive(stale, now)
    engine.start(request, now, attempts=attempts, trial=trial)
    try:
        while True:
            if frame := engine.bytes_to_send(now):
                port.transmit(frame, getattr(engine, "break_time", 0.0))  # of buses
            timer = engine.next_timer()
            if timer is None:
                return engine.take()
            data = yield max(0.0, timer - now)
            now = port.now()
            if data:
                engine.receive(data, now)
            if now >= timer:
                engine.handle_timer(now)
    finally:
        if engine.busy:
            engine.abort(port.now())
