"""A simulated line on a pty, which programs open as a serial port, in real time."""

from __future__ import annotations

import contextlib
import os
import select
import threading
from collections import deque
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Self

from qlinkgen.sim.errors import SimulationError
from qlinkgen.sim.wire import Wire
from qlinkgen.transport.forking import tell_of_forks
from qlinkgen.transport.handing_over import HandOver
from qlinkgen.transport.listening import ListeningPort
from qlinkgen.transport.port import Port
from qlinkgen.transport.pty import open_pty
from qlinkgen.transport.waker import Waker

# `select` oversleeps by about 60 us, more than half a byte time at 115200 baud. The last part of a wait, in
# seconds, is therefore done by polling.
_SPIN = 80e-6
# `select` takes no descriptor from here on (FD_SETSIZE).
_SELECT_LIMIT = 1024


class PtyBus:
    """Runs a `Wire` in real time, with its outside at the master end of a pty.

    For the command line: `run` in the main thread, `request_stop` from a signal handler, `close` at the end.
    In a test: `with PtyBus(wire) as bus:` runs it in a thread. The line belongs to the thread that runs it;
    other threads access it through `call`.

    A line with a baud is paced: chunks="byte" spreads the bytes of an answer like a UART.

    Attributes:
        wire: the line.
        port: the master end of the pty.
        path: device name of the slave end, for the program under test.
    """

    def __init__(
        self, wire: Wire, *, link: str | os.PathLike[str] | None = None, port: Port | None = None
    ) -> None:
        """Open the pty.

        Args:
            wire: the line, with its stations.
            link: path of a symbolic link to the slave end, so that its name is known beforehand.
            port: use this port instead of a new pty: an adapter or `ListeningPort`, with a descriptor.

        Raises:
            PortError: the link cannot be made.
            CapabilityMissing: this system has no ptys.
            SimulationError: the port has no descriptor to wait on.
        """
        self.wire = wire
        self.port = port or open_pty(link, baud=wire.baud or 115200)
        self.path: str = str(getattr(self.port, "path", self.port.name))
        descriptor = self.port.fileno()
        if descriptor is None:
            raise SimulationError(
                f"{self.port.name} has no descriptor to wait on; use a pty or a serial port"
            )
        self._waker = Waker()
        self._look = make_looker(descriptor, self._waker.descriptor)
        if isinstance(self.port, ListeningPort):
            self._look = self._look_at_clients
        self._running = threading.RLock()
        self._calls: deque[Callable[[], object]] = deque()
        self._stopping = False
        self._closed = False
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None
        tell_of_forks(self)

    def run(self) -> None:
        """Run the line in this thread until `request_stop` is called.

        Raises:
            PortLost: a port was lost or closed.
        """
        with self._running, contextlib.ExitStack() as held:
            if threading.current_thread() is threading.main_thread():
                held.enter_context(self._waker.woken_by_signals())
            for port in self._all_ports():
                held.enter_context(port.hold(self._waker.wake))
            self._loop()

    def _all_ports(self) -> Sequence[Port]:
        return [self.port]

    def _loop(self) -> None:
        wire, port, clock = self.wire, self.port, self.port.now
        while not self._stopping:
            now = clock()
            data = wire.take(now)
            if data:
                port.write(data)
            if self._wait(wire.next_timer()):
                data = port.read(0.0)
                if data:
                    wire.transmit(data, clock())
                else:
                    self._answer_calls()

    def _wait(self, due: float | None) -> bool:
        """Return whether there are bytes to read, at the latest at `due`."""
        look, clock = self._look, self.port.now
        if due is None:
            return look(None)
        left = due - clock()
        if left > _SPIN and look(left - _SPIN):
            return True
        while not look(0.0):  # at least once, so that permanently due events do not block reading
            if clock() >= due:
                return False
        return True

    def _look_at_clients(self, seconds: float | None) -> bool:
        """Wait on a port whose descriptor changes."""
        watched = [each for each in (self.port.fileno(), self._waker.descriptor) if each is not None]
        return bool(select.select(watched, (), (), seconds)[0])

    def _answer_calls(self) -> None:
        self._waker.clear()
        while self._calls:
            self._calls.popleft()()

    def request_stop(self) -> None:
        """Make `run` return immediately; for any thread and signal handlers, also before `run` begins."""
        self._stopping = True
        self._waker.wake()

    def call(self, function: Callable[[], object]) -> None:
        """Make the thread that runs the line call a function, such as one that detaches a station."""
        self._calls.append(function)
        self._waker.wake()

    def start(self) -> Self:
        """Run the line in a separate thread.

        Raises:
            SimulationError: it is already running, or was stopped.
        """
        if self._thread is not None or self._stopping:
            raise SimulationError(f"the bus at {self.path} was already started; make a new one")
        self._thread = threading.Thread(target=self._run_thread, name=f"bus {self.path}", daemon=True)
        self._thread.start()
        return self

    @property
    def running(self) -> bool:
        """Whether the thread of `start` runs the line."""
        return self._thread is not None and self._thread.is_alive()

    def _run_thread(self) -> None:
        with HandOver(self.fail):
            self.run()

    def stop(self) -> None:
        """Stop the line, wait for its thread, and raise its exception, if any."""
        self.request_stop()
        if self._thread is not None:
            self._thread.join()
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def close(self) -> None:
        """Stop the line in any thread, and close the pty. Closing twice is allowed."""
        if self._closed:
            return
        try:
            self.stop()
        finally:
            self._closed = True
            with self._running:
                for port in self._all_ports():
                    port.close()
                self._waker.close()

    def after_fork(self) -> None:
        """Make a new lock: the thread that runs the line does not exist in a forked child."""
        self._running = threading.RLock()

    def fail(self, failure: BaseException) -> None:
        """Keep an exception for `stop` to raise."""
        self._failure = failure

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def make_looker(*descriptors: int) -> Callable[[float | None], bool]:
    """Return a function that waits until one of these can be read, with an optional timeout."""
    if max(descriptors) < _SELECT_LIMIT:
        return lambda seconds: bool(select.select(descriptors, (), (), seconds)[0])
    poll = select.poll()
    for descriptor in descriptors:
        poll.register(descriptor, select.POLLIN)
    # Whole milliseconds, rounded down: the rest is polled.
    return lambda seconds: bool(poll.poll(None if seconds is None else int(seconds * 1000)))
