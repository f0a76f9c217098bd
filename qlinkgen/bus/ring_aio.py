"""Nodes of a ring for asyncio; `qlinkgen.bus.ring` is derived from it."""

from __future__ import annotations

from collections.abc import Callable
from logging import Logger
from types import TracebackType
from typing import Self, Unpack

from qlinkgen.bus.making import open_line
from qlinkgen.bus.options import Parity, RingEngineOptions, RingOptions, StopBits
from qlinkgen.bus.ring_making import make_node, teller
from qlinkgen.bus.ring_status import TX_TIMEOUT, N, RingHandlers, RingStatus
from qlinkgen.errors import NothingCame
from qlinkgen.link.codec import Framed, Message
from qlinkgen.link.events import Frame
from qlinkgen.link.ring import RingCodec, RingNode
from qlinkgen.transport.opening import closing_on_error
from qlinkgen.transport.port import Port
from qlinkgen.transport.ring_aio import AsyncRingDriver, drive_async
from qlinkgen.transport.ring_driver import OnEvent


class AsyncRingClient(RingStatus[N]):
    """A node of a ring, for any number of tasks of one event loop."""

    driver: AsyncRingDriver

    def __init__(self, node: N, driver: AsyncRingDriver, *, tx_timeout: float = TX_TIMEOUT) -> None:
        """Use a node run by a driver."""
        super().__init__(node, tx_timeout=tx_timeout)
        self.driver = driver

    async def transmit(self, message: Message) -> None:
        """Send any message; its address counts the nodes along the ring, from 1.

        Returns when the message is in the transmit buffer. Delivery is not confirmed.

        Raises:
            NoRoom: the buffer stayed full.
            EncodeError: of the generated module: a field is out of range.
            PortLost: the port was lost.
        """
        if await self.driver.until(self._put(message), self.tx_timeout) is None:
            raise self._no_room()

    async def wait_until(self, condition: Callable[[], object], timeout: float | None = None) -> None:
        """Wait for a condition, checked after each event of the node.

        Raises:
            NothingCame: the condition was not met within `timeout` seconds.
        """
        if await self.driver.until(lambda _now: bool(condition()) or None, timeout) is None:
            raise NothingCame(f"condition not met within {timeout} s", elapsed=timeout or 0)

    async def flush(self, timeout: float | None = None) -> None:
        """Wait until the transmit buffer is empty.

        Raises:
            NothingCame: the buffer is not empty after `timeout` seconds.
        """
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


class AsyncRing(AsyncRingClient[RingNode]):
    """A node of a ring at a port, which forwards the messages to others.

    Each message is a method, which sends it. Messages to this node go to the handlers, or wait for `receive`.

    Attributes:
        codec: the generated module of the protocol.
    """

    codec: RingCodec

    def __init__(
        self,
        port: Port,
        handlers: RingHandlers | None = None,
        *,
        tx_timeout: float = TX_TIMEOUT,
        on_event: OnEvent | None = None,
        on_frame: Callable[[Frame], None] | None = None,
        logger: Logger | None = None,
        **options: Unpack[RingEngineOptions],
    ) -> None:
        """Join the ring at a port; closing the node closes it.

        Args:
            port: receives from the previous node, and transmits to the next one.
            handlers: what takes the messages to this node.
            tx_timeout: seconds that a message waits for room in the transmit buffer.
            on_event: called with each event of the engine (`qlinkgen.link.ring_events`).
            on_frame: called with each frame, sent, taken or forwarded, and with bytes that are none.
            logger: gets a record of each event.
            options: see `qlinkgen.bus.options`.
        """
        node, self._inbox = make_node(self.codec, port, handlers, options)
        told = teller(self.codec, on_event, on_frame, logger)
        node.verbose = told is not None
        super().__init__(node, drive_async(port, node, on_event=told), tx_timeout=tx_timeout)

    @classmethod
    def open(
        cls,
        name: str,
        handlers: RingHandlers | None = None,
        *,
        baud: int | None = None,
        parity: Parity = "none",
        stop_bits: StopBits = 1,
        **options: Unpack[RingOptions],
    ) -> Self:
        """Join the ring at a device name or a URL of pyserial; the arguments are those of `AsyncBus.open`.

        Raises:
            PortMissing: the port does not exist.
            PortBusy: another program uses it, or this user lacks the permission.
            ValueError: the schema states no speed, or an argument is out of range.
        """
        opened = open_line(cls.codec, name, baud=baud, parity=parity, stop_bits=stop_bits, reopen=False)
        with closing_on_error(opened) as port:
            return cls(port, handlers, **options)

    async def tell(self, message: Message) -> None:
        """Send a message, as `transmit` does; the typed methods call it."""
        await self.transmit(message)

    async def receive(self, timeout: float | None = None) -> Framed:
        """Return the oldest message to this node, which has no handlers; wait for one if there is none.

        Raises:
            NothingCame: no message in `timeout` seconds.
            PortLost: the port was lost.
        """
        message = await self.driver.until(self._inbox.take, timeout)
        if message is None:
            raise NothingCame(f"no message in {timeout} s", elapsed=timeout or 0)
        return message
