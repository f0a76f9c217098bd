"""A simulated line at a memory port, run by a thread in real time that skips silence."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

from qlinkgen.errors import PortLost
from qlinkgen.sim import Wire
from qlinkgen.transport import Port, memory_pair

#: Seconds between polls of the thread, and of a reader that checks whether data can still arrive.
_LOOK = 0.002
#: Number of idle rounds of the thread after which the line is idle. One is not enough, since it may have
#: begun before the last bytes were written.
_QUIET = 2


class MemoryLine(Port):
    """The external side of a `Wire`, in memory.

    A read that would time out returns early, and the clock advances by the rest: once the thread has
    processed all written bytes and no node has anything due, no data can arrive. A timeout therefore takes
    milliseconds of real time and may be long, and a slow thread does no harm.
    """

    def __init__(self, wire: Wire, baud: int = 115200) -> None:
        self._near, self._far = memory_pair(baud)
        self.name, self.baud, self.capabilities = self._near.name, baud, self._near.capabilities
        self._wire = wire
        self._lock = threading.Lock()
        self._skipped = 0.0
        self._quiet = 0
        self._stopping = False
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)

    def now(self) -> float:
        return time.monotonic() + self._skipped

    def read(self, timeout: float) -> bytes:
        end = self.now() + timeout
        while not (data := self._near.read(min(max(0.0, end - self.now()), _LOOK))):
            if self.now() >= end:
                break
            if self._quiet >= _QUIET:
                data = self._near.read(0)
                if not data:
                    self._skipped += max(0.0, end - self.now())
                break
        return data

    def write(self, data: bytes) -> None:
        with self._lock:  # otherwise a round that is about to end would count as idle
            self._quiet = 0
            self._near.write(data)

    def do(self, action: Callable[[], Any]) -> Any:
        """Call a function between two rounds of the thread, to change nodes."""
        with self._lock:
            self._quiet = 0
            return action()

    def _run(self) -> None:
        try:
            while not self._stopping:
                self._round()
        except PortLost:  # the near end was closed first
            return
        except BaseException as failure:  # noqa: BLE001  # raised again where the line is left
            self._failure = failure

    def _round(self) -> None:
        data = self._far.read(_LOOK)
        with self._lock:
            if data:
                self._wire.transmit(data, self.now())
            heard = self._wire.take(self.now())
            if heard:
                self._far.write(heard)
            idle = not data and not heard and self._wire.next_timer() is None
            self._quiet = self._quiet + 1 if idle else 0

    def close(self) -> None:
        self._near.close()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stopping = True
        self._thread.join()
        self.close()
        if self._failure is not None:
            raise self._failure
