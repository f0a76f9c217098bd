"""Delays closing a descriptor until the last call that uses it has returned.

The system reuses the number of a closed descriptor for the next opened file. A thread still waiting on the
old number would read from that file, or write a frame into it.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import Event, Lock, get_ident

from qlinkgen.transport.forking import tell_of_forks

#: Seconds that `Gate.shut` waits for the calls inside, after waking them. The last of them releases in any
#: case.
PATIENCE = 1.0


class Gate:
    """Admits calls until it is shut; then the last call to leave releases the resource.

    Entering appends to a list and then reads a flag; shutting sets the flag and then reads the list. Both are
    atomic, so at least one side sees the other, and a call needs no lock. A signal handler may shut the gate
    while its own thread is inside.

    Attributes:
        is_shut: `shut` was called.
        wakers: functions that make waiting calls return; called once, by the thread that shuts the gate.
    """

    def __init__(self, release: Callable[[], object]) -> None:
        """Call `release` once, when the gate is shut and no call is inside."""
        self.is_shut = False
        self.wakers: list[Callable[[], object]] = []
        self._release = release
        self._inside: list[int] = []
        self._releasing = Lock()
        self._released = Event()
        tell_of_forks(self)

    def enter(self) -> bool:
        """Enter for this thread; return False if the gate is shut."""
        self._inside.append(get_ident())
        if self.is_shut:
            self.leave(get_ident())
            return False
        return True

    def leave(self, thread: int) -> None:
        """Leave for the thread that entered."""
        self._inside.remove(thread)
        if self.is_shut and not self._inside:
            self._finish()

    def shut(self) -> None:
        """Refuse further calls, wake those inside, and wait for them unless the caller is one of them."""
        self.is_shut = True
        for wake in list(self.wakers):
            wake()
        if not self._inside:
            self._finish()
        if get_ident() not in self._inside:
            self._released.wait(PATIENCE)

    def _finish(self) -> None:
        if self._releasing.acquire(blocking=False):  # never released, so only once
            try:
                self._release()
            finally:
                self._released.set()

    def after_fork(self) -> None:
        """Discard the calls of threads that do not exist in a forked child."""
        self._inside[:] = [each for each in self._inside if each == get_ident()]
        released, self._released = self._released, Event()
        if released.is_set():
            self._released.set()
