"""A pipe that ends the wait of another thread in `select` or `poll`; on Windows a pair of sockets."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import sys
from collections.abc import Iterator
from threading import RLock

from qlinkgen.transport.forking import tell_of_forks


class Waker:
    """Wakes a thread that waits on `descriptor` and others. For any thread and for signal handlers.

    Attributes:
        descriptor: readable after `wake`, until `clear`. Valid until `close`.
    """

    def __init__(self) -> None:
        if sys.platform == "win32":  # where `select` takes sockets only
            self._ends = socket.socketpair()
            for end in self._ends:
                end.setblocking(False)
            self.descriptor = self._ends[0].fileno()
        else:
            self.descriptor, self._write_end = os.pipe()
            os.set_blocking(self.descriptor, False)
            os.set_blocking(self._write_end, False)
        self._open = True
        self._lock = RLock()  # a handler may interrupt a call of its own thread
        tell_of_forks(self)

    def wake(self) -> None:
        """Make the descriptor readable. Does nothing after `close`."""
        with self._lock:
            if self._open:
                with contextlib.suppress(BlockingIOError):  # a full pipe wakes as well
                    if sys.platform == "win32":
                        self._ends[1].send(b"!")
                    else:
                        os.write(self._write_end, b"!")

    def clear(self) -> None:
        """Undo every earlier `wake`."""
        with self._lock:
            if self._open:
                with contextlib.suppress(BlockingIOError):  # not woken
                    if sys.platform == "win32":
                        self._ends[0].recv(4096)
                    else:
                        os.read(self.descriptor, 4096)

    @contextlib.contextmanager
    def woken_by_signals(self) -> Iterator[None]:
        """Let signals wake too, during a block in the main thread.

        A signal that arrives right before the wait begins, or in another thread, does not interrupt it, and
        Python runs its handler only after the wait.
        """
        if sys.platform == "win32":
            end = self._ends[1].fileno()
        else:
            end = self._write_end
        before = signal.set_wakeup_fd(end, warn_on_full_buffer=False)
        try:
            yield
        finally:
            signal.set_wakeup_fd(before)

    def close(self) -> None:
        """Close the pipe, once no thread waits on it. Closing twice is allowed."""
        with self._lock:
            if self._open:
                self._open = False
                if sys.platform == "win32":
                    for end in self._ends:
                        end.close()
                else:
                    os.close(self._write_end)
                    os.close(self.descriptor)

    def after_fork(self) -> None:
        """Make a new pipe and lock: the parent shares the old pipe, and its threads may hold the lock."""
        self._lock = RLock()
        if self._open and sys.platform != "win32":
            ends = os.pipe()
            for new, old in zip(ends, (self.descriptor, self._write_end), strict=True):
                os.set_blocking(new, False)
                os.dup2(new, old, inheritable=False)
                os.close(new)
