"""What keeps a node of a ring at work: the interface that clients use, and what every driver does."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TypeVar

from qlinkgen.errors import PortError
from qlinkgen.link.ring import RingNode
from qlinkgen.link.ring_events import NetStat, RingEvent
from qlinkgen.transport.port import Port

T = TypeVar("T")
#: Seconds after which a thread that can not be woken looks what there is to do.
LOOK = 0.05
#: The same while own messages wait for a transmitter that takes its time.
LOOK_OFTEN = 0.002
#: Seconds that a program gives way when it asks again and again whether something has come.
GIVE_WAY = 0.001
#: Seconds that closing waits for what is still to be sent.
FLUSH = 1.0

OnEvent = Callable[[RingEvent], object]


class NodeIo:
    """What every driver does with an engine and a port, apart from waiting.

    Attributes:
        node: the engine.
        port: where it receives and transmits.
    """

    def __init__(self, port: Port, node: RingNode) -> None:
        self.node = node
        self.port = port

    def step(self, data: bytes) -> float:
        """Let the engine take bytes and send what is due; return the time."""
        now = self.port.now()
        if data:
            self.node.receive(data, now)
        self.flush(now)
        return now

    def flush(self, now: float) -> None:
        """Send what is due."""
        if data := self.node.bytes_to_send(now):
            try:
                self.port.write(data)
            except PortError:
                self.node.raise_status(NetStat.TX_BUFFER, now)
                raise

    def wait_at_most(self, now: float, limit: float) -> float:
        """Return for how long to wait for bytes."""
        timer = self.node.next_timer()
        return limit if timer is None else max(0.0, min(limit, timer - now))

    def report(self, on_event: OnEvent | None) -> None:
        """Tell what has happened; without anybody to tell the engine keeps the latest."""
        events = self.node.events
        while on_event is not None and events:
            on_event(events.popleft())


class RingDriver(ABC):
    """What a client needs of whatever keeps its node at work."""

    node: RingNode

    @abstractmethod
    def now(self) -> float:
        """Return the time on the node's clock."""

    @abstractmethod
    def act(self, function: Callable[[float], T]) -> T:
        """Do something with the node while nobody else does, then send what it wants to send."""

    @abstractmethod
    def until(self, attempt: Callable[[float], T | None], timeout: float | None) -> T | None:
        """Try something now and whenever the node has seen something, until it returns a value.

        Returns None when `timeout` seconds have passed without one; None waits for ever.
        """

    @abstractmethod
    def give_way(self) -> None:
        """Let the node work for a moment."""

    @abstractmethod
    def pause(self, seconds: float) -> None:
        """Let time pass."""

    @abstractmethod
    def close(self) -> None:
        """Stop. Closing twice does no harm."""
