"""What makes an AsyncBus look like a Bus, and what runs a simulated line in real time."""

from __future__ import annotations

import asyncio
import inspect
import threading
from collections.abc import Callable, Iterator
from typing import Any

from qlinkgen.errors import PortLost
from qlinkgen.protocols.qlink import AsyncNode
from qlinkgen.sim import Wire
from qlinkgen.transport import MemoryPort


class AsyncFace:
    """Makes an AsyncBus look like a Bus."""

    def __init__(self, target: Any, loop: asyncio.AbstractEventLoop) -> None:
        self._target = target
        self._loop = loop

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._target, name)
        return self._wrapped(value) if inspect.ismethod(value) else value

    def _wrapped(self, method: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            result = method(*args, **kwargs)
            if inspect.iscoroutine(result):
                return self._loop.run_until_complete(result)
            if inspect.isasyncgen(result):
                return self._iterate(result)
            return AsyncFace(result, self._loop) if isinstance(result, AsyncNode) else result

        return call

    def _iterate(self, steps: Any) -> Iterator[Any]:
        try:
            while True:
                yield self._loop.run_until_complete(anext(steps))
        except StopAsyncIteration:
            return
        finally:
            self._loop.run_until_complete(steps.aclose())


class Pump(threading.Thread):
    """Runs a line at the other end of a memory pair, in real time."""

    def __init__(self, wire: Wire, port: MemoryPort) -> None:
        super().__init__(daemon=True)
        self._wire = wire
        self._port = port
        self._stopping = False
        self._failure: BaseException | None = None

    def run(self) -> None:
        try:
            while not self._stopping:
                self._once()
        except PortLost:  # the near end was closed first
            return
        except BaseException as failure:  # noqa: BLE001  # raised again where the pump is stopped
            self._failure = failure

    def _once(self) -> None:
        wire, port = self._wire, self._port
        due = wire.next_timer()
        wait = 0.01 if due is None else min(max(0.0, due - port.now()), 0.01)
        if data := port.read(wait):
            wire.transmit(data, port.now())
        if heard := wire.take(port.now()):
            port.write(heard)

    def stop(self) -> None:
        self._stopping = True
        self.join()
        if self._failure is not None:
            raise self._failure
