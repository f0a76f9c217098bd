"""What is asked, and what came of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, final

from qlinkgen.errors import LinkError
from qlinkgen.link.codec import Command, Framed
from qlinkgen.link.timing import Timing


@final
class Packet(NamedTuple):
    """A request to the device at a host port, and how it is to be sent."""

    request: Framed
    #: Request that must be in force before, None where it does not matter.
    context: Framed | None = None
    #: Read the checksum; None: as the engine does with this command.
    check: bool | None = None


#: What an engine may be asked.
Question = Framed | Packet


class Reply(NamedTuple):
    """The outcome of a transaction that did not fail."""

    #: None where nothing answers.
    response: Any  # the class that the request asks for; the calls of a generated bus module name it
    #: How often the request was sent.
    attempts: int
    #: Seconds from the call to the answer.
    elapsed: float
    #: When the answer came; where nothing answers, when the request was sent.
    at: float
    #: Seconds from sending the last attempt to the answer.
    response_time: float


#: Whether a response is acceptable for a request, where more is known than its shape.
Accepts = Callable[[Any, Any], bool]  # Any: a request and a response of the classes of one command


class CommandTiming:
    """What is known of a command before it is asked: looked up once, not in each transaction."""

    __slots__ = (
        "accepts", "allowance", "answer_time", "answers_broadcast", "definition", "echoes", "response",
        "tries",
    )  # fmt: skip

    def __init__(self, command: Command, timing: Timing, accepts: Accepts | None) -> None:
        self.definition = command
        self.response = command.response
        self.accepts = accepts
        self.echoes = command.echoes
        self.answers_broadcast = command.addressing == "answered_broadcast"
        self.allowance = timing.gap(command)
        self.answer_time = timing.deadline(command, 0)
        self.tries = timing.attempts_of(command)


def settled(outcome: Reply | LinkError | None) -> Reply:
    """Return the outcome of a transaction that has ended, or raise it."""
    if isinstance(outcome, LinkError):
        raise outcome
    if outcome is None:
        raise RuntimeError("no transaction has ended")
    return outcome
