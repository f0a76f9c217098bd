"""Drivers of a ring node: the interface that clients use, and the common implementation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TypeVar

from qlinkgen.errors import PortError
from qlinkgen.link.ring import RingNode
from qlinkgen.link.ring_events import CommsError, NetStat, RingEvent
from qlinkgen.transport.port import Port

T = TypeVar("T")
#: Polling interval in seconds of a thread that cannot be woken.
LOOK = 0.05
#: The same while own messages wait for a paced transmitter.
LOOK_OFTEN = 0.002
#: Seconds that a polling program yields to the node.
GIVE_WAY = 0.001
#: Longest time in seconds to send buffered bytes on closing.
FLUSH = 1.0

OnEvent = Callable[[RingEvent], object]


class NodeIo:
    """Common implementation of the drivers around an engine and a port, except for waiting.

    Attributes:
        node: the engine.
        port: the port of the node.
    """

    def __init__(self, port: Port, node: RingNode) -> None:
        self.node = node
        self.port = port

    def step(self, data: bytes) -> float:
        """Pass bytes to the engine and send its output; return the time."""
        now = self.port.now()
        if data:
            self.node.receive(data, now)
        self.flush(now)
        return now

    def flush(self, now: float) -> None:
        """Send the output of the engine."""
        passed = self.node.counters.passed_bytes
        if data := self.node.bytes_to_send(now):
            try:
                self.port.write(data)
            except PortError:
                if self.node.counters.passed_bytes != passed:
                    self.node.commserror |= CommsError.RETRANSMIT_BUFFER
                self.node.raise_status(NetStat.TX_BUFFER, now)
                raise

    def wait_at_most(self, now: float, limit: float) -> float:
        """Return the timeout of the next read."""
        timer = self.node.next_timer()
        return limit if timer is None else max(0.0, min(limit, timer - now))

    def report(self, on_event: OnEvent | None) -> None:
        """Report events; without a callback the engine keeps the latest ones."""
        events = self.node.events
        while on_event is not None and events:
            on_event(events.popleft())


class RingDriver(ABC):
    """The interface that clients use."""

    node: RingNode

    @abstractmethod
    def now(self) -> float:
        """Return the time on the node's clock."""

    @abstractmethod
    def act(self, function: Callable[[float], T]) -> T:
        """Call an action with exclusive access to the node, then send the output of the node."""

    @abstractmethod
    def until(self, attempt: Callable[[float], T | None], timeout: float | None) -> T | None:
        """Try something now and after each event of the node, until it returns a value.

        Returns None after `timeout` seconds; a timeout of None waits for ever.
        """

    @abstractmethod
    def give_way(self) -> None:
        """Yield to the node for a moment."""

    @abstractmethod
    def pause(self, seconds: float) -> None:
        """Sleep on the clock of the node."""

    @abstractmethod
    def close(self) -> None:
        """Stop the driver. Closing twice is allowed."""
