"""The own place on a ring while a command runs: everything that comes is sent on."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from qlinkgen.link.codec import Message
from qlinkgen.link.ring import RingCodec, RingNode
from qlinkgen.link.ring_events import NetStat, RingEvent
from qlinkgen.protocols.trio.client import paced_baud
from qlinkgen.transport.port import Port
from qlinkgen.transport.ring import drive

#: Most seconds between two looks at whether to stop.
LOOK = 0.1
#: Most seconds that leaving waits until nothing is being sent on: longer than a whole message takes at any
#: usual speed, so that a ring which is never idle does not keep the command for ever.
LEAVING = 1.0


class RingPlace:
    """A passive node at a port, which may also send. Closing it leaves the ring open at this place.

    Attributes:
        node: the engine.
    """

    def __init__(self, port: Port, codec: RingCodec) -> None:
        """Begin to send on; `port` belongs to this from now on."""
        self.node = RingNode(codec, baud=paced_baud(port))
        self.node.verbose = True
        self._driver = drive(port, self.node)
        self.start = self._driver.now()

    def now(self) -> float:
        """Return the time on the port's clock."""
        return self._driver.now()

    def events(self, until: float) -> list[RingEvent]:
        """Return what has happened, and wait for it until a time, at most for `LOOK` seconds.

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
        """Put a message into the transmit buffer; False where it has no room."""
        return self._driver.act(lambda now: self.node.send(message, now))

    def leave(self) -> list[RingEvent]:
        """Wait until nothing is being sent on, or too long; return what happened meanwhile.

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
    """`NETSTAT 12 (rx_crc, rx_frame)`."""
    names = ", ".join(str(bit.name).lower() for bit in NetStat if bit & status)
    return f"NETSTAT {int(status)}{names and f' ({names})'}"
