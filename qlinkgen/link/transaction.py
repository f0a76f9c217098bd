"""Requests to an engine, and their outcome."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, final

from qlinkgen.errors import LinkError
from qlinkgen.link.codec import Command, Framed
from qlinkgen.link.dialogue import Dialogue
from qlinkgen.link.timing import Timing
from qlinkgen.link.turn import steps_of


@final
class Packet(NamedTuple):
    """A request to the device at a host port, and how to send it."""

    request: Framed
    #: Context request that must be in force before; None if it does not matter.
    context: Framed | None = None
    #: Whether to read the checksum; None: the engine's setting for this command.
    check: bool | None = None


#: A request of a master or a host.
Question = Framed | Packet | Dialogue


class Reply(NamedTuple):
    """The outcome of a successful transaction."""

    #: None for a request without a response, a list of several answers, a tuple of those in a dialogue, a
    #: `Stream` of those that another command stops.
    response: Any  # of the request's response class; the calls of a generated bus module have its type
    #: Number of transmissions of the request.
    attempts: int
    #: Seconds from the call to the answer.
    elapsed: float
    #: Time of the answer; for a request without a response, the time of sending.
    at: float
    #: Seconds from sending the last attempt to the answer.
    response_time: float


#: An additional rule whether a response matches a request.
Accepts = Callable[[Any, Any], bool]  # Any: a request and a response of the classes of one command


class CommandTiming:
    """Response and deadlines of a command, computed once instead of for each transaction."""

    __slots__ = (
        "accepts", "allowance", "answer_time", "answers_broadcast", "definition", "echoes", "many", "plain",
        "replies", "response", "sizes", "step_times", "tries",
    )  # fmt: skip

    def __init__(self, command: Command, timing: Timing, accepts: Accepts | None) -> None:
        self.definition = command
        self.response = command.response
        self.accepts = accepts
        self.echoes = command.echoes
        self.sizes = command.sizes
        self.replies = command.replies
        #: Class of the response if it answers in any case, whatever is in it, and is the only one.
        self.plain = command.response
        steps = steps_of(command)
        if command.many is not None or steps or command.response in command.replies:
            self.plain = None
        self.many = command.many
        self.answers_broadcast = command.addressing == "answered_broadcast"
        self.allowance = timing.gap(command)
        self.answer_time = timing.deadline(command, 0)
        self.tries = timing.attempts_of(command)
        #: Time until each frame of a dialogue after its request, or after the one before it.
        self.step_times = tuple(timing.step(step) for step in steps)


def settled(outcome: Reply | LinkError | None) -> Reply:
    """Return the reply of a finished transaction, or raise its error."""
    if isinstance(outcome, LinkError):
        raise outcome
    if outcome is None:
        raise RuntimeError("no finished transaction")
    return outcome
