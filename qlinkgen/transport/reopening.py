"""A port that comes back when it is plugged in again. Only for those who ask for it."""

from __future__ import annotations

from collections.abc import Callable

from qlinkgen.errors import PortError, PortLost
from qlinkgen.transport.port import Port


class ReopeningPort(Port):
    """Opens its port again after it was lost, at the first use after the caller was told by a `PortLost`.

    So a loss is never hidden: what was on its way is gone, and the caller must know. While the port stays
    away every use raises `PortLost`. The lost port is closed at once, because the kernel gives a replugged
    adapter a new number while the old one is held. After `close` it stays closed.

    A descriptor from `fileno` is good until the next `PortLost`; ask again after it.

    Attributes:
        reopened: how often the port has come back.
    """

    def __init__(self, opener: Callable[[], Port]) -> None:
        """Open the port the first time; its errors are the opener's own.

        Args:
            opener: opens the port, such as `lambda: SerialPort("/dev/ttyUSB0")`. A name that stays with the
                adapter, as in /dev/serial/by-id, finds it at any plug.
        """
        self._opener = opener
        self._closed = False
        self.reopened = 0
        self._port: Port | None = None
        self._take(opener())

    def _take(self, port: Port) -> Port:
        self._port = port
        self._now, self._sleep = port.now, port.sleep
        self.name, self.baud, self.capabilities = port.name, port.baud, port.capabilities
        return port

    def now(self) -> float:
        """See `Port.now`."""
        return self._now()

    def sleep(self, seconds: float) -> None:
        """See `Port.sleep`."""
        self._sleep(seconds)

    def read(self, timeout: float) -> bytes:
        """See `Port.read`."""
        port = self._present()
        try:
            return port.read(timeout)
        except PortLost:
            self._drop()
            raise

    def write(self, data: bytes) -> None:
        """See `Port.write`."""
        port = self._present()
        try:
            port.write(data)
        except PortLost:
            self._drop()
            raise

    def _present(self) -> Port:
        if self._port is not None:
            return self._port
        if self._closed:
            raise PortLost(f"{self.name} was closed here; open it again to use it", port=self.name)
        try:
            port = self._opener()
        except PortError as error:
            raise PortLost(f"{self.name} is still away: {error}", port=self.name) from error
        self.reopened += 1
        return self._take(port)

    def _drop(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None

    def close(self) -> None:
        """Close the port for good."""
        self._closed = True
        self._drop()

    def fileno(self) -> int | None:
        """Return the descriptor of the port as it is open now, None while it is away."""
        return None if self._port is None else self._port.fileno()
