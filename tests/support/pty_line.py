"""A simulated line on a pty in real time that skips silence, for blocking and asyncio drivers."""

from __future__ import annotations

import asyncio
import selectors
import threading
import time
from collections.abc import Callable
from typing import Self, cast

from qlinkgen.sim import Wire
from qlinkgen.sim.pty_bus import PtyBus
from qlinkgen.transport.pty import PtyPort
from qlinkgen.transport.serial_port import SerialPort

#: Seconds after which a wait checks whether data can still arrive.
_LOOK = 0.002


class _Silence:
    """The clock of a line. It skips the rest of a wait once nothing can arrive.

    It is used in place of the wire by the thread that runs the line, and counts the bytes of both directions.
    Nothing can arrive once the stations have processed all written bytes, have nothing due, and all that they
    have sent was read. A thread that does not get a processor only makes a wait longer.
    """

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        self._lock = threading.Lock()
        self._skipped = 0.0
        self._to_stations = self._from_stations = 0
        self.baud = wire.baud

    def now(self) -> float:
        return time.monotonic() + self._skipped

    def written(self, count: int) -> None:
        with self._lock:
            self._to_stations += count

    def read(self, count: int) -> None:
        with self._lock:
            self._from_stations -= count

    def waited(self, end: float) -> bool:
        """Whether a wait is over: its time is, or nothing can arrive until then, which is skipped."""
        with self._lock:
            if not self._to_stations and not self._from_stations and self._wire.next_timer() is None:
                self._skipped += max(0.0, end - self.now())
            return self.now() >= end

    # As the wire

    def transmit(self, data: bytes, now: float) -> None:
        with self._lock:
            self._wire.transmit(data, now)
            self._to_stations -= len(data)

    def take(self, now: float) -> bytes:
        with self._lock:
            data = self._wire.take(now)
            self._from_stations += len(data)
            return data

    def next_timer(self) -> float | None:
        with self._lock:
            return self._wire.next_timer()


class _Outside(PtyPort):
    """The end of the stations."""

    def __init__(self, silence: _Silence) -> None:
        super().__init__()
        self._silence = silence

    def now(self) -> float:
        return self._silence.now()


class _Inside(SerialPort):
    """The end of the program under test."""

    def __init__(self, path: str, silence: _Silence) -> None:
        super().__init__(path)
        self._silence = silence

    def now(self) -> float:
        return self._silence.now()

    def read(self, timeout: float) -> bytes:
        end = self.now() + timeout
        while not (data := super().read(min(max(0.0, end - self.now()), _LOOK))):
            if self._silence.waited(end):
                return b""
        self._silence.read(len(data))
        return data

    def write(self, data: bytes) -> None:
        self._silence.written(len(data))
        super().write(data)


class _SkippingSelector(selectors.DefaultSelector):
    def __init__(self, silence: _Silence) -> None:
        super().__init__()
        self._silence = silence

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None or timeout <= 0:
            return super().select(timeout)
        end = self._silence.now() + timeout
        while not (found := super().select(min(max(0.0, end - self._silence.now()), _LOOK))):
            if self._silence.waited(end):
                return []
        return found


class _SkippingLoop(asyncio.SelectorEventLoop):
    def __init__(self, silence: _Silence) -> None:
        super().__init__(_SkippingSelector(silence))
        self._silence = silence

    def time(self) -> float:
        return self._silence.now()


class PtyLine:
    """A wire without a baud that `PtyBus` runs.

    A wait for an answer that does not come takes milliseconds of real time, so timeouts may be long.

    Attributes:
        bus: the line, for calls in its thread.
        port: the other end of the pty, for the program under test.
        loop_factory: makes an event loop for a driver at that port.
    """

    def __init__(self, wire: Wire) -> None:
        assert wire.baud is None
        silence = _Silence(wire)
        self.bus = PtyBus(cast(Wire, silence), port=_Outside(silence))
        self.port = _Inside(self.bus.path, silence)
        self.loop_factory: Callable[[], asyncio.AbstractEventLoop] = lambda: _SkippingLoop(silence)

    def __enter__(self) -> Self:
        self.bus.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.port.close()
        self.bus.close()
