"""The node that a command forms on a ring while it runs; it forwards every message."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from qlinkgen.bus.ring_status import paced_baud
from qlinkgen.link.codec import Message
from qlinkgen.link.ring import RingCodec, RingNode
from qlinkgen.link.ring_events import NetStat, RingEvent
from qlinkgen.transport.port import Port
from qlinkgen.transport.ring import drive

#: Longest time between two checks of the stop signal, in seconds.
LOOK = 0.1
#: Longest time to wait for the end of forwarding when leaving, in seconds: longer than a message takes at any
#: usual speed; limited because a ring may never be idle.
LEAVING = 1.0


class RingPlace:
    """A passive node at a port, which may also send. Closing it leaves the ring open at this place.

    Attributes:
        node: the engine.
    """

    def __init__(self, port: Port, codec: RingCodec) -> None:
        """Begin forwarding, and take ownership of `port`."""
        self.node = RingNode(codec, baud=paced_baud(port))
        self.node.verbose = True
        self._driver = drive(port, self.node)
        self.start = self._driver.now()

    def now(self) -> float:
        """Return the time on the port's clock."""
        return self._driver.now()

    def events(self, until: float) -> list[RingEvent]:
        """Wait for events until a time, at most for `LOOK` seconds, and return them.

        Raises:
            PortLost: the port went away.
        """
        wait = max(0.0, min(LOOK, until - self.now()))
        return self._driver.until(lambda _now: self._taken() or None, wait) or []

    def _taken(self) -> list[RingEvent]:
        events = list(self.node.events)
        self.node.events.clear()
        return events

    def send(self, message: Message) -> bool:
        """Put a message into the transmit buffer; return False if it is full."""
        return self._driver.act(lambda now: self.node.send(message, now))

    def leave(self) -> list[RingEvent]:
        """Wait until no message is being forwarded, within a time limit; return the events meanwhile.

        Raises:
            PortLost: the port went away.
        """
        self._driver.until(lambda _now: self.node.idle or None, LEAVING)
        return self._driver.act(lambda _now: self._taken())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._driver.close()


def netstat_text(status: NetStat) -> str:
    """Return a status as `NETSTAT 12 (rx_crc, rx_frame)`."""
    names = ", ".join(str(bit.name).lower() for bit in NetStat if bit & status)
    return f"NETSTAT {int(status)}{names and f' ({names})'}"
