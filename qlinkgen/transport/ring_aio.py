"""Drivers of a ring node in an event loop.

On a port with a descriptor the loop calls the node whenever bytes arrive or a timer expires, without a task,
so the node forwards while all tasks of the program wait. A port without a descriptor is read by a task, in a
thread. A port with its own clock is read while a task waits for the node.
"""

from __future__ import annotations

import asyncio
import contextlib
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TypeVar

from qlinkgen.link.ring import RingNode
from qlinkgen.transport import aio
from qlinkgen.transport.port import Port, closed_here
from qlinkgen.transport.ring_driver import FLUSH, GIVE_WAY, LOOK, LOOK_OFTEN, NodeIo, OnEvent

T = TypeVar("T")


class AsyncRingDriver(ABC):
    """The interface that asyncio clients use; see `RingDriver`."""

    node: RingNode

    @abstractmethod
    def now(self) -> float:
        """Return the time on the node's clock."""

    @abstractmethod
    def act(self, function: Callable[[float], T]) -> T:
        """Call an action on the node, then send the bytes of the node."""

    @abstractmethod
    async def until(self, attempt: Callable[[float], T | None], timeout: float | None) -> T | None:
        """Try something now and after each event of the node; return None after the timeout."""

    @abstractmethod
    async def give_way(self) -> None:
        """Yield to the node and other tasks for a moment."""

    @abstractmethod
    async def pause(self, seconds: float) -> None:
        """Let time pass."""

    @abstractmethod
    async def close(self) -> None:
        """Stop the driver. Closing twice is allowed."""


class AsyncNode(AsyncRingDriver):
    """Runs a node in the running event loop.

    Attributes:
        node: the engine.
        port: the port of the node, owned by this driver.
        on_event: called with each event of the engine, in the loop's thread.
    """

    def __init__(self, port: Port, node: RingNode, *, on_event: OnEvent | None = None) -> None:
        """Start receiving and forwarding.

        Raises:
            RuntimeError: no event loop is running.
        """
        self.node = node
        self.port = port
        self.on_event = on_event
        self._loop = asyncio.get_running_loop()
        self._io = NodeIo(port, node)
        self._waiting: dict[asyncio.Future[None], None] = {}  # in order of waiting
        self._failure: BaseException | None = None
        self._closed = False
        self._timer: asyncio.TimerHandle | None = None
        self._task: asyncio.Task[None] | None = None
        descriptor, self._end_watch = aio.watch(port, self._come, self._closed_elsewhere)
        self._watches = descriptor is not None
        if self._watches:
            self._after(port.now())
        else:
            self._task = self._loop.create_task(self._pump())

    def now(self) -> float:
        """Return the time on the port's clock."""
        return self.port.now()

    # the node's own work

    def _come(self) -> None:
        try:
            self._step(self.port.read(0))
        except OSError as failure:
            self._fail(failure)

    def _step(self, data: bytes) -> None:
        now = self._io.step(data)
        self._after(now)
        self._io.report(self.on_event)

    def _after(self, now: float) -> None:
        """Set the timer, and wake waiting tasks."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        due = self.node.next_timer()
        if due is not None and self._watches:
            self._timer = self._loop.call_later(max(0.0, due - now), self._due)
        self._wake()

    def _due(self) -> None:
        self._timer = None
        try:
            self._step(b"")
        except OSError as failure:
            self._fail(failure)

    async def _pump(self) -> None:
        try:
            while not self._closed:
                limit = LOOK if self.node.idle else LOOK_OFTEN
                wait = self._io.wait_at_most(self.port.now(), limit)
                self._step(await aio.read(self.port, wait))
        except OSError as failure:
            self._fail(failure)

    def _fail(self, failure: BaseException) -> None:
        self._failure = failure
        self._let_go()
        self._wake()

    def _let_go(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._watches = False
        self._end_watch()

    def _closed_elsewhere(self) -> None:
        """Fail: the port was closed, and not by `close`."""
        self._fail(closed_here(self.port.name))

    def _wake(self) -> None:
        for each in self._waiting:
            if not each.done():
                each.set_result(None)
        self._waiting.clear()

    # the program's tasks

    def act(self, function: Callable[[float], T]) -> T:
        """See `RingDriver.act`.

        Raises:
            PortLost: the port was lost.
        """
        self._check()
        now = self.port.now()
        result = function(now)
        self._io.flush(now)
        self._after(now)
        return result

    async def until(self, attempt: Callable[[float], T | None], timeout: float | None) -> T | None:
        """See `RingDriver.until`.

        Raises:
            PortLost: the port was lost.
        """
        deadline = None if timeout is None else self.port.now() + timeout
        while True:
            self._check()
            now = self.port.now()
            value = attempt(now)
            if value is not None:
                self._io.flush(now)
                self._after(now)
                return value
            if deadline is not None and now >= deadline:
                return None
            await self._change(None if deadline is None else deadline - now)

    async def _change(self, seconds: float | None) -> None:
        """Return after an event of the node, or after some time."""
        changed: asyncio.Future[None] = self._loop.create_future()
        self._waiting[changed] = None
        try:
            await asyncio.wait_for(changed, seconds)
        except TimeoutError:
            pass
        finally:
            self._waiting.pop(changed, None)

    async def give_way(self) -> None:
        """See `RingDriver.give_way`."""
        await self._change(GIVE_WAY)

    async def pause(self, seconds: float) -> None:
        """Sleep while the node and other tasks run."""
        await asyncio.sleep(seconds)

    def _check(self) -> None:
        if self._failure is not None:
            raise self._failure
        if self._closed:
            raise closed_here(self.port.name)

    async def close(self) -> None:
        """Send the buffered bytes, and close the port."""
        if self._closed:
            return
        with contextlib.suppress(OSError):  # a lost port cannot send
            await self.until(lambda _now: self.node.idle or None, FLUSH)
        self._closed = True
        self._let_go()
        self.port.close()
        if self._task is not None:
            await self._task
        self._wake()


class AsyncPumpedNode(AsyncRingDriver):
    """Runs a node while tasks wait for it; for ports with their own clock.

    Attributes:
        node: the engine.
        port: the port of the node.
        on_event: called with each event of the engine.
    """

    def __init__(self, port: Port, node: RingNode, *, on_event: OnEvent | None = None) -> None:
        self.node = node
        self.port = port
        self.on_event = on_event
        self._io = NodeIo(port, node)

    def now(self) -> float:
        """Return the time on the port's clock."""
        return self.port.now()

    def act(self, function: Callable[[float], T]) -> T:
        """See `RingDriver.act`; received bytes are processed first."""
        self._step(self.port.read(0))
        now = self.port.now()
        result = function(now)
        self._io.flush(now)
        return result

    async def until(self, attempt: Callable[[float], T | None], timeout: float | None) -> T | None:
        """See `RingDriver.until`; other tasks run after each received chunk."""
        self._step(self.port.read(0))
        limit = float("inf") if timeout is None else self.port.now() + timeout
        while (value := attempt(now := self.port.now())) is None and now < limit:
            self._step(self.port.read(self._io.wait_at_most(now, limit - now)))
            await asyncio.sleep(0)
        self._io.flush(self.port.now())
        return value

    async def give_way(self) -> None:
        """See `RingDriver.give_way`."""
        await self.pause(GIVE_WAY)

    async def pause(self, seconds: float) -> None:
        """Sleep while the node runs."""
        await self.until(lambda _now: None, seconds)

    def _step(self, data: bytes) -> None:
        self._io.step(data)
        self._io.report(self.on_event)

    async def close(self) -> None:
        """Close the port."""
        self.port.close()


def drive_async(port: Port, node: RingNode, *, on_event: OnEvent | None = None) -> AsyncRingDriver:
    """Return the driver for a port."""
    if port.own_clock:
        return AsyncPumpedNode(port, node, on_event=on_event)
    return AsyncNode(port, node, on_event=on_event)
