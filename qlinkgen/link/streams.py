"""Answers without an end, as a master receives them: they come until another command stops them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from qlinkgen.errors import LinkError, NoReply, Refused
from qlinkgen.link.codec import Codec, Framed, cut, reason_of
from qlinkgen.link.gaps import Gap
from qlinkgen.link.many import stops
from qlinkgen.link.pending import Pending
from qlinkgen.link.timing import Timing


class Stream:
    """The answers to a request, until another command stops them.

    Attributes:
        request: the request.
        stop: the request that stops them.
        answers: those that were received and are not taken yet, oldest first.
        deadline: time at which the next one must have been received.
        ended: no more come: they were stopped, a reply ended them, or they failed.
        error: why they failed, None if they did not.
    """

    __slots__ = ("_gap", "answers", "deadline", "ended", "error", "pending", "request", "stop")

    def __init__(self, pending: Pending, stop: Framed, deadline: float, gap: Gap) -> None:
        self.pending = pending
        self.request = pending.request
        self.stop = stop
        self.answers = deque[Any]()  # messages of the response class
        self.deadline = deadline
        self.ended = False
        self.error: LinkError | None = None
        self._gap = gap

    def next_timer(self) -> float:
        """Return the time at which the engine must handle its timers, if nothing is received until then."""
        due = self._gap.before(self.deadline)
        return self.deadline if due is None else due


class Streams:
    """The streams of a master that have not ended."""

    def __init__(self, codec: Codec, timing: Timing, gap: Gap) -> None:
        self._timing = timing
        self._gap = gap
        self._encode = codec.encode
        self._open: list[Stream] = []
        #: How each request with such answers is stopped.
        self._stops = {command.request: stop for command, stop in stops(codec)}

    def __bool__(self) -> bool:
        """Whether there is one."""
        return bool(self._open)

    def is_one(self, pending: Pending) -> bool:
        """Whether the answers to a request have no end."""
        return type(pending.request) in self._stops

    def begin(self, pending: Pending, first: Framed | None, now: float) -> Stream:
        """Begin a stream with its first answer; without one it has ended already."""
        stop = self._stops[type(pending.request)]
        for each in [each for each in self._open if each.request == pending.request]:  # begun once more
            self._end(each)
        stream = Stream(pending, stop.of(pending.request), now + self._next(pending), self._gap)
        if first is None:
            stream.ended = True
        else:
            stream.answers.append(first)
            self._open.append(stream)
        return stream

    def asked_of(self, from_asked: Callable[[Pending], bool]) -> Iterator[Framed]:
        """The requests of those streams to which a message may belong."""
        return (each.request for each in self._open if from_asked(each.pending))

    def take(self, message: Framed, node: int | None, now: float) -> Stream | None:
        """Add a message to the stream that it belongs to; return that, None if there is none."""
        return next((each for each in self._open if self._belongs(each, message, node, now)), None)

    def expire(self, now: float) -> list[Stream]:
        """End the streams that are silent for too long; return them."""
        late = [each for each in self._open if now >= each.deadline]
        for stream in late:
            pending = stream.pending
            node = "" if pending.node is None else f" of node {pending.node}"
            stream.error = NoReply(
                f"{pending.request.NAME}: no further answer{node}", node=pending.node, attempts=1
            )
            self._end(stream)
        return late

    def stop(self, stop: Framed) -> bool:
        """End the streams that a request has stopped; return whether there were any."""
        found = [each for each in self._open if self._stops[type(each.request)].by(stop, each.request)]
        for stream in found:
            self._end(stream)
        return bool(found)

    def _end(self, stream: Stream) -> None:
        stream.ended = True
        self._open.remove(stream)

    def _next(self, pending: Pending) -> float:
        return self._timing.further(pending.command.definition)

    def _belongs(self, stream: Stream, message: Framed, node: int | None, now: float) -> bool:
        pending = stream.pending
        command, reply = pending.command, pending.replied_by(message, node)
        means = "done" if reply is None else reply.meaning(message)
        if type(message) is command.response and means == "done":
            if not pending.answered_by(message, node):
                return False
            cut(command.definition, pending.asked, message)
            stream.answers.append(message)
            stream.deadline = now + self._next(pending)
            pending.count.answers += 1
            return True
        if reply is None:
            return False
        if means == "pending":
            patience = self._timing.patience(command.definition, reply)
            stream.deadline = max(stream.deadline, now + patience)
            return True
        if means != "done":
            reason = reason_of(reply, command.definition, message)
            stream.error = Refused(
                f"{pending.request.NAME}: ended: {reason}",
                reason=reason,
                reply=message,
                request=pending.request,
                node=pending.node,
                attempts=1,
                received=self._encode(message)[-64:],
            )
        self._end(stream)
        return True
