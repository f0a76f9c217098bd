"""Passes an exception of a background thread to the thread that uses it, without a traceback on stderr."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType


class HandOver:
    """Passes an exception from the block to a callback and suppresses it."""

    def __init__(self, keep: Callable[[BaseException], None]) -> None:
        self._keep = keep

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if error is not None:
            self._keep(error)
        return True
