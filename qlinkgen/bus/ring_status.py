"""What clients of a ring node have in common, whether they block or not: its status, and what they send."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, Protocol, TypeVar

from qlinkgen.errors import NoRoom
from qlinkgen.link.codec import Message
from qlinkgen.link.ring import RingNode
from qlinkgen.link.ring_events import CommsError, NetStat, RingCounters
from qlinkgen.transport.port import Ability, Port

T = TypeVar("T")
#: Seconds that a message waits for room in the transmit buffer before NETSTAT bit 0 is set.
TX_TIMEOUT = 1.0


class Behaviour(Protocol):
    """A node with a behaviour of its own around its engine."""

    link: RingNode


N = TypeVar("N", bound="RingNode | Behaviour")


def engine_of(node: RingNode | Behaviour) -> RingNode:
    """Return the engine of a node; a node without a behaviour is an engine."""
    return node if isinstance(node, RingNode) else node.link


def paced_baud(port: Port) -> int | None:
    """Return the speed of a paced port, else None, for the `baud` of an engine."""
    return port.baud if port.capabilities.paced is Ability.YES else None


class Driver(Protocol):
    """The interface of drivers that all clients use."""

    def act(self, action: Callable[[float], T]) -> T:
        """Call an action on the node with the current time."""
        ...

    def now(self) -> float:
        """Return the time on the node's clock."""
        ...


class RingHandlers(Protocol):
    """What takes the messages to a node: `RingHandlers` of a generated bus module, a method for each."""

    def handle(self, message: Any, now: float) -> object:  # Any: a message of its own module
        """Take a message."""
        ...


class RingStatus(Generic[N]):
    """Status and counters of a node.

    Attributes:
        node: the behaviour without input or output, or the engine alone.
        driver: the driver of the node.
        tx_timeout: seconds that a message waits for room in the transmit buffer.
    """

    driver: Driver

    def __init__(self, node: N, *, tx_timeout: float = TX_TIMEOUT) -> None:
        self.node = node
        self.tx_timeout = tx_timeout

    @property
    def engine(self) -> RingNode:
        """The node's engine."""
        return engine_of(self.node)

    @property
    def counters(self) -> RingCounters:
        """Counts of messages and faults."""
        return self.engine.counters

    @property
    def netstat(self) -> NetStat:
        """Errors since the status was cleared; `netstat = 0` clears it."""
        return self.engine.netstat

    @netstat.setter
    def netstat(self, status: int) -> None:
        self.engine.netstat = NetStat(status)

    @property
    def commserror(self) -> CommsError:
        """The same errors in more detail; `commserror = 0` clears it."""
        return self.engine.commserror

    @commserror.setter
    def commserror(self, status: int) -> None:
        self.engine.commserror = CommsError(status)

    def clear_netstat(self) -> NetStat:
        """Clear the status, and return the old one, atomically."""

        def clear(_now: float) -> NetStat:
            status, self.engine.netstat = self.engine.netstat, NetStat(0)
            return status

        return self.driver.act(clear)

    def now(self) -> float:
        """Return the time on the node's clock, in seconds."""
        return self.driver.now()

    def _put(self, message: Message) -> Callable[[float], bool | None]:
        """Return the action to try until there is room for a message."""
        return lambda now: self.engine.send(message, now) or None

    def _no_room(self) -> NoRoom:
        self.driver.act(self.engine.refuse)
        return NoRoom(
            f"the transmit buffer was full for {self.tx_timeout:g} s (NETSTAT bit 0): forwarded messages go "
            "first; find the node that keeps sending, or send less",
            elapsed=self.tx_timeout,
        )
