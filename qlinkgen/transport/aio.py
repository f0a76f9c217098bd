"""The driver for asyncio: the same engine, awaited.

The event loop rounds waits up to a millisecond, so deadlines are kept a little less precisely than by the
blocking driver.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from types import TracebackType
from typing import Any, Self

from qlinkgen.link.events import Event
from qlinkgen.link.procedure import FAILURES, Ask, Outcome, Pause, Procedure, Steps
from qlinkgen.link.transaction import Reply
from qlinkgen.transport.conversation import Asker, MasterDriver, conversation
from qlinkgen.transport.port import Port


class AsyncMaster(MasterDriver):
    """Asks on one bus, from any number of tasks of one event loop: one transaction at a time.

    Attributes:
        engine: deadlines, counters, health.
        port: where it asks.
        on_event: called with each event of the engine, in the loop's thread.
    """

    def __init__(self, engine: Asker, port: Port, *, on_event: Callable[[Event], None] | None = None) -> None:
        super().__init__(engine, port, on_event)
        self._lock = asyncio.Lock()

    async def transact(self, request: Any, *, attempts: int | None = None, trial: bool = False) -> Reply:
        """Ask, and return the answer with the number of attempts and the time that it took.

        A task that is cancelled leaves the bus usable: the next request waits for a quiet line.

        Raises:
            NoReply: no answer came, or the node is offline and not due yet.
            BadReply: only damaged or wrong answers came.
            Collision: the request came back changed.
            PortLost: the port went away.
            EncodeError: of the generated module; nothing was sent.
        """
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

    async def run(
        self, procedure: Procedure[Outcome], progress: Callable[[Any], None] | None = None
    ) -> Outcome:
        """Run a procedure to its end; `progress` is called with what it tells on the way."""
        steps = Steps(procedure)
        async with aclosing(self._each(steps)) as reports:  # else it would clean up at some later time
            async for report in reports:
                if progress is not None:
                    progress(report)
        return steps.result

    def iterate(self, procedure: Procedure[Outcome]) -> AsyncGenerator[Any, None]:
        """Run a procedure as an iterator over what it tells; it goes on as the iterator is asked for more."""
        return self._each(Steps(procedure))

    async def _each(self, steps: Steps[Outcome]) -> AsyncGenerator[Any, None]:
        try:
            while steps.advance():
                step = steps.wanted
                if isinstance(step, Ask):
                    try:
                        steps.outcome = await self.transact(
                            step.request, attempts=step.attempts, trial=step.trial
                        )
                    except FAILURES as error:
                        steps.failure = error
                elif isinstance(step, Pause):
                    await sleep(self.port, step.seconds)
                    steps.outcome = self.port.now()
                else:
                    yield step.report
        finally:
            steps.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


async def read(port: Port, timeout: float) -> bytes:
    """Read a port without holding up the loop."""
    if data := port.read(0):
        return data
    descriptor = port.fileno()
    if descriptor is None:
        came: bytes = await _in_thread(port.read, timeout)
        return came
    if await _readable(descriptor, timeout):
        return port.read(0)
    return b""


async def sleep(port: Port, seconds: float) -> None:
    """Let time pass on a port's clock without holding up the loop."""
    if port.fileno() is None:  # its clock may be a simulated one
        await _in_thread(port.sleep, seconds)
    else:
        await asyncio.sleep(seconds)


async def _readable(descriptor: int, timeout: float) -> bool:
    loop = asyncio.get_running_loop()
    ready: asyncio.Future[bool] = loop.create_future()

    def settle(came: bool) -> None:  # the loop calls it with what it was given
        if not ready.done():
            ready.set_result(came)

    timer = loop.call_later(timeout, settle, False)
    loop.add_reader(descriptor, settle, True)
    try:
        return await ready
    finally:
        loop.remove_reader(descriptor)
        timer.cancel()


async def _in_thread(function: Callable[[float], Any], seconds: float) -> Any:
    """Call in a thread; a cancelled caller still waits for it, since a port serves one at a time."""
    call = asyncio.ensure_future(asyncio.to_thread(function, seconds))
    cancelled: asyncio.CancelledError | None = None
    while not call.done():
        try:
            await asyncio.wait([call])
        except asyncio.CancelledError as error:
            cancelled = error
    if cancelled is not None:
        call.exception()  # looked at, so that asyncio does not complain of it
        raise cancelled
    return call.result()
