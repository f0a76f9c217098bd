"""When a descriptor may be closed: after the last call that uses it has returned, and never before.

The system gives the number of a closed descriptor to the next file that is opened. A thread that still waits
at the old number would read from that file, or write a frame into it.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import Event, Lock, get_ident

from qlinkgen.transport.forking import tell_of_forks

#: Seconds that `Gate.shut` waits for the calls inside, which it has woken. The last of them releases anyway.
PATIENCE = 1.0


class Gate:
    """Lets calls in until it is shut. After that the last call to leave releases what the calls use.

    Entering appends to a list and then looks at a flag; shutting sets the flag and then looks at the list.
    Both are atomic, so at least one side sees the other, and a call costs no lock. A signal handler may shut
    the gate while its own thread is inside.

    Attributes:
        is_shut: `shut` was called.
        wakers: functions that make waiting calls return; called once, by the thread that shuts the gate.
    """

    def __init__(self, release: Callable[[], object]) -> None:
        """`release` is called once, when the gate is shut and no call is inside."""
        self.is_shut = False
        self.wakers: list[Callable[[], object]] = []
        self._release = release
        self._inside: list[int] = []
        self._releasing = Lock()
        self._released = Event()
        tell_of_forks(self)

    def enter(self) -> bool:
        """Enter, in the name of this thread; False where the gate is shut."""
        self._inside.append(get_ident())
        if self.is_shut:
            self.leave(get_ident())
            return False
        return True

    def leave(self, thread: int) -> None:
        """Leave, in the name of the thread that entered."""
        self._inside.remove(thread)
        if self.is_shut and not self._inside:
            self._finish()

    def shut(self) -> None:
        """Let no further call in, wake those inside, and wait for them unless the caller is one of them."""
        self.is_shut = True
        for wake in list(self.wakers):
            wake()
        if not self._inside:
            self._finish()
        if get_ident() not in self._inside:
            self._released.wait(PATIENCE)

    def _finish(self) -> None:
        if self._releasing.acquire(blocking=False):  # and never given back: once
            try:
                self._release()
            finally:
                self._released.set()

    def after_fork(self) -> None:
        """Forget the calls of threads that do not exist in a forked child."""
        self._inside[:] = [each for each in self._inside if each == get_ident()]
        released, self._released = self._released, Event()
        if released.is_set():
            self._released.set()
