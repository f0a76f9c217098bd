"""Events of the line. Times are those passed to the engine."""

from __future__ import annotations

from typing import NamedTuple

from qlinkgen.link.codec import Encoder, Fault, Framed, Message, is_message
from qlinkgen.link.host_events import Filled, InStep, OutOfStep

#: Most events that an engine keeps, if the driver does not remove them.
EVENTS_KEPT = 4096


class Sent(NamedTuple):
    """A request was handed to the port."""

    at: float
    #: Address in the frame, None if the protocol has none.
    node: int | None
    request: Message
    #: 1 for the first try.
    attempt: int
    frame: bytes


class Answered(NamedTuple):
    """The answer to a request was received."""

    at: float
    node: int | None
    request: Message
    #: None for a packet of a host without a response.
    response: Message | None
    #: Number of transmissions of the request.
    attempts: int
    #: Seconds from the call to the answer.
    elapsed: float


class TimedOut(NamedTuple):
    """An attempt was not answered."""

    at: float
    node: int | None
    request: Message
    attempt: int


class Failed(NamedTuple):
    """A transaction ended without an answer."""

    at: float
    node: int | None
    request: Message
    error: Exception


class Refused(NamedTuple):
    """A request was not sent: the node is offline, and its next trial is not due."""

    at: float
    node: int | None
    request: Message


class OtherAnswer(NamedTuple):
    """A reply other than the response was received."""

    at: float
    node: int | None
    request: Message
    reply: Message
    #: refused: the call fails; again: the request is sent once more, if an attempt is left; pending: the
    #: answer follows later; done: it is the answer.
    means: str
    attempt: int


class Stray(NamedTuple):
    """A valid frame that does not answer the pending request."""

    at: float
    message: Framed
    #: It would have answered an earlier attempt or request.
    late: bool


class Damaged(NamedTuple):
    """An invalid frame."""

    at: float
    #: Node of the pending request, None without one.
    node: int | None
    fault: Fault


class EchoFound(NamedTuple):
    """The probe has determined whether the adapter echoes."""

    at: float
    echo: bool


class EchoBroken(NamedTuple):
    """An echo differs from the sent bytes: a part is missing, or another station was sending.

    Reported before the Answered or TimedOut of the attempt; `at` is the time of detection.
    """

    at: float
    node: int | None
    expected: bytes
    #: Empty if nothing was received.
    received: bytes


class HealthChanged(NamedTuple):
    """The health of a node has changed."""

    at: float
    node: int
    #: online, suspect or offline.
    state: str


class Frame(NamedTuple):
    """A frame that an engine has sent or received, or received bytes that are none."""

    at: float
    sent: bool
    #: The frame, or what was received in its place.
    data: bytes
    #: None for other bytes: a probe for an echo, and what `fault` is about.
    message: Message | None = None
    fault: Fault | None = None


def heard(event: Framed | Fault, at: float, codec: Encoder) -> Frame:
    """Return what was received, as a frame."""
    if is_message(event):
        return Frame(at, False, codec.encode(event), event)
    return Frame(at, False, event.raw, None, event)


#: The last three are events of host ports only.
Event = (
    Sent | Answered | OtherAnswer | TimedOut | Failed | Refused | Stray | Damaged | EchoFound | EchoBroken
    | HealthChanged | OutOfStep | Filled | InStep
)  # fmt: skip
