"""Several programs on one virtual clock: each in a thread, and only one at a time, always in the same order.

A program runs until it has to wait. When all of them wait, the clock goes on to the next event, and each
looks whether that was what it waits for. So plain blocking code runs on simulated time, the same every time.
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
    """One program, and the baton that lets it run."""

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
    """Runs programs side by side on a clock that others move.

    Args:
        advance: goes on to the next event, but not beyond a time; False where nothing will ever happen.
    """

    def __init__(self, advance: Callable[[float], bool]) -> None:
        self._advance = advance
        self._programs: list[_Program] = []
        self._running: _Program | None = None
        self._stopping = False
        self._stuck = False

    def run(self, functions: Sequence[Callable[[], Result]]) -> list[Result]:
        """Run all programs to their ends; return what they return.

        Raises:
            SimulationError: all of them wait for something that will never happen.
            BaseException: what the first of them that failed has raised; the others are stopped.
        """
        if self._programs:
            raise SimulationError("programs are running already: start them all with one call of run")
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
        """Wait until something has happened, at the latest until `due`.

        Raises:
            SimulationError: nothing will ever happen, or another program has failed.
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
        """Raise what ends a program that others have stopped."""
        if self._stuck:
            raise _nothing_happens()
        if self._stopping:
            raise _Stopped("another program has failed, so this one was stopped")

    def stop(self) -> None:
        """End all programs as soon as they wait."""
        self._stopping = True

    def pass_on(self, program: _Program) -> None:
        """Let the next program run; after the last one has had its turn, time goes on."""
        programs = self._programs
        at = programs.index(program)
        following = [each for each in programs[at + 1 :] if not each.ended]
        if following:
            self._hand(following[0])
            return
        alive = [each for each in programs if not each.ended]
        if not alive:
            return
        # A program that has ended may have done something right before: let everybody look first.
        if not self._stopping and not program.ended and not self._advance(min(each.due for each in alive)):
            self._stuck = self._stopping = True
        self._hand(alive[0])

    def _hand(self, program: _Program) -> None:
        self._running = program
        program.baton.release()


class _Stopped(SimulationError):
    """A program was ended since another one has failed."""


def _nothing_happens() -> SimulationError:
    return SimulationError(
        "everybody waits, and nothing is going to happen: give a timeout, or look for the message that was "
        "never sent, or went to another node"
    )
