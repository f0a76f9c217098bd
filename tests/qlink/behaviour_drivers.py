"""A blocking wrapper of an AsyncBus."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable, Iterator
from typing import Any

from qlinkgen.protocols.qlink import AsyncNode


class AsBlocking:
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
            return AsBlocking(result, self._loop) if isinstance(result, AsyncNode) else result

        return call

    def _iterate(self, steps: Any) -> Iterator[Any]:
        try:
            while True:
                yield self._loop.run_until_complete(anext(steps))
        except StopAsyncIteration:
            return
        finally:
            self._loop.run_until_complete(steps.aclose())
