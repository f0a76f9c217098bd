"""Nodes of the ring.

Derived from `aio.py` by `python -m tests.unasync`: change that one, and run it.
"""

from __future__ import annotations

from typing import Self, Unpack

from qlinkgen.bus.ring import RingClient
from qlinkgen.bus.ring_status import TX_TIMEOUT, paced_baud
from qlinkgen.codecs import trio
from qlinkgen.errors import NothingCame
from qlinkgen.link.ring import RingNode
from qlinkgen.protocols.trio.client import CoordinatorClient, Item
from qlinkgen.protocols.trio.coordinator_node import CoordinatorNode, mode_message, send_message
from qlinkgen.protocols.trio.facts import LINE_END, check_channel
from qlinkgen.protocols.trio.keypad_node import KeypadNode
from qlinkgen.protocols.trio.options import (
    ClientOptions,
    CoordinatorClientOptions,
    KeypadClientOptions,
    KeypadOptions,
    NodeOptions,
)
from qlinkgen.protocols.trio.printing import Number
from qlinkgen.transport.opening import closing_on_error, open_port
from qlinkgen.transport.port import Port
from qlinkgen.transport.ring import RingDriver, drive
from qlinkgen.transport.ring_driver import OnEvent


class MotionCoordinator(CoordinatorClient, RingClient[CoordinatorNode]):
    """A Motion Coordinator: the network commands of BASIC as methods.

    It receives and forwards independently of the program. Any number of tasks of one event loop may use it.
    Nodes are numbered as in BASIC: 10 is the next one along the ring, 24 the fifteenth; a number past the end
    of the ring wraps around.

    Attributes:
        node: the behaviour without input or output.
        driver: the driver of the node.
    """

    def __init__(
        self,
        port: Port,
        *,
        tx_timeout: float = TX_TIMEOUT,
        on_event: OnEvent | None = None,
        **options: Unpack[NodeOptions],
    ) -> None:
        """Join the ring at a port.

        Args:
            port: receives from the previous node, and transmits to the next one.
            tx_timeout: seconds that a message waits for room in the transmit buffer.
            on_event: called with each event of the engine (`qlinkgen.link.ring_events`).
            options: `cut_through`, `patience` and `room` of `RingNode`.
        """
        options.setdefault("baud", paced_baud(port))
        node = CoordinatorNode(**options)
        super().__init__(node, drive(port, node.link, on_event=on_event), tx_timeout=tx_timeout)

    @classmethod
    def open(cls, name: str, baud: int = 115200, **options: Unpack[CoordinatorClientOptions]) -> Self:
        """Join the ring at a device or URL. Raises the errors of `open_port`."""
        with closing_on_error(open_port(name, baud=baud)) as port:
            return cls(port, **options)

    @classmethod
    def driven(cls, node: CoordinatorNode, driver: RingDriver) -> Self:
        """Wrap a node driven elsewhere, e.g. by a simulated ring."""
        client = cls.__new__(cls)
        RingClient.__init__(client, node, driver)
        return client

    def print_(self, n: int, *items: Item, sep: str = "", end: str = LINE_END) -> None:
        """PRINT #n, item; item; ...

        Args:
            n: number of the receiver, 10-24.
            items: text, numbers (with four decimals), `VALUE(number, width, decimals)`, `CHR`, `CURSOR`.
            sep: separator of items.
            end: text after the items; `end=""` is BASIC's semicolon at the end of the line.

        Raises:
            ValueError: a node number or a character is out of range. Nothing was sent.
            NoRoom: the transmit buffer stayed full.
            PortLost: the port was lost.
        """
        for message in self._texts(n, items, sep, end):
            self.transmit(message)

    def get(self, channel: int, timeout: float | None = None) -> int:
        """GET #channel: remove and return the oldest character; wait for one if there is none.

        Args:
            channel: 3 for its value by the DEFKEY table, 4 for the number of the character.
            timeout: seconds to wait, None for ever.

        Raises:
            NothingCame: no character in that time.
            ValueError: the channel is not one of the network's.
            PortLost: the port was lost.
        """
        value = self.driver.until(self._take(channel), timeout)
        if value is None:
            raise NothingCame(f"GET #{channel}: no character in {timeout} s", elapsed=timeout or 0)
        return value

    def key(self, channel: int) -> bool:
        """KEY #channel: return whether there is a character, without removing it.

        A program may poll: without a character, this yields to the node for a millisecond.
        """
        check_channel(channel)
        if not self.node.received:
            self.driver.give_way()
        return bool(self.node.received)

    def send(self, n: int, type_: int, data1: int, data2: Number | None = None) -> None:
        """SEND(n, type, data1[, data2]).

        Args:
            n: number of the receiver, 10-24.
            type_: 1 to set its variable `data1` to `data2`, 2 to make a keypad send its keys to node `data1`.
            data1: number of the variable, or of the node as counted from the keypad, 10-24.
            data2: any number; it is rounded to a multiple of 2 to the power of -32. Type 2 does not use it.

        Raises:
            ValueError: an argument is out of range.
            TypeError: data2 is missing.
            NoRoom: the transmit buffer stayed full.
            PortLost: the port was lost.
        """
        self.transmit(send_message(n, type_, data1, data2))

    def keypad_mode(self, n: int, mode: trio.KeypadModeEnum | int) -> None:
        """Set the mode of a keypad; BASIC has no command for this message."""
        self.transmit(mode_message(n, mode))


class MembraneKeypad(RingClient[KeypadNode]):
    """A membrane keypad. It neither sends nor forwards before it receives its offset.

    Attributes:
        node: the behaviour without input or output.
        driver: the driver of the node.
    """

    def __init__(
        self, port: Port, *, on_event: OnEvent | None = None, **options: Unpack[KeypadOptions]
    ) -> None:
        """Join the ring at a port; the options are `rows`, `columns`, and those of `RingNode`."""
        options.setdefault("baud", paced_baud(port))
        node = KeypadNode(**options)
        super().__init__(node, drive(port, node.link, on_event=on_event))

    @classmethod
    def open(cls, name: str, baud: int = 115200, **options: Unpack[KeypadClientOptions]) -> Self:
        """Join the ring at a device or URL. Raises the errors of `open_port`."""
        with closing_on_error(open_port(name, baud=baud)) as port:
            return cls(port, **options)

    @classmethod
    def driven(cls, node: KeypadNode, driver: RingDriver) -> Self:
        """Wrap a node driven elsewhere, e.g. by a simulated ring."""
        client = cls.__new__(cls)
        RingClient.__init__(client, node, driver)
        return client

    def press(self, *keys: int | str) -> None:
        """Press and release keys, one after the other."""
        for key in keys:
            self.key_down(key)
            self.key_up(key)

    def key_down(self, key: int | str) -> bool:
        """Press a key and hold it; return whether its character was sent."""
        return self.driver.act(lambda now: self.node.press(key, now))

    def key_up(self, key: int | str) -> bool:
        """Release a key; return whether a character was sent, as in mode on_off."""
        return self.driver.act(lambda now: self.node.release(key, now))

    @property
    def lines(self) -> list[str]:
        """Rows of the display."""
        return self.node.display.lines

    def __str__(self) -> str:
        return self.node.display.text


class PassiveNode(RingClient[RingNode]):
    """A node that forwards every message and reports it; it may send messages too.

    Attributes:
        node: the engine, which reports each message (`Passed`, `Taken`).
        driver: the driver of the node.
    """

    def __init__(
        self, port: Port, *, on_event: OnEvent | None = None, **options: Unpack[NodeOptions]
    ) -> None:
        """Join the ring at a port; the options are those of `RingNode`."""
        options.setdefault("codec", trio)
        options.setdefault("baud", paced_baud(port))
        node = RingNode(**options)
        node.verbose = True
        super().__init__(node, drive(port, node, on_event=on_event))

    @classmethod
    def open(cls, name: str, baud: int = 115200, **options: Unpack[ClientOptions]) -> Self:
        """Join the ring at a device or URL. Raises the errors of `open_port`."""
        with closing_on_error(open_port(name, baud=baud)) as port:
            return cls(port, **options)
