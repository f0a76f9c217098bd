"""What happened on the line, as data. Times are those that the engine was given."""

from __future__ import annotations

from typing import NamedTuple

from qlinkgen.link.codec import Fault, Framed, Message
from qlinkgen.link.host_events import Filled, InStep, OutOfStep

#: Events that an engine keeps for one who does not fetch them after each transaction.
EVENTS_KEPT = 4096


class Sent(NamedTuple):
    """A request was handed to the port."""

    at: float
    #: Address in the frame, None where the protocol has none.
    node: int | None
    request: Message
    #: 1 for the first try.
    attempt: int
    frame: bytes


class Answered(NamedTuple):
    """The answer to a request has come."""

    at: float
    node: int | None
    request: Message
    #: None where only a host waits that none is sent.
    response: Message | None
    #: How often the request had been sent.
    attempts: int
    #: Seconds from the call to the answer.
    elapsed: float


class TimedOut(NamedTuple):
    """No answer to one attempt."""

    at: float
    node: int | None
    request: Message
    attempt: int


class Failed(NamedTuple):
    """A transaction is over without an answer."""

    at: float
    node: int | None
    request: Message
    error: Exception


class Refused(NamedTuple):
    """A request was not sent: the node is offline, and its next trial is not due."""

    at: float
    node: int | None
    request: Message


class Stray(NamedTuple):
    """A good frame that answers nothing that is asked at this moment."""

    at: float
    message: Framed
    #: It would have answered an earlier attempt or request.
    late: bool


class Damaged(NamedTuple):
    """Bytes that look like a frame and are none."""

    at: float
    #: Node that was being asked, None where none was.
    node: int | None
    fault: Fault


class EchoFound(NamedTuple):
    """The adapter was found to send back, or not, what it is given to send."""

    at: float
    echo: bool


class EchoBroken(NamedTuple):
    """What came back is not what was sent: a part is missing, or others were sending.

    It is told before the Answered or TimedOut of the attempt; `at` is when it was noticed.
    """

    at: float
    node: int | None
    expected: bytes
    #: Empty where nothing came back.
    received: bytes


class HealthChanged(NamedTuple):
    """A node's health is another one."""

    at: float
    node: int
    #: online, suspect or offline.
    state: str


#: The last three are told of host ports alone.
Event = (
    Sent | Answered | TimedOut | Failed | Refused | Stray | Damaged | EchoFound | EchoBroken | HealthChanged
    | OutOfStep | Filled | InStep
)  # fmt: skip
