"""Several programs on one virtual clock: each in a thread, one at a time, in a fixed order.

A program runs until it has to wait. When all of them wait, the clock advances to the next event, and each
checks its condition. So plain blocking code runs on simulated time, deterministically.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from typing import TypeVar

from qlinkgen.sim.errors import SimulationError
from qlinkgen.transport.handing_over import HandOver

Result = TypeVar("Result")


class _Program(threading.Thread):
    """One program, and the semaphore that lets it run."""

    def __init__(self, owner: Programs, name: str, function: Callable[[], None]) -> None:
        super().__init__(name=name, daemon=True)
        self.owner = owner
        self.function = function
        self.baton = threading.Semaphore(0)
        self.due = math.inf
        self.ended = False
        self.failure: BaseException | None = None

    def run(self) -> None:
        self.baton.acquire()
        with HandOver(self._failed):
            self.owner.check()
            self.function()
        self.ended = True
        self.owner.pass_on(self)

    def _failed(self, error: BaseException) -> None:
        self.failure = error
        self.owner.stop()


class Programs:
    """Runs programs concurrently on a simulated clock.

    Args:
        advance: advances to the next event, at most to a given time; returns False if there are no more
            events.
    """

    def __init__(self, advance: Callable[[float], bool]) -> None:
        self._advance = advance
        self._programs: list[_Program] = []
        self._running: _Program | None = None
        self._stopping = False
        self._stuck = False

    def run(self, functions: Sequence[Callable[[], Result]]) -> list[Result]:
        """Run all programs to their ends; return their results.

        Raises:
            SimulationError: deadlock: all of them wait, and no events are left.
            BaseException: the exception of the first failed program; the others are stopped.
        """
        if self._programs:
            raise SimulationError("programs are already running; start all of them with one call of run")
        self._stopping = self._stuck = False
        results: dict[int, Result] = {}

        def keeping(place: int, function: Callable[[], Result]) -> Callable[[], None]:
            return lambda: results.update({place: function()})

        programs = self._programs = [
            _Program(self, getattr(each, "__name__", "program"), keeping(place, each))
            for place, each in enumerate(functions)
        ]
        for program in programs:
            program.start()
        if programs:
            self._hand(programs[0])
        for program in programs:
            program.join()
        self._programs = []
        self._running = None
        failures = [program.failure for program in programs if program.failure is not None]
        if failures:
            raise next((each for each in failures if not isinstance(each, _Stopped)), failures[0])
        return [results[place] for place in range(len(programs))]

    def give_way(self, due: float) -> None:
        """Wait for an event, at the latest until `due`.

        Raises:
            SimulationError: no events are left, or another program has failed.
        """
        program = self._running
        if program is None or threading.current_thread() is not program:
            if not self._advance(due):
                raise _nothing_happens()
            return
        program.due = due
        self.pass_on(program)
        program.baton.acquire()
        program.due = math.inf
        self.check()

    def check(self) -> None:
        """Raise the exception that ends a stopped program."""
        if self._stuck:
            raise _nothing_happens()
        if self._stopping:
            raise _Stopped("stopped because another program has failed")

    def stop(self) -> None:
        """End all programs as soon as they wait."""
        self._stopping = True

    def pass_on(self, program: _Program) -> None:
        """Let the next program run; after the last one, advance the time."""
        programs = self._programs
        at = programs.index(program)
        following = [each for each in programs[at + 1 :] if not each.ended]
        if following:
            self._hand(following[0])
            return
        alive = [each for each in programs if not each.ended]
        if not alive:
            return
        # A program may have acted just before its end: let all others check their conditions first.
        if not self._stopping and not program.ended and not self._advance(min(each.due for each in alive)):
            self._stuck = self._stopping = True
        self._hand(alive[0])

    def _hand(self, program: _Program) -> None:
        self._running = program
        program.baton.release()


class _Stopped(SimulationError):
    """A program was stopped because another one has failed."""


def _nothing_happens() -> SimulationError:
    return SimulationError(
        "deadlock: all programs wait, and no events are left; use a timeout, or look for a message "
        "that was not sent, or was sent to another node"
    )
