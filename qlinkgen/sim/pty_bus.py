"""A simulated line behind a pty: any program opens it as a serial port, in real time."""

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
from qlinkgen.transport.port import Port
from qlinkgen.transport.pty import open_pty
from qlinkgen.transport.waker import Waker

# `select` oversleeps by about 60 us, more than half a byte time at 115200 baud. The last stretch before
# something is due, in seconds, is therefore waited for by looking again and again.
_SPIN = 80e-6
# `select` takes no descriptor from here on (FD_SETSIZE).
_SELECT_LIMIT = 1024


class PtyBus:
    """Runs a `Wire` in real time, with its outside at the master end of a pty.

    For the command line: `run` in the main thread, `request_stop` from a signal handler, `close` at the end.
    In a test: `with PtyBus(wire) as bus:` runs it in a thread. The line belongs to the thread that runs it;
    what another thread wants to do with it goes through `call`.

    A line with a baud is paced: chunks="byte" spreads the bytes of an answer like a UART would.

    Attributes:
        wire: the line.
        port: our end of it.
        path: device name of the other end, for the program under test.
    """

    def __init__(
        self, wire: Wire, *, link: str | os.PathLike[str] | None = None, port: Port | None = None
    ) -> None:
        """Open the pty.

        Args:
            wire: the line, with its stations.
            link: path of a symbolic link to the other end, so that its name is known beforehand.
            port: use this port in place of a new pty, such as that of a real adapter; it must have a
                descriptor.

        Raises:
            PortError: the link cannot be made.
            CapabilityMissing: this system has no ptys.
            SimulationError: the port has no descriptor to wait for.
        """
        self.wire = wire
        self.port = port or open_pty(link, baud=wire.baud or 115200)
        self.path: str = str(getattr(self.port, "path", self.port.name))
        descriptor = self.port.fileno()
        if descriptor is None:
            raise SimulationError(
                f"{self.port.name} has no descriptor to wait for: use a pty or a serial port"
            )
        self._waker = Waker()
        self._look = make_looker(descriptor, self._waker.descriptor)
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
            PortLost: a port went away, or was closed.
        """
        with self._running, contextlib.ExitStack() as held:
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
        """Return whether there is something to read, at the latest when `due` has come."""
        look, clock = self._look, self.port.now
        if due is None:
            return look(None)
        left = due - clock()
        if left > _SPIN and look(left - _SPIN):
            return True
        while not look(0.0):  # once at least: what is due all the time must not hide what comes in
            if clock() >= due:
                return False
        return True

    def _answer_calls(self) -> None:
        self._waker.clear()
        while self._calls:
            self._calls.popleft()()

    def request_stop(self) -> None:
        """Let `run` return at once; for any thread, for a signal handler, and also before `run` begins."""
        self._stopping = True
        self._waker.wake()

    def call(self, function: Callable[[], object]) -> None:
        """Let the thread that runs the line call a function soon, such as one that detaches a station."""
        self._calls.append(function)
        self._waker.wake()

    def start(self) -> Self:
        """Run the line in a thread of its own.

        Raises:
            SimulationError: it runs already, or was stopped.
        """
        if self._thread is not None or self._stopping:
            raise SimulationError(f"the bus at {self.path} was started before: make a new one")
        self._thread = threading.Thread(target=self._run_thread, name=f"bus {self.path}", daemon=True)
        self._thread.start()
        return self

    def _run_thread(self) -> None:
        with HandOver(self.fail):
            self.run()

    def stop(self) -> None:
        """Stop the line, wait for its thread, and raise here what made it fail there, if anything."""
        self.request_stop()
        if self._thread is not None:
            self._thread.join()
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def close(self) -> None:
        """Stop the line, wherever it runs, and close the pty. Closing twice does no harm."""
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
        """Keep a failure for `stop` to raise."""
        self._failure = failure

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def make_looker(*descriptors: int) -> Callable[[float | None], bool]:
    """Return a function that waits until one of these can be read, at most some seconds, or without end."""
    if max(descriptors) < _SELECT_LIMIT:
        return lambda seconds: bool(select.select(descriptors, (), (), seconds)[0])
    poll = select.poll()
    for descriptor in descriptors:
        poll.register(descriptor, select.POLLIN)
    # Whole milliseconds, rounded down: the rest is waited for by looking again.
    return lambda seconds: bool(poll.poll(None if seconds is None else int(seconds * 1000)))
