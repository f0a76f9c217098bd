"""The asyncio driver of masters and hosts.

The event loop rounds timeouts up to a millisecond, so deadlines are less precise than those of the blocking
driver.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from contextlib import ExitStack, aclosing, asynccontextmanager, suppress
from contextvars import ContextVar
from types import TracebackType
from typing import Any, Self, TypeVar, assert_never

from qlinkgen.errors import PortLost
from qlinkgen.link.events import Event
from qlinkgen.link.procedure import FAILURES, Ask, Outcome, Pause, Procedure, Report, Runner, Tell
from qlinkgen.link.transaction import Question, Reply
from qlinkgen.transport.conversation import Asker, MasterDriver, conversation, stream_of
from qlinkgen.transport.port import Port

_Result = TypeVar("_Result")
#: Transactions of several calls that the current task is in, on whatever bus.
_BLOCKS: ContextVar[tuple[object, ...]] = ContextVar("_BLOCKS", default=())


class AsyncMaster(MasterDriver):
    """Performs transactions on one bus, for any number of tasks of one event loop, one at a time.

    Attributes:
        engine: deadlines, counters, health.
        port: the port of the bus.
        on_event: called with each event of the engine, in the loop's thread.
    """

    def __init__(self, engine: Asker, port: Port, *, on_event: Callable[[Event], None] | None = None) -> None:
        super().__init__(engine, port, on_event)
        self._lock = asyncio.Lock()
        self._calls = asyncio.Lock()  # of a transaction, or of a call outside of it
        self._held: object = None  # the current transaction

    @asynccontextmanager
    async def transaction(self) -> AsyncIterator[None]:
        """Keep the other tasks off the line during a block of several calls.

        Tasks that the block begins belong to it, and blocks may be nested. The answers of a stream wait too.
        """
        if self._belongs:
            yield
            return
        async with self._calls:
            self._held = mine = object()
            token = _BLOCKS.set((*_BLOCKS.get(), mine))
            try:
                yield
            finally:
                self._held = None
                _BLOCKS.reset(token)

    @property
    def _belongs(self) -> bool:
        """Whether the current task is in the current transaction."""
        return self._held is not None and self._held in _BLOCKS.get()

    @asynccontextmanager
    async def _hold(self) -> AsyncIterator[None]:
        """Hold the port, and report events."""
        async with self.transaction(), self._lock:
            try:
                yield
            finally:
                self._report()

    async def transact(self, request: Question, *, attempts: int | None = None, trial: bool = False) -> Reply:
        """Send a request, and return the answer with the number of attempts and the time taken.

        After the cancellation of a task the bus is usable: the next request waits for a quiet line.

        Raises:
            NoReply: no reply was received, or the node is offline and its trial is not due.
            BadReply: only corrupt or wrong replies were received.
            Collision: the echo of the request was changed.
            PortLost: the port was lost.
            EncodeError: of the generated module; nothing was sent.
        """
        if not self._belongs:
            async with self._calls:
                return await self._transact(request, attempts, trial=trial)
        return await self._transact(request, attempts, trial=trial)

    async def _transact(self, request: Question, attempts: int | None, *, trial: bool) -> Reply:
        async with self._lock:
            steps = conversation(self.engine, self.port, request, attempts, trial=trial)
            try:
                timeout = next(steps)
                while True:
                    timeout = steps.send(await read(self.port, timeout))
            except StopIteration as end:
                reply: Reply = end.value
                return reply
            finally:
                steps.close()
                self._report()

    async def stream(self, request: Question, *, attempts: int | None = None) -> AsyncGenerator[Any, None]:
        """Send a request whose answers another command stops, and return an iterator over them.

        As `BlockingMaster.stream`. Leave it with `contextlib.aclosing`, so that the stopping command is sent
        there and then.
        """
        stream = stream_of(await self.transact(request, attempts=attempts))
        try:
            while stream is not None:
                while stream.answers:
                    yield stream.answers.popleft()
                if stream.ended:
                    break
                async with self._hold():
                    self._heard(stream, await read(self.port, self._wait_for(stream)))
        except PortLost:
            stream = None
            raise
        finally:
            if stream is not None and not stream.ended:
                await self.transact(stream.stop)
        if stream is not None and stream.error is not None:
            raise stream.error

    async def run(
        self, procedure: Procedure[Outcome], progress: Callable[[Report], None] | None = None
    ) -> Outcome:
        """Run a procedure to its end; `progress` is called with each report."""
        runner = Runner(procedure)
        async with aclosing(self._each(runner)) as reports:  # so that it cleans up now
            async for report in reports:
                if progress is not None:
                    progress(report)
        return runner.result

    def iterate(self, procedure: Procedure[Outcome]) -> AsyncGenerator[Report, None]:
        """Run a procedure as an iterator over its reports; it advances with the iterator."""
        return self._each(Runner(procedure))

    async def _each(self, runner: Runner[Outcome]) -> AsyncGenerator[Report, None]:
        try:
            while runner.advance():
                step = runner.wanted
                if isinstance(step, Ask):
                    try:
                        runner.outcome = await self.transact(
                            step.request, attempts=step.attempts, trial=step.trial
                        )
                    except FAILURES as error:
                        runner.failure = error
                elif isinstance(step, Pause):
                    await sleep(self.port, step.seconds)
                    runner.outcome = self.port.now()
                elif isinstance(step, Tell):
                    yield step.report
                else:
                    assert_never(step)
        finally:
            runner.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


async def read(port: Port, timeout: float) -> bytes:
    """Read a port without blocking the loop."""
    if data := port.read(0):
        return data
    if port.fileno() is None:
        return await _in_thread(port.read, timeout)
    await _readable(port, timeout)
    return port.read(0)


async def sleep(port: Port, seconds: float) -> None:
    """Sleep on a port's clock without blocking the loop."""
    if port.fileno() is None:  # its clock may be a simulated one
        await _in_thread(port.sleep, seconds)
    else:
        await asyncio.sleep(seconds)


def watch(
    port: Port, come: Callable[[], object], closed: Callable[[], object]
) -> tuple[int | None, Callable[[], None]]:
    """Let the running loop call `come` when bytes can be read, and `closed` once the port is closed.

    Returns:
        The descriptor, None for a port without one, which is not watched; and a function that ends the watch,
        after which the port may close its descriptor. It may be called any number of times.
    """
    loop = asyncio.get_running_loop()
    thread = threading.get_ident()
    held = ExitStack()

    def end() -> None:
        held.close()
        closed()

    def wake() -> None:
        if threading.get_ident() == thread or loop.is_closed():
            end()
            return
        with suppress(RuntimeError):  # the loop was closed meanwhile, with all its watches
            loop.call_soon_threadsafe(end)

    descriptor = held.enter_context(port.hold(wake))
    if descriptor is not None:
        loop.add_reader(descriptor, come)
        held.callback(_unwatch, loop, descriptor)
    return descriptor, held.close


def _unwatch(loop: asyncio.AbstractEventLoop, descriptor: int) -> None:
    if not loop.is_closed():
        loop.remove_reader(descriptor)


async def _readable(port: Port, timeout: float) -> None:
    """Return when bytes can be read, the port is closed, or after the timeout."""
    loop = asyncio.get_running_loop()
    ready: asyncio.Future[None] = loop.create_future()

    def settle() -> None:
        if not ready.done():
            ready.set_result(None)

    _, let_go = watch(port, settle, settle)
    timer = loop.call_later(timeout, settle)
    try:
        await ready
    finally:
        let_go()
        timer.cancel()


async def _in_thread(function: Callable[[float], _Result], seconds: float) -> _Result:
    """Call in a thread; a cancelled caller still waits for it, since a port allows one call at a time."""
    call = asyncio.ensure_future(asyncio.to_thread(function, seconds))
    cancelled: asyncio.CancelledError | None = None
    while not call.done():
        try:
            await asyncio.wait([call])
        except asyncio.CancelledError as error:
            cancelled = error
    if cancelled is not None:
        call.exception()  # retrieved, so that asyncio does not log it
        raise cancelled
    return call.result()
