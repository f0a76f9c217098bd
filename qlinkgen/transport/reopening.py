"""A port that comes back when it is plugged in again. Only for those who ask for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, RLock

from qlinkgen.errors import PortError, PortLost
from qlinkgen.transport.forking import tell_of_forks
from qlinkgen.transport.port import Port, closed_here


class ReopeningPort(Port):
    """Opens its port again after it was lost, at the first use after the caller was told by a `PortLost`.

    So a loss is never hidden: what was on its way is gone, and the caller must know. While the port stays
    away every use raises `PortLost`. The lost port is closed at once, because the kernel gives a replugged
    adapter a new number while the old one is held. After `close` it stays closed.

    A descriptor from `fileno` or `hold` is good until the next `PortLost`; ask again after it.

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
        self._closed = Event()
        self._loss = ""
        self._lock = RLock()  # held while the port is opened; a signal handler may close it meanwhile
        tell_of_forks(self)
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
        except PortLost as error:
            raise self._drop(port, error) from error

    def write(self, data: bytes) -> None:
        """See `Port.write`."""
        port = self._present()
        try:
            port.write(data)
        except PortLost as error:
            raise self._drop(port, error) from error

    @contextmanager
    def hold(self, wake: Callable[[], object]) -> Iterator[int | None]:
        """See `Port.hold`. Where another use finds the port lost, that closes it and wakes as well."""
        with self._present().hold(wake) as descriptor:
            yield descriptor

    def _present(self) -> Port:
        port = self._port
        return self._reopen() if port is None else port

    def _reopen(self) -> Port:
        with self._lock:
            if self._closed.is_set():
                raise closed_here(self.name)
            if self._port is not None:  # another thread was quicker
                return self._port
            try:
                port = self._opener()
            except PortError as error:
                raise PortLost(f"{self.name} is still away: {error}", port=self.name) from error
            self.reopened += 1
            self._take(port)
        if self._closed.is_set():  # by a signal handler meanwhile
            port.close()
        return port

    def _drop(self, port: Port, error: PortLost) -> PortLost:
        """Close a lost port, and return the error that says why it was lost.

        Where another thread has closed the lost port before, this thread has only seen that.
        """
        with self._lock:
            if self._port is port:
                self._port = None
                self._loss = str(error)
        port.close()
        return error if self._closed.is_set() else PortLost(self._loss, port=self.name)

    def close(self) -> None:
        """Close the port for good."""
        self._closed.set()
        with self._lock:
            port, self._port = self._port, None
        if port is not None:
            port.close()

    def after_fork(self) -> None:
        """Make a new lock: the old one may be held by a thread that does not exist in the child."""
        self._lock = RLock()

    def fileno(self) -> int | None:
        """Return the descriptor of the port as it is open now, None while it is away."""
        port = self._port
        return None if port is None else port.fileno()
