"""Ends what runs until it is stopped: Ctrl-C, SIGTERM, the loss of the terminal; the second one insists."""

from __future__ import annotations

import signal
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Self

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")


_Handler = Callable[[int, FrameType | None], object] | int | None


class StopSignals:
    """While it is entered, signals ask to stop.

    The first one sets `stopped` and calls `on_stop`, and what they did before is in force again: who does not
    want to wait can insist.

    Attributes:
        stopped: a signal has come.
    """

    def __init__(self, on_stop: Callable[[], object] | None = None) -> None:
        """`on_stop` is called in a signal handler."""
        self.stopped = False
        self._on_stop = on_stop
        self._before: dict[signal.Signals, _Handler] = {}

    def __enter__(self) -> Self:
        # A shell starts background programs with SIGINT ignored; they are to end with it all the same. nohup
        # ignores SIGHUP, and means it.
        for name in _NAMES:
            number = getattr(signal, name, None)
            if number is not None and not (name == "SIGHUP" and signal.getsignal(number) is signal.SIG_IGN):
                self._before[number] = signal.signal(number, self._handle)
        return self

    def _handle(self, number: int, frame: FrameType | None) -> None:  # noqa: ARG002  # signal's interface
        self.stopped = True
        self._restore()
        if self._on_stop is not None:
            self._on_stop()

    def _restore(self) -> None:
        while self._before:
            number, handler = self._before.popitem()
            signal.signal(number, handler)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._restore()
