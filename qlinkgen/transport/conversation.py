"""What every driver does with an engine and a port, apart from waiting."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator
from typing import Protocol

from qlinkgen.link.codec import Module
from qlinkgen.link.counters import LinkCounters
from qlinkgen.link.events import Event
from qlinkgen.link.timing import Timing
from qlinkgen.link.transaction import Question, Reply
from qlinkgen.transport.port import Ability, Port

#: Where a port cannot say how long it holds bytes back, the slowest of the common adapters is assumed: the
#: timer of FTDI's is 16 ms unless it is set.
ASSUMED_LATENCY = 0.016
#: A process that is not of real time may be woken so much later than it asked for.
WAKE_UP = 0.004
#: A pty or a socket leads to another program, which may have to wait for a processor before it answers.
OTHER_PROGRAM = 0.02
#: What has come since the last transaction is read away before the next; more of it is an endless stream,
#: which the deadlines deal with.
STALE_READS = 16


def host_slack(port: Port) -> float:
    """Return the seconds that a port and the operating system may add to a transaction."""
    latency = port.capabilities.latency
    woken = WAKE_UP + (OTHER_PROGRAM if port.capabilities.paced is Ability.NO else 0.0)
    return woken + (ASSUMED_LATENCY if latency is None else latency)


def timing_of(codec: Module, port: Port, *, slack: float | None = None, attempts: int = 3) -> Timing:
    """Make the timing of a protocol on a port; `slack` replaces what the port says of itself."""
    return Timing.of(
        codec,
        baud=port.baud,
        host_slack=host_slack(port) if slack is None else slack,
        paced=port.capabilities.paced is Ability.YES,
        attempts=attempts,
    )


class Asker(Protocol):
    """What a driver needs of an engine that asks: `MasterEngine` on a bus, `HostEngine` at a host port."""

    #: What happened, oldest first.
    events: deque[Event]
    #: Whether the events tell of every request and answer.
    verbose: bool

    @property
    def busy(self) -> bool:
        """A transaction is under way."""
        ...

    @property
    def total(self) -> LinkCounters:
        """Counts of what happened."""
        ...

    def start(self, request: Question, now: float, *, attempts: int | None, trial: bool) -> None:
        """Begin a transaction."""
        ...

    def bytes_to_send(self, now: float) -> bytes:
        """Return what is to be written now."""
        ...

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that came."""
        ...

    def next_timer(self) -> float | None:
        """Return when to call again, None where the transaction is over."""
        ...

    def handle_timer(self, now: float) -> None:
        """Do what is due."""
        ...

    def take(self) -> Reply:
        """Return the outcome, or raise it."""
        ...

    def abort(self, now: float) -> None:
        """Give the transaction up."""
        ...


class MasterDriver:
    """What the drivers have in common.

    Attributes:
        engine: deadlines, counters, health.
        port: where it asks.
    """

    def __init__(self, engine: Asker, port: Port, on_event: Callable[[Event], None] | None) -> None:
        self.engine = engine
        self.port = port
        self.on_event = on_event

    @property
    def on_event(self) -> Callable[[Event], None] | None:
        """Function that is called with each event, by the thread or task that asks; None: nobody is told."""
        return self._on_event

    @on_event.setter
    def on_event(self, function: Callable[[Event], None] | None) -> None:
        self._on_event = function
        self.engine.verbose = function is not None

    def _report(self) -> None:
        events = self.engine.events
        if self._on_event is None:
            events.clear()
        else:
            while events:
                self._on_event(events.popleft())

    def close(self) -> None:
        """Close the port."""
        self.port.close()


def conversation(
    engine: Asker, port: Port, request: Question, attempts: int | None, *, trial: bool
) -> Generator[float, bytes, Reply]:
    """One transaction: yields how long to wait for bytes, is sent those that came.

    Closed before its end it gives the transaction up; the next one then waits for a quiet line.
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
                port.write(frame)
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
