"""Steps of a program, which a machine does one after the other, and those that decide on their order."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from qlinkgen.codecs import trio
from qlinkgen.protocols.trio.basic.errors import Place
from qlinkgen.protocols.trio.basic.expressions import Expression, Scope


class Runner(Protocol):
    """What a step can do with the machine that runs it."""

    scope: Scope

    def jump(self, to: int) -> None:
        """Go on with another step."""
        ...

    def call(self, label: str, to: int, place: Place) -> None:
        """Go on with another step, and return afterwards."""
        ...

    def back(self, place: Place) -> None:
        """Return to the step after the latest call."""
        ...

    def transmit(self, messages: Iterable[trio.Message], place: Place) -> None:
        """Send messages before the next step."""
        ...

    def sleep(self, seconds: float) -> None:
        """Wait before the next step."""
        ...

    def stop(self) -> None:
        """End the program."""
        ...


class Step(Protocol):
    """One step of a program."""

    @property
    def place(self) -> Place:
        """Where it is written."""
        ...

    def run(self, runner: Runner) -> bool:
        """Do the step; return False to do it again after the node has received something."""
        ...


@dataclass(frozen=True, slots=True)
class Jump:
    """To another step: the end of the THEN part of an IF with ELSE."""

    place: Place
    to: int

    def run(self, runner: Runner) -> bool:
        """Jump."""
        runner.jump(self.to)
        return True


@dataclass(frozen=True, slots=True)
class Unless:
    """To another step if a condition is FALSE, that is 0: IF and UNTIL."""

    place: Place
    condition: Expression
    to: int

    def run(self, runner: Runner) -> bool:
        """Jump, or go on."""
        if not self.condition.value(runner.scope):
            runner.jump(self.to)
        return True


@dataclass(frozen=True, slots=True)
class Goto:
    """GOTO label, or GOSUB label."""

    place: Place
    label: str
    labels: Mapping[str, int]
    returns: bool

    def run(self, runner: Runner) -> bool:
        """Jump to the label."""
        to = self.labels[self.label]
        if self.returns:
            runner.call(self.label, to, self.place)
        else:
            runner.jump(to)
        return True


@dataclass(frozen=True, slots=True)
class Return:
    """RETURN."""

    place: Place

    def run(self, runner: Runner) -> bool:
        """Return to the step after GOSUB."""
        runner.back(self.place)
        return True


@dataclass(frozen=True, slots=True)
class WaitUntil:
    """WAIT UNTIL condition."""

    place: Place
    condition: Expression

    def run(self, runner: Runner) -> bool:
        """Return whether the condition is true."""
        return bool(self.condition.value(runner.scope))


@dataclass(frozen=True, slots=True)
class Wait:
    """WA(milliseconds)."""

    place: Place
    milliseconds: Expression

    def run(self, runner: Runner) -> bool:
        """Sleep."""
        time = self.milliseconds.value(runner.scope)
        if time < 0:
            raise self.milliseconds.place.error(f"{time:g} ms was given; give 0 or more")
        runner.sleep(time / 1000)
        return True


@dataclass(frozen=True, slots=True)
class Stop:
    """STOP."""

    place: Place

    def run(self, runner: Runner) -> bool:
        """End the program."""
        runner.stop()
        return True
