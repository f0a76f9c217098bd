"""Nodes of the ring for asyncio: waiting methods are coroutines, otherwise as in `nodes`."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Self, Unpack

from qlinkgen.codecs import trio
from qlinkgen.protocols.trio.client import TX_TIMEOUT, Client, CoordinatorClient, Item, N, paced_baud
from qlinkgen.protocols.trio.coordinator_node import CoordinatorNode, mode_message, send_message
from qlinkgen.protocols.trio.errors import NothingCame
from qlinkgen.protocols.trio.facts import LINE_END, check_channel
from qlinkgen.protocols.trio.keypad_node import KeypadNode
from qlinkgen.protocols.trio.options import KeypadOptions, NodeOptions
from qlinkgen.protocols.trio.printing import Number
from qlinkgen.transport.port import Port
from qlinkgen.transport.ring import OnEvent
from qlinkgen.transport.ring_aio import AsyncRingDriver, drive_async


class AsyncClient(Client[N]):
    """Base class of asyncio clients; create and use them in a running event loop."""

    driver: AsyncRingDriver

    def __init__(self, node: N, driver: AsyncRingDriver, *, tx_timeout: float = TX_TIMEOUT) -> None:
        """Use a node run by a driver."""
        super().__init__(node, tx_timeout=tx_timeout)
        self.driver = driver

    async def transmit(self, message: trio.Message) -> None:
        """Send any message; see `BlockingClient.transmit`."""
        if await self.driver.until(self._put(message), self.tx_timeout) is None:
            raise self._no_room()

    async def wait_until(self, condition: Callable[[], object], timeout: float | None = None) -> None:
        """Wait for a condition; see `BlockingClient.wait_until`."""
        if await self.driver.until(lambda _now: bool(condition()) or None, timeout) is None:
            raise NothingCame(f"condition not met within {timeout} s", elapsed=timeout or 0)

    async def flush(self, timeout: float | None = None) -> None:
        """Wait until the transmit buffer is empty."""
        await self.wait_until(lambda: self.engine.idle, timeout)

    async def sleep(self, seconds: float) -> None:
        """Sleep on the node's clock; the node continues sending and receiving."""
        await self.driver.pause(seconds)

    async def close(self) -> None:
        """Send the transmit buffer, leave the ring, and close the port."""
        await self.driver.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()


class AsyncMotionCoordinator(CoordinatorClient, AsyncClient[CoordinatorNode]):
    """A Motion Coordinator for asyncio. The event loop runs the node; see `MotionCoordinator`."""

    def __init__(
        self,
        port: Port,
        *,
        tx_timeout: float = TX_TIMEOUT,
        on_event: OnEvent | None = None,
        **options: Unpack[NodeOptions],
    ) -> None:
        """Join the ring at a port, in a running event loop; see `MotionCoordinator`."""
        options.setdefault("baud", paced_baud(port))
        node = CoordinatorNode(**options)
        super().__init__(node, drive_async(port, node.link, on_event=on_event), tx_timeout=tx_timeout)

    @classmethod
    def driven(cls, node: CoordinatorNode, driver: AsyncRingDriver) -> Self:
        """Wrap a node driven elsewhere, e.g. by a simulated ring."""
        client = cls.__new__(cls)
        AsyncClient.__init__(client, node, driver)
        return client

    async def print_(self, n: int, *items: Item, sep: str = "", end: str = LINE_END) -> None:
        """PRINT #n, item; item; ...; see `MotionCoordinator.print_`."""
        for message in self._texts(n, items, sep, end):
            await self.transmit(message)

    async def get(self, channel: int, timeout: float | None = None) -> int:
        """GET #channel; see `MotionCoordinator.get`."""
        value = await self.driver.until(self._take(channel), timeout)
        if value is None:
            raise NothingCame(f"GET #{channel}: no character in {timeout} s", elapsed=timeout or 0)
        return value

    async def key(self, channel: int) -> bool:
        """KEY #channel; see `MotionCoordinator.key`. Without a character it yields to other tasks."""
        check_channel(channel)
        if not self.node.received:
            await self.driver.give_way()
        return bool(self.node.received)

    async def send(self, n: int, type_: int, data1: int, data2: Number | None = None) -> None:
        """SEND(n, type, data1[, data2]); see `MotionCoordinator.send`."""
        await self.transmit(send_message(n, type_, data1, data2))

    async def keypad_mode(self, n: int, mode: trio.KeypadModeEnum | int) -> None:
        """Set the mode of a keypad; BASIC has no command for this message."""
        await self.transmit(mode_message(n, mode))


class AsyncMembraneKeypad(AsyncClient[KeypadNode]):
    """A membrane keypad for asyncio; see `MembraneKeypad`. Pressing a key does not wait."""

    def __init__(
        self, port: Port, *, on_event: OnEvent | None = None, **options: Unpack[KeypadOptions]
    ) -> None:
        """Join the ring at a port, in a running event loop; see `MembraneKeypad`."""
        options.setdefault("baud", paced_baud(port))
        node = KeypadNode(**options)
        super().__init__(node, drive_async(port, node.link, on_event=on_event))

    @classmethod
    def driven(cls, node: KeypadNode, driver: AsyncRingDriver) -> Self:
        """Wrap a node driven elsewhere, e.g. by a simulated ring."""
        client = cls.__new__(cls)
        AsyncClient.__init__(client, node, driver)
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
