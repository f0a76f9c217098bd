"""Procedures with timing: syncs at an interval, and polling of motor requests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from qlinkgen.codecs import qlink
from qlinkgen.errors import NoReply
from qlinkgen.link.procedure import Ask, Pause, Procedure, Tell
from qlinkgen.link.transaction import Reply
from qlinkgen.protocols.qlink.facts import BROADCAST, SYNCS


@dataclass(slots=True)
class SyncState:
    """The number of the next sync."""

    counter: int = 0


@dataclass(frozen=True, slots=True)
class SyncTick:
    """A sync was sent.

    Attributes:
        counter: its number.
        at: time on the port's clock, in seconds.
        late: seconds after its due time.
    """

    counter: int
    at: float
    late: float


@dataclass(frozen=True, slots=True)
class SyncReport:
    """Timing of the syncs.

    Attributes:
        sent: number of syncs.
        interval: requested interval in seconds.
        mean: mean interval in seconds.
        jitter: largest deviation of an interval from the requested one, in seconds.
        missed: intervals without a sync, since the bus or the computer was busy.
    """

    sent: int
    interval: float
    mean: float
    jitter: float
    missed: int


def sync(
    state: SyncState, interval: float, *, count: int | None, stop: Callable[[], bool]
) -> Procedure[SyncReport]:
    """Send node_sync at an interval, until `count` are sent or `stop()` is true; reports SyncTick.

    Due times are relative to the first sync, so that errors do not accumulate.
    """
    if interval <= 0:
        raise ValueError(f"interval must be more than 0 s, not {interval}")
    first: float | None = None
    last, sent, slot, jitter, missed = 0.0, 0, 0, 0.0, 0
    while (count is None or sent < count) and not stop():
        reply: Reply = yield Ask(qlink.NodeSyncRequest(node=BROADCAST, counter=state.counter))
        now = reply.at
        tick = SyncTick(state.counter, now, 0.0 if first is None else now - first - slot * interval)
        state.counter = SYNCS.after(state.counter)
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
    """Send a motor request, and poll for its result (sections 7.8, 7.9).

    Raises:
        NoReply: the motor has not completed it within `timeout` seconds, or the node does not answer. A
            request whose answer was lost is not repeated, since it may be executing.
    """
    if poll_interval < 0 or timeout < 0:
        raise ValueError(f"poll_interval {poll_interval} and timeout {timeout} must be 0 s or more")
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
