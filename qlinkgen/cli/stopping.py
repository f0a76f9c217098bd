"""Stops long-running commands on Ctrl-C, SIGTERM or loss of the terminal; a second signal kills."""

from __future__ import annotations

import signal
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Self

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")


_Handler = Callable[[int, FrameType | None], object] | int | None


class StopSignals:
    """A context in which signals request a stop.

    The first one sets `stopped` and calls `on_stop`, and restores the previous handlers, so that a second one
    ends the program at once.

    Attributes:
        stopped: a signal was received.
    """

    def __init__(self, on_stop: Callable[[], object] | None = None) -> None:
        """Call `on_stop` in the signal handler."""
        self.stopped = False
        self._on_stop = on_stop
        self._before: dict[signal.Signals, _Handler] = {}

    def __enter__(self) -> Self:
        # A shell starts background programs with SIGINT ignored; it must stop them all the same. SIGHUP stays
        # ignored if nohup has set it so.
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
