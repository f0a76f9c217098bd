"""Motions, each taken by its node exactly once and in order (section 7.10).

The counter of a motion lets the node distinguish a repeat from a new motion. A master that has just started
does not know the counter of the last motion of a node; if it sent words under the same number, the node would
take them for a repeat and drop them, and the outputs as well. So a motion without words is sent before the
first one to a node: whether or not the node takes it for a repeat, the next number is new.

Without an answer, the words may be queued or not. They stay `pending`, and are sent again under the same
number before any others, so that they are queued once in both cases. Clearing the FIFO and resetting the node
drop them, as the node does.

The document does not say whether a node answers a repeat. By default it does. With a node that stays silent
instead (`Repeats`), a motion whose answer was lost would never end: if the node answers another request after
all repeats stayed silent, it has taken the motion, and a motion without words brings the answer.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Literal, TypeAlias

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError, NoReply
from qlinkgen.link.procedure import FAILURES, Ask, Pause, Procedure, Tell
from qlinkgen.link.transaction import Reply
from qlinkgen.protocols.qlink.facts import MOTIONS, WORDS

#: Whether nodes answer a repeated motion; `auto` finds out for each node with its first motion.
Repeats: TypeAlias = Literal["answered", "silent", "auto"]
#: Motions without words sent for the answer of one whose repeats stay silent.
_ROUNDS = 3


@dataclass(slots=True)
class MotionState:
    """A master's state of the motions of one node.

    Attributes:
        counter: number of the next motion.
        known: the node cannot take that number for a repeat.
        pending: an unanswered motion.
        taken: the last motion that the node has taken.
        streaming: a stream uses the node exclusively.
        repeats: whether the node answers repeats.
    """

    counter: int = 0
    known: bool = False
    pending: qlink.MotionRequest | None = None
    taken: qlink.MotionRequest | None = None
    streaming: bool = False
    repeats: Repeats = "answered"

    @property
    def ready(self) -> bool:
        """Whether a motion can be sent directly, without a pending or an empty one first."""
        return self.known and self.pending is None and not self.streaming and self.repeats != "auto"

    def begin(self, request: qlink.MotionRequest) -> bool:
        """Start sending a motion; return whether it is new."""
        fresh = self.pending is None
        self.pending = request
        return fresh

    def settled(self, request: qlink.MotionRequest) -> None:
        """Record that the node has taken the motion."""
        self.pending = None
        self.taken = request
        self.counter = MOTIONS.after(request.counter)
        self.known = True

    def failed(self, error: Exception, *, fresh: bool) -> None:
        """Keep an unanswered motion pending, unless it was not sent."""
        unsent = isinstance(error, (TypeError, ValueError)) or (
            isinstance(error, LinkError) and not error.attempts
        )
        if fresh and unsent:
            self.pending = None
        elif self.pending is not None:
            words = len(self.pending.segments)
            error.add_note(
                f"motion {self.pending.counter} with {words} words is pending: it is sent again before the "
                "next motion to this node, unless clear_fifo or node_reset drops it"
            )

    def drop(self) -> None:
        """Drop the pending motion and its number, so that a late answer to it is not accepted."""
        if self.pending is not None:
            self.counter = MOTIONS.after(self.pending.counter)
            self.pending = None

    def forget(self) -> None:
        """Record a reset: the node takes the next motion with any number."""
        self.drop()
        self.known = True

    def unknown(self) -> None:
        """Record that another node may have this number now."""
        self.drop()
        self.known = False


def move(state: MotionState, request: qlink.MotionRequest) -> Procedure[Reply]:
    """Send a motion to a node; sets the counter of the request.

    Raises:
        RuntimeError: a stream uses the node.
        LinkError: no answer was received; the motion is pending.
    """
    if state.streaming:
        raise RuntimeError(f"node {request.node} is used by a stream; motions in between would mix the paths")
    return (yield from _move(state, request))


def _move(state: MotionState, request: qlink.MotionRequest) -> Procedure[Reply]:
    if state.pending is not None:
        yield from _settle(state, state.pending)
    if not state.known or state.repeats == "auto":
        yield from _settle(state, _empty(request))
    if state.repeats == "auto":
        yield from _find_out(state, request)
    request.counter = state.counter
    return (yield from _settle(state, request))


def _empty(request: qlink.MotionRequest) -> qlink.MotionRequest:
    """Return a motion without words and with the same outputs."""
    return qlink.MotionRequest(node=request.node, outputs=request.outputs)


def _find_out(state: MotionState, request: qlink.MotionRequest) -> Procedure[None]:
    """Repeat the motion that was answered last, which has no words."""
    repeat = _empty(request)
    repeat.counter = MOTIONS.before(state.counter)
    try:
        yield Ask(repeat)
    except NoReply as error:
        if not error.attempts:
            raise
        state.repeats = "silent"
    else:
        state.repeats = "answered"


def _settle(state: MotionState, request: qlink.MotionRequest) -> Procedure[Reply]:
    """Send a request until the node has taken it, or leave it pending."""
    fresh = state.begin(request)
    try:
        reply: Reply = yield Ask(request)
    except FAILURES as error:
        return (yield from unanswered(state, request, error, fresh=fresh))
    state.settled(request)
    return reply


def unanswered(
    state: MotionState, request: qlink.MotionRequest, error: Exception, *, fresh: bool
) -> Procedure[Reply]:
    """Find out whether a node that is silent on repeats has taken a motion that has failed.

    Args:
        state: state of the node.
        request: the motion.
        error: how it failed.
        fresh: it was not pending before.

    Returns the answer to a motion without words that was sent after it.

    Raises the error if the motion stays pending.
    """
    rounds = 0
    while (
        state.repeats == "silent"
        and isinstance(error, NoReply)
        and error.attempts > fresh
        and rounds < _ROUNDS
    ):
        rounds += 1
        if not (yield from _answers(request.node)):
            break
        state.settled(request)
        request = _empty(request)
        request.counter = state.counter
        fresh = state.begin(request)
        try:
            reply: Reply = yield Ask(request)
        except FAILURES as later:
            error = later
        else:
            state.settled(request)
            return reply
    state.failed(error, fresh=fresh)
    raise error


def _answers(node: int) -> Procedure[bool]:
    """Return whether a node answers a request that changes nothing."""
    try:
        yield Ask(qlink.MotorPositionRequest(node=node))
    except LinkError:
        return False
    return True


@dataclass(frozen=True, slots=True)
class MotionProgress:
    """Progress of the stream to one node.

    Attributes:
        node: the node.
        queued: number of acknowledged words.
        fifo_space: words that still fit.
        position: motor position, encoder counts.
        running: the motor runs.
        answer: the last response.
    """

    node: int
    queued: int
    fifo_space: int
    position: int
    running: bool
    answer: qlink.MotionResponse


@dataclass(slots=True)
class _Feed:
    """The words for one node."""

    node: int
    words: Iterator[int]
    outputs: int
    state: MotionState
    batch: list[int] = field(default_factory=list)
    space: int = 0
    queued: int = 0
    polled: bool = False
    exhausted: bool = False
    silent_since: float | None = None
    in_doubt: qlink.MotionRequest | None = None

    @property
    def done(self) -> bool:
        return self.exhausted and not self.batch and self.polled

    def fill(self) -> None:
        """Take as many words as fit into the node and into one motion."""
        missing = min(self.space, WORDS) - len(self.batch)
        if missing > 0 and not self.exhausted:
            self.batch.extend(islice(self.words, missing))
            self.exhausted = len(self.batch) < min(self.space, WORDS)

    def took(self, request: qlink.MotionRequest) -> int:
        """Record that the node has taken words; return their number."""
        taken = len(request.segments)
        self.queued += taken
        self.space -= taken
        del self.batch[:taken]
        return taken


def stream(
    states: Mapping[int, MotionState],
    words: Mapping[int, Iterable[int]],
    outputs: Mapping[int, int],
    *,
    patience: float,
    full_pause: float,
) -> Procedure[dict[int, int]]:
    """Send words to one or several nodes in turn, without overflow; reports MotionProgress.

    Args:
        states: state of each node.
        words: path words for each node, 0..65535; taken from the iterables as needed.
        outputs: outputs 1-8 of each node, sent with every motion.
        patience: seconds that a node may stay silent before the stream fails.
        full_pause: seconds to wait when no FIFO has room.

    Returns the words taken, by node.

    Raises:
        LinkError: a node has been silent for longer; its last words are pending.
    """
    for node in words:
        if states[node].streaming:
            raise RuntimeError(f"node {node} is already used by a stream")
    feeds = [_Feed(node, iter(each), outputs.get(node, 0), states[node]) for node, each in words.items()]
    try:
        for feed in feeds:
            feed.state.streaming = True
        while waiting := [feed for feed in feeds if not feed.done]:
            moved = False
            for feed in waiting:
                moved |= yield from _feed_once(feed, patience)
            if not moved:
                yield Pause(full_pause)
    finally:
        for feed in feeds:
            feed.state.streaming = False
    return {feed.node: feed.queued for feed in feeds}


def _feed_once(feed: _Feed, patience: float) -> Procedure[bool]:
    """Send one motion to one node; return whether it has taken words or has room."""
    if feed.in_doubt is not None and feed.in_doubt is not feed.state.pending:  # dropped by a clear
        del feed.batch[: len(feed.in_doubt.segments)]
        feed.in_doubt = None
    feed.fill()
    request = feed.in_doubt or qlink.MotionRequest(
        node=feed.node, outputs=feed.outputs, segments=feed.batch[: feed.space]
    )
    try:
        if feed.in_doubt is None:
            reply = yield from _move(feed.state, request)
        else:
            reply = yield from _settle(feed.state, request)
    except LinkError as error:
        feed.in_doubt = request if feed.state.pending is request else None
        if feed.state.taken is request:
            feed.took(request)
        yield from _bear(feed, error, patience)
        return False
    feed.in_doubt = None
    feed.silent_since = None
    taken = feed.took(request)
    answer: qlink.MotionResponse = reply.response
    found_room = answer.fifo_space > feed.space
    feed.space = answer.fifo_space
    feed.polled = True
    yield Tell(_progress(feed, answer))
    return bool(taken) or found_room


def _progress(feed: _Feed, answer: qlink.MotionResponse) -> MotionProgress:
    running = bool(answer.motor_status & qlink.MotorStatus.RUNNING)
    return MotionProgress(feed.node, feed.queued, answer.fifo_space, answer.position, running, answer)


def _bear(feed: _Feed, error: LinkError, patience: float) -> Procedure[None]:
    """Tolerate a silent node within the time limit: its words are kept, and the others continue."""
    now: float = yield Pause(0)
    if feed.silent_since is None:
        feed.silent_since = now - error.elapsed
    if now - feed.silent_since >= patience:
        raise error
