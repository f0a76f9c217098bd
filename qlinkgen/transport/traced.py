"""A port that tells of all bytes that pass through it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager

from qlinkgen.transport.port import Port

#: Called with the time on the clock of the port, whether the bytes were sent, and the bytes.
Hear = Callable[[float, bool, bytes], None]


class TracedPort(Port):
    """Passes everything to another port, and tells of the bytes that are sent and received."""

    def __init__(self, port: Port, hear: Hear) -> None:
        """Take ownership of a port; closing this one closes it."""
        self._port = port
        self._hear = hear
        self.name, self.baud = port.name, port.baud
        self.capabilities, self.own_clock = port.capabilities, port.own_clock

    def now(self) -> float:
        """See `Port.now`."""
        return self._port.now()

    def sleep(self, seconds: float) -> None:
        """See `Port.sleep`."""
        self._port.sleep(seconds)

    def read(self, timeout: float) -> bytes:
        """See `Port.read`."""
        data = self._port.read(timeout)
        if data:
            self._hear(self._port.now(), False, data)
        return data

    def write(self, data: bytes) -> None:
        """See `Port.write`."""
        if data:
            self._hear(self._port.now(), True, data)
        self._port.write(data)

    def send_break(self, seconds: float) -> None:
        """See `Port.send_break`."""
        self._port.send_break(seconds)

    def close(self) -> None:
        """See `Port.close`."""
        self._port.close()

    def fileno(self) -> int | None:
        """See `Port.fileno`."""
        return self._port.fileno()

    def hold(self, wake: Callable[[], object]) -> AbstractContextManager[int | None]:
        """See `Port.hold`."""
        return self._port.hold(wake)
