"""A port that is reopened after the adapter was reconnected; optional."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, RLock

from qlinkgen.errors import PortError, PortLost
from qlinkgen.transport.forking import tell_of_forks
from qlinkgen.transport.port import Port, closed_here


class ReopeningPort(Port):
    """Reopens a lost port at the first use after the loss was reported by `PortLost`.

    So a loss is never hidden, since bytes in transit are lost. While the port is missing every use raises
    `PortLost`. The lost port is closed immediately, because the kernel gives a reconnected adapter a new
    number while the old one is in use. After `close` it stays closed.

    A descriptor from `fileno` or `hold` is valid until the next `PortLost`; get a new one after it.

    Attributes:
        reopened: number of times the port was reopened.
    """

    def __init__(self, opener: Callable[[], Port]) -> None:
        """Open the port the first time; its errors are the opener's own.

        Args:
            opener: opens the port, such as `lambda: SerialPort("/dev/ttyUSB0")`. A stable name of the
                adapter, as in /dev/serial/by-id, works at any socket.
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

    def send_break(self, seconds: float) -> None:
        """See `Port.send_break`."""
        port = self._present()
        try:
            port.send_break(seconds)
        except PortLost as error:
            raise self._drop(port, error) from error

    @contextmanager
    def hold(self, wake: Callable[[], object]) -> Iterator[int | None]:
        """See `Port.hold`. If another call finds the port lost, that closes it and wakes as well."""
        with self._present().hold(wake) as descriptor:
            yield descriptor

    def _present(self) -> Port:
        port = self._port
        return self._reopen() if port is None else port

    def _reopen(self) -> Port:
        with self._lock:
            if self._closed.is_set():
                raise closed_here(self.name)
            if self._port is not None:  # another thread was first
                return self._port
            try:
                port = self._opener()
            except PortError as error:
                raise PortLost(f"{self.name} is still missing: {error}", port=self.name) from error
            self.reopened += 1
            self._take(port)
        if self._closed.is_set():  # by a signal handler meanwhile
            port.close()
        return port

    def _drop(self, port: Port, error: PortLost) -> PortLost:
        """Close a lost port, and return the error with the cause.

        If another thread has closed the lost port before, that is the cause seen by this thread.
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
        """Return the current descriptor of the port, None while it is missing."""
        port = self._port
        return None if port is None else port.fileno()
