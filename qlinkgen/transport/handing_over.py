"""How a thread of ours ends when something fails in it: no traceback, and the failure is not lost."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType


class HandOver:
    """Gives whatever ends a block to a function, which keeps it for the thread that can deal with it."""

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
