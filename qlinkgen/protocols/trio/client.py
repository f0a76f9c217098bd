"""Base classes of the clients of all nodes, and of those for blocking programs.

A program uses a node through a client, while a driver runs the node (`qlinkgen.transport.ring`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Generic, Protocol, Self, TypeVar

from qlinkgen.codecs import trio
from qlinkgen.link.ring import RingNode
from qlinkgen.link.ring_events import CommsError, NetStat, RingCounters
from qlinkgen.protocols.trio.coordinator_node import CoordinatorNode, text_message
from qlinkgen.protocols.trio.errors import NoRoom, NothingCame
from qlinkgen.protocols.trio.facts import check_channel
from qlinkgen.protocols.trio.keypad_node import KeypadNode
from qlinkgen.protocols.trio.printing import Formatted, Number, pieces, printed
from qlinkgen.protocols.trio.variables import Variables
from qlinkgen.transport.port import Ability, Port
from qlinkgen.transport.ring import RingDriver

Node = CoordinatorNode | KeypadNode | RingNode
N = TypeVar("N", bound=Node)
T = TypeVar("T")
#: Seconds that a message waits for room in the transmit buffer before NETSTAT bit 0 is set.
TX_TIMEOUT = 1.0
#: An item of PRINT.
Item = str | Number | Formatted


def engine_of(node: Node) -> RingNode:
    """Return the engine of a node; a passive node is an engine."""
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


class Client(Generic[N]):
    """Base class of clients with any driver.

    Attributes:
        node: the behaviour without input or output.
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
        """Errors since the status was cleared; `netstat = 0` clears it, as in BASIC."""
        return self.engine.netstat

    @netstat.setter
    def netstat(self, status: int) -> None:
        self.engine.netstat = NetStat(status)

    @property
    def commserror(self) -> CommsError:
        """The same errors in more detail, as in later manuals; `commserror = 0` clears it."""
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

    def _put(self, message: trio.Message) -> Callable[[float], bool | None]:
        """Return the action to try until there is room for a message."""
        return lambda now: self.engine.send(message, now) or None

    def _no_room(self) -> NoRoom:
        self.driver.act(self.engine.refuse)
        return NoRoom(
            f"the transmit buffer was full for {self.tx_timeout:g} s (NETSTAT bit 0): forwarded messages go "
            "first; find the node that keeps sending, or send less",
            elapsed=self.tx_timeout,
        )


class CoordinatorClient(Client[CoordinatorNode]):
    """Methods of a Motion Coordinator that do not wait."""

    @property
    def vr(self) -> Variables:
        """The variables VR(0) to VR(250); nodes of the ring may change them at any time."""
        return self.node.vr

    def defkey(self, key: int | str, *values: int) -> None:
        """Define the values of channel 3 for a key and the following ones: DEFKEY(key, value, value, ...).

        Args:
            key: the character that the keypad sends, or its number.
            values: for this key and the following ones; an undefined key returns its number.

        Raises:
            ValueError: the key is out of range.
        """
        self.node.keys.define(ord(key) if isinstance(key, str) else key, *values)

    def _take(self, channel: int) -> Callable[[float], int | None]:
        check_channel(channel)
        return lambda _now: self.node.take(channel)

    @staticmethod
    def _texts(n: int, items: tuple[Item, ...], sep: str, end: str) -> Iterator[trio.Message]:
        text_message(n, " ")  # refuses a wrong number before anything is sent
        return (text_message(n, piece) for piece in pieces(printed(items, sep, end)))


class BlockingClient(Client[N]):
    """Base class of clients for blocking programs."""

    driver: RingDriver

    def __init__(self, node: N, driver: RingDriver, *, tx_timeout: float = TX_TIMEOUT) -> None:
        """Use a node run by a driver."""
        super().__init__(node, tx_timeout=tx_timeout)
        self.driver = driver

    def transmit(self, message: trio.Message) -> None:
        """Send any message; its address counts the nodes along the ring, 1-15.

        Returns when the message is in the transmit buffer. Delivery is not confirmed.

        Raises:
            NoRoom: the buffer stayed full.
            EncodeError: of the generated module: a field is out of range.
            PortLost: the port was lost.
        """
        if self.driver.until(self._put(message), self.tx_timeout) is None:
            raise self._no_room()

    def wait_until(self, condition: Callable[[], object], timeout: float | None = None) -> None:
        """Wait for a condition, checked after each event of the node: WAIT UNTIL.

        Raises:
            NothingCame: the condition was not met within `timeout` seconds.
        """
        if self.driver.until(lambda _now: bool(condition()) or None, timeout) is None:
            raise NothingCame(f"condition not met within {timeout} s", elapsed=timeout or 0)

    def flush(self, timeout: float | None = None) -> None:
        """Wait until the transmit buffer is empty.

        Raises:
            NothingCame: the buffer is not empty after `timeout` seconds.
        """
        self.wait_until(lambda: self.engine.idle, timeout)

    def sleep(self, seconds: float) -> None:
        """Sleep; the node continues sending and receiving."""
        self.driver.pause(seconds)

    def close(self) -> None:
        """Send the transmit buffer, leave the ring, and close the port."""
        self.driver.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
