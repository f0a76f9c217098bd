"""Procedures: what takes several transactions, written once for every kind of driver.

A procedure is a generator. It yields what it wants done, gets the outcome back as the value of the `yield`,
and an error where a driver of its own would raise one::

    def double_check(node: int) -> Procedure[int]:
        first = yield Ask(qlink.MotorPositionRequest(node=node))
        yield Pause(0.01)
        again = yield Ask(qlink.MotorPositionRequest(node=node))
        return again.response.position - first.response.position

A blocking driver runs it with `bus.run(double_check(3))`, one for asyncio with `await bus.run(...)`.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

from qlinkgen.errors import LinkError
from qlinkgen.link.transaction import Question, Reply

#: What a procedure tells on the way.
Report: TypeAlias = Any  # each procedure tells of a class of its own, which its caller knows


class Ask(NamedTuple):
    """Do a transaction; the value of the `yield` is its Reply."""

    request: Question
    #: None: as often as the timing says.
    attempts: int | None = None
    #: Ask a node that is offline before its next trial is due.
    trial: bool = False


class Pause(NamedTuple):
    """Let so many seconds pass, and others use the bus; the value is the time then."""

    seconds: float


class Tell(NamedTuple):
    """Show the user how far it is; the value is None."""

    report: Report


Step = Ask | Pause | Tell
Outcome = TypeVar("Outcome")
#: Yields steps, gets Reply, float or None, and returns an outcome.
Procedure = Generator[Step, Any, Outcome]  # Any: which of them depends on the step

#: What a transaction can fail with; a procedure may catch it where it has asked.
FAILURES = (LinkError, OSError, ValueError, TypeError)


class Runner(Generic[Outcome]):
    """A procedure being run: a driver advances it, does what it wants, and leaves here what came of it.

    Attributes:
        wanted: what is to be done now.
        outcome: what came of it.
        failure: what it failed with.
        result: what the procedure returned.
    """

    __slots__ = ("_procedure", "failure", "outcome", "result", "wanted")

    wanted: Step
    result: Outcome

    def __init__(self, procedure: Procedure[Outcome]) -> None:
        self._procedure = procedure
        self.outcome: Reply | float | None = None
        self.failure: Exception | None = None

    def advance(self) -> bool:
        """Go on to the next step; False at the end."""
        outcome, failure = self.outcome, self.failure
        self.outcome = self.failure = None
        try:
            if failure is not None:
                self.wanted = self._procedure.throw(failure)
            else:
                self.wanted = self._procedure.send(outcome)
        except StopIteration as end:
            self.result = end.value
            return False
        return True

    def close(self) -> None:
        """Let the procedure clean up, if it has not ended."""
        self._procedure.close()
