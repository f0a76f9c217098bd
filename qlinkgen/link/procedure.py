"""Procedures: operations of several transactions, written once for every kind of driver.

A procedure is a generator. It yields steps, and gets the outcome of each as the value of the `yield`, or its
error as an exception::

    def double_check(node: int) -> Procedure[int]:
        first = yield Ask(qlink.MotorPositionRequest(node=node))
        yield Pause(0.01)
        again = yield Ask(qlink.MotorPositionRequest(node=node))
        return again.response.position - first.response.position

Run it with `bus.run(double_check(3))` on a blocking driver, with `await bus.run(...)` on asyncio.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

from qlinkgen.errors import LinkError
from qlinkgen.link.transaction import Question, Reply

#: A progress report of a procedure.
Report: TypeAlias = Any  # each procedure has its own class of reports


class Ask(NamedTuple):
    """Perform a transaction; the value of the `yield` is its Reply."""

    request: Question
    #: None: the default of the timing.
    attempts: int | None = None
    #: Ask a node that is offline before its next trial is due.
    trial: bool = False


class Pause(NamedTuple):
    """Wait, with the bus free for others; the value is the time afterwards."""

    seconds: float


class Tell(NamedTuple):
    """Report progress to the caller; the value is None."""

    report: Report


Step = Ask | Pause | Tell
Outcome = TypeVar("Outcome")
#: Yields steps, gets Reply, float or None, and returns an outcome.
Procedure = Generator[Step, Any, Outcome]  # Any: which of them depends on the step

#: Errors of a transaction, which a procedure may catch.
FAILURES = (LinkError, OSError, ValueError, TypeError)


class Runner(Generic[Outcome]):
    """A running procedure: the driver advances it, performs the step, and stores the outcome here.

    Attributes:
        wanted: the current step.
        outcome: its outcome.
        failure: its error.
        result: return value of the procedure.
    """

    __slots__ = ("_procedure", "failure", "outcome", "result", "wanted")

    wanted: Step
    result: Outcome

    def __init__(self, procedure: Procedure[Outcome]) -> None:
        self._procedure = procedure
        self.outcome: Reply | float | None = None
        self.failure: Exception | None = None

    def advance(self) -> bool:
        """Advance to the next step; return False at the end."""
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
        """Close the procedure, so that it cleans up if it has not ended."""
        self._procedure.close()
