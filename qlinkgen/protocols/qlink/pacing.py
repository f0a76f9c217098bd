"""What goes on in time: syncs at an interval, and motor requests that take a while."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from qlinkgen.codecs import qlink
from qlinkgen.errors import NoReply
from qlinkgen.link.procedure import Ask, Pause, Procedure, Tell
from qlinkgen.link.transaction import Reply
from qlinkgen.protocols.qlink.facts import BROADCAST


@dataclass(slots=True)
class SyncState:
    """The number of the next sync, 0..255."""

    counter: int = 0


@dataclass(frozen=True, slots=True)
class SyncTick:
    """A sync was sent.

    Attributes:
        counter: its number, 0..255.
        at: when, on the port's clock, seconds.
        late: seconds after the time at which it was due.
    """

    counter: int
    at: float
    late: float


@dataclass(frozen=True, slots=True)
class SyncReport:
    """How steady the syncs were.

    Attributes:
        sent: number of syncs.
        interval: seconds that were asked for between two of them.
        mean: seconds that were between two of them.
        jitter: most seconds that one interval differed from what was asked for.
        missed: intervals that passed without a sync, since the bus or the computer was busy.
    """

    sent: int
    interval: float
    mean: float
    jitter: float
    missed: int


def sync(
    state: SyncState, interval: float, *, count: int | None, stop: Callable[[], bool]
) -> Procedure[SyncReport]:
    """Send node_sync at an interval, until `count` are sent or `stop()` is true; tells SyncTick.

    The times are counted from the first one, so that an error of one does not move the others.
    """
    if interval <= 0:
        raise ValueError(f"interval: {interval} s was given; it has to be more than 0")
    first: float | None = None
    last, sent, slot, jitter, missed = 0.0, 0, 0, 0.0, 0
    while (count is None or sent < count) and not stop():
        reply: Reply = yield Ask(qlink.NodeSyncRequest(node=BROADCAST, counter=state.counter))
        now = reply.at
        tick = SyncTick(state.counter, now, 0.0 if first is None else now - first - slot * interval)
        state.counter = (state.counter + 1) & 0xFF
        if first is None:
            first = now
        else:
            jitter = max(jitter, abs(now - last - interval))
        last = now
        sent += 1
        yield Tell(tick)
        passed = int((now - first) / interval)
        missed += max(0, passed - slot)
        slot = max(slot, passed) + 1
        here = yield Pause(0)
        yield Pause(max(0.0, first + slot * interval - here))
    span = last - (first or 0.0)
    return SyncReport(sent, interval, span / (sent - 1) if sent > 1 else 0.0, jitter, missed)


def complete(
    request: qlink.MotorRequestRequest, *, poll_interval: float, timeout: float
) -> Procedure[qlink.MotorResponsePollResponse]:
    """Send a motor request, and ask for its result until it is there (sections 7.8, 7.9).

    Raises:
        NoReply: the motor has not completed it within `timeout` seconds, or the node does not answer. A
            request whose answer was lost is not repeated: it may be under way.
    """
    if poll_interval < 0 or timeout < 0:
        raise ValueError(f"poll_interval {poll_interval} s, timeout {timeout} s: a time is not negative")
    sent: Reply = yield Ask(request)
    poll = qlink.MotorResponsePollRequest(node=request.node)
    while True:
        reply: Reply = yield Ask(poll)
        answer: qlink.MotorResponsePollResponse = reply.response
        if answer.last_completion:
            return answer
        if reply.at - sent.at >= timeout:
            raise NoReply(
                f"motor_request to node {request.node}: not completed after {reply.at - sent.at:.2f} s",
                node=request.node,
                attempts=sent.attempts,
                elapsed=reply.at - sent.at,
            )
        yield Pause(poll_interval)
