"""The keyboard of a terminal, key by key, without waiting for a line."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import time
from types import TracebackType
from typing import Self

if sys.platform != "win32":
    import termios
    import tty


class Keyboard:
    """Reads the keys typed at standard input if that is a terminal; otherwise there are none.

    Inside the context the terminal neither waits for a line nor shows what is typed; Ctrl-C works as usual.
    Windows is not supported: there it never has keys.
    """

    def __init__(self, *, used: bool) -> None:
        """Use the terminal, or only pass time."""
        self._descriptor: int | None = None
        self._restore = contextlib.ExitStack()
        if used and sys.platform != "win32":
            self._descriptor = sys.stdin.fileno()

    def __enter__(self) -> Self:
        if self._descriptor is not None and sys.platform != "win32":
            before = termios.tcgetattr(self._descriptor)
            self._restore.callback(termios.tcsetattr, self._descriptor, termios.TCSADRAIN, before)
            tty.setcbreak(self._descriptor)
        return self

    def read(self, seconds: float) -> str:
        """Return the characters typed, after waiting for the first one for at most some seconds."""
        if self._descriptor is None:
            time.sleep(seconds)
            return ""
        if not select.select([self._descriptor], [], [], seconds)[0]:
            return ""
        data = os.read(self._descriptor, 256)
        if not data:  # the terminal is gone
            self._descriptor = None
        return data.decode("ascii", errors="ignore")

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._restore.close()
