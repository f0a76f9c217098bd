"""Passive listener of a bus: requests, responses, repeats, late and damaged frames.

A frame need not state its direction. It is determined by these rules:

1. A frame that answers the previous request, in time, is its response.
2. Any other frame that can be a request is one. The same bytes again, unanswered, are a repeat.
3. A frame that can only be a response is a late response to the previous request, or a stray one.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from qlinkgen.link.asked import answer_to
from qlinkgen.link.codec import (
    Codec,
    Command,
    Fault,
    Framed,
    address_of,
    addresses_that_answer,
    answers,
    cut,
    is_message,
)
from qlinkgen.link.dialogue import Progress
from qlinkgen.link.events import Damaged, Stray
from qlinkgen.link.gaps import Gap
from qlinkgen.link.many import Answers, stops
from qlinkgen.link.timing import Timing
from qlinkgen.link.transaction import Accepts
from qlinkgen.link.turn import has_turns, steps_of


class Asked(NamedTuple):
    """The master has sent a request."""

    at: float
    request: Framed
    #: The previous request was the same and was not answered.
    repeat: bool
    frame: bytes


class Replied(NamedTuple):
    """A node has answered."""

    at: float
    request: Framed
    response: Framed
    #: Seconds from the end of the request to the end of the answer.
    delay: float
    #: It was received after the deadline.
    late: bool
    frame: bytes


class Unanswered(NamedTuple):
    """A request, or a later frame of a dialogue, was not answered in time."""

    at: float
    request: Framed


Heard = Asked | Replied | Unanswered | Stray | Damaged


class _Pending:
    """The last request, and its deadline."""

    __slots__ = (
        "answered", "answers", "asked", "at", "begun", "command", "deadline", "dialogue", "reported",
        "request", "sent", "sent_as",
    )  # fmt: skip

    def __init__(self, command: Command, request: Framed, at: float, deadline: float, *, alone: bool) -> None:
        self.command = command
        self.request = request
        #: The frame that may say the sizes of the response.
        self.asked = request
        self.at = at
        self.deadline = deadline
        self.answers = Answers(command.many, request, alone=alone) if command.many is not None else None
        self.answered = command.response is None
        #: The first of answers that another command ends was received.
        self.begun = False
        self.reported = self.answered
        #: The dialogue, None for a request and its response and after the end.
        self.dialogue = Progress(command) if steps_of(command) else None
        #: What the master has sent last, and the place of it in the dialogue.
        self.sent = request
        self.sent_as = -1

    def follows(self, request: Framed, now: float) -> bool:
        """Pass over a frame of the master in a dialogue; return whether it was due."""
        dialogue = self.dialogue
        if dialogue is None or address_of(request) != address_of(self.request):
            return False
        before = dialogue.at
        if not dialogue.take(request, sent=True):
            return False
        self.at, self.sent, self.sent_as = now, request, before
        if type(request) is self.command.sized_by:
            self.asked = request
        return True

    def due(self, response: Framed) -> bool:
        """Whether an answer is due in a dialogue before its response."""
        dialogue = self.dialogue
        if dialogue is None or not dialogue.receives or dialogue.is_last_answer:
            return False
        return type(response) is dialogue.due

    def early(self, response: Framed) -> bool:
        """Whether the response of a dialogue is not due yet."""
        dialogue = self.dialogue
        return (
            dialogue is not None and not dialogue.is_last_answer and type(response) is self.command.response
        )


class Monitor:
    """Decodes a stream with both directions of a bus.

    Bytes are processed one at a time, at about a microsecond each, so that requests and answers received in
    one chunk are separated.

    Attributes:
        heard: events, oldest first; the caller removes them.
        bytes: number of bytes processed.
    """

    def __init__(self, codec: Codec, timing: Timing, *, accepts: Mapping[str, Accepts] | None = None) -> None:
        """Listen to a protocol; `accepts` are the additional matching rules of a `MasterEngine`."""
        self.heard: deque[Heard] = deque()
        self.bytes = 0
        self._codec = codec
        self._timing = timing
        self._accepts = accepts or {}
        self._commands = {command.request: command for command in codec.COMMANDS.values()}
        self._requests = codec.StreamDecoder("request")
        self._responses = codec.StreamDecoder("response")
        #: Faults reported by one of the two decoders, by offset; it may be that of the wrong direction.
        self._suspected: dict[int, Fault] = {}
        #: The last request, and before it on a link that of the other side, which asks too.
        self._asking: list[_Pending] = []
        self._askers = 2 if codec.BUS.kind == "link" else 1
        #: Earlier requests whose answers have no end.
        self._streams: list[_Pending] = []
        self._stops = {command.name: stop for command, stop in stops(codec)}
        self._answer_to = answer_to(codec)
        self._turns = any(has_turns(command) for command in codec.COMMANDS.values())
        self._gap = Gap(timing.silence)

    @property
    def skipped(self) -> int:
        """Number of bytes outside frames and damaged frames."""
        skipped: int = min(self._requests.counters.skipped, self._responses.counters.skipped)
        return skipped

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes received from the line."""
        self.handle_timer(now)
        self.bytes += len(data)
        for byte in data:
            piece = bytes((byte,))
            if self._turns and (pending := self._in_turn(now)) is not None:
                self._collect(pending, piece, now)
                continue
            asking = self._requests.feed(piece)
            answering = self._responses.feed(piece)
            if asking or answering:
                self._sort(asking, answering, now)
        self._gap.heard(now)

    def _in_turn(self, now: float) -> _Pending | None:
        """The request in whose dialogue a frame is due that only its turn tells, None without one."""
        for each in self._asking:
            if each.dialogue is not None and each.dialogue.is_turned and now <= each.deadline:
                return each
        return None

    def _collect(self, pending: _Pending, byte: bytes, now: float) -> None:
        """Pass a byte to the message that is due."""
        dialogue = pending.dialogue
        assert dialogue is not None
        event = dialogue.collect(byte, pending.asked, self._codec.DecodeError)
        if event is None:
            return
        if not is_message(event):
            pending.dialogue = None
            self.heard.append(Damaged(now, address_of(pending.request), event))
        elif dialogue.sends:
            self._message(event, None, now)
        else:
            self._message(None, event, now)

    def finish(self, now: float) -> None:
        """End the stream."""
        self._sort(self._requests.finish(), self._responses.finish(), now)
        self._gap.due = None
        for pending in self._waiting:
            pending.reported = pending.reported or pending.begun  # answers without an end may go on
            pending.deadline = min(pending.deadline, now)
        self.handle_timer(now)

    def next_timer(self) -> float | None:
        """Return the deadline of the pending request, or the end of a silence; None without either."""
        return self._gap.before(
            min((each.deadline for each in self._waiting if not each.reported), default=None)
        )

    @property
    def _waiting(self) -> list[_Pending]:
        """All requests that may be answered, the last one first."""
        return [*self._asking, *self._streams] if self._streams else self._asking

    def handle_timer(self, now: float) -> None:
        """End a frame after a silence that alone does; report a request that was not answered in time."""
        if self._gap.passed(now):
            self._sort(self._requests.finish(), self._responses.finish(), now)
        for pending in reversed(self._waiting):
            if not pending.reported and now >= pending.deadline:
                pending.reported = True
                answers = pending.answers
                if answers is None or not (answers.timed and answers.items):  # otherwise that was their end
                    self.heard.append(Unanswered(now, pending.sent))
        if self._streams:
            self._streams = [each for each in self._streams if not each.reported]

    def _sort(
        self, asking: Sequence[Framed | Fault], answering: Sequence[Framed | Fault], now: float
    ) -> None:
        for fault in (*asking, *answering):
            if is_message(fault):
                continue
            if self._suspected.pop(fault.offset, None) is None:
                self._suspected[fault.offset] = fault
            else:
                self.heard.append(Damaged(now, self._node_asked(now), fault))
        for request, response in _same_frames(asking, answering):
            if request is not None or response is not None:
                self._suspected.clear()  # reported by the decoder of the wrong direction
                self._message(request, response, now)

    def _node_asked(self, now: float) -> int | None:
        waiting = (each for each in self._waiting if not each.answered and now < each.deadline)
        pending = next(waiting, None)
        return None if pending is None else address_of(pending.request)

    def _message(self, request: Framed | None, response: Framed | None, now: float) -> None:
        # Both events are of the same frame, decoded or refused in each direction.
        if response is not None:
            fitting = [pair for each in self._waiting if (pair := self._answer(each, response))]
            for pending, answer in fitting:
                if not pending.answered and now < pending.deadline:
                    self._replied(pending, answer, now, late=False)
                    return
            if fitting and request is None:
                self._replied(*fitting[0], now, late=True)
                return
        if request is not None:
            self._asked(request, now)
        elif response is not None:
            self.heard.append(Stray(now, response, late=False))

    def _answer(self, pending: _Pending, response: Framed) -> tuple[_Pending, Framed] | None:
        """The answer to a request in a frame, None if it answers something else."""
        if self._answer_to is not None:
            with contextlib.suppress(self._codec.DecodeError):
                response = self._answer_to(pending.request, response)
        return (pending, response) if self._fits(pending, response) else None

    def _fits(self, pending: _Pending, response: Framed) -> bool:
        if pending.due(response):
            return address_of(response) == address_of(pending.request)
        if pending.early(response) or not answers(pending.command, pending.request, pending.asked, response):
            return False
        several = pending.answers if type(response) is pending.command.response else None
        if several is not None and not several.expects(response):
            return False
        accepts = self._accepts.get(pending.command.name)
        if accepts and type(response) is pending.command.response:
            return accepts(pending.request, response)
        asked, address = (
            addresses_that_answer(pending.command, pending.request, self._codec.BUS),
            address_of(response),
        )
        return address in asked or (address is None and len(asked) > 0)

    def _replied(self, pending: _Pending, response: Framed, now: float, *, late: bool) -> None:
        if pending.answered:
            self.heard.append(Stray(now, response, late=True))
            return
        reply = pending.command.replies.get(type(response))
        if reply is None or reply.meaning(response) == "done":
            self._stop(pending.request)
        deadline = self._further_deadline(pending, response, now)
        if deadline is not None:
            pending.deadline = max(pending.deadline, deadline)
        else:
            pending.answered = pending.reported = True
        delay = now - pending.at
        frame = self._codec.encode(response)
        cut(pending.command, pending.asked, response)
        self.heard.append(Replied(now, pending.sent, response, delay, late, frame))

    def _further_deadline(self, pending: _Pending, response: Framed, now: float) -> float | None:
        """Return the time until which another answer may follow this one, None if it is the last."""
        reply, answers = pending.command.replies.get(type(response)), pending.answers
        if pending.dialogue is not None:
            return self._further_in_dialogue(pending, pending.dialogue, response, now)
        if reply is not None and reply.meaning(response) == "pending":
            return now + self._timing.patience(pending.command, reply)
        if pending.command.name in self._stops and type(response) is pending.command.response:
            pending.begun = reply is None or reply.meaning(response) == "done"
            return now + self._timing.further(pending.command) if pending.begun else None
        if answers is None or type(response) is not pending.command.response or answers.take(response):
            return None
        fixed = answers.timed or answers.nodes is not None
        return pending.deadline if fixed else now + self._timing.deadline(pending.command, 0)

    def _further_in_dialogue(
        self, pending: _Pending, dialogue: Progress, response: Framed, now: float
    ) -> float | None:
        reply = pending.command.replies.get(type(response))
        if dialogue.take(response, sent=False):
            if not dialogue.ended:
                return self._awaited(pending, dialogue, now)
        elif reply is not None and reply.meaning(response) == "pending":
            return now + self._timing.patience(pending.command, reply)
        elif reply is not None and reply.meaning(response) == "again" and pending.sent_as >= 0:
            dialogue.at = pending.sent_as
            return self._awaited(pending, dialogue, now)
        pending.dialogue = None
        return None

    def _awaited(self, pending: _Pending, dialogue: Progress, now: float) -> float:
        """Return the time until which an answer is due in a dialogue; nothing is late if the master is."""
        pending.reported = dialogue.sends
        step = steps_of(pending.command)[dialogue.at]
        return now + self._timing.step(step)

    def _asked(self, request: Framed, now: float) -> None:
        command = self._commands.get(type(request))
        if command is None and self._continued(request, now):
            return
        if command is None:  # a message outside commands: sent by any node, without a response
            self.heard.append(Stray(now, request, late=False))
            return
        before = self._replaced(request, now)
        repeat = before is not None and not before.answered and before.request == request
        unanswerable = not addresses_that_answer(command, request, self._codec.BUS)
        to_all = address_of(request) == self._codec.BUS.broadcast
        alone = command.addressing == "answered_broadcast" and not to_all
        deadline = now + self._timing.deadline(command, 0)
        pending = _Pending(command, request, now, deadline, alone=alone)
        self._asking.insert(0, pending)
        if pending.answers is not None:
            if command.many is not None and pending.answers.timed:
                pending.deadline += self._timing.duration(command.many)
            pending.deadline += pending.answers.further * self._timing.deadline(command, 0)
        pending.answered = pending.reported = unanswerable
        if unanswerable:
            self._stop(request)
            pending.dialogue = None
        if pending.dialogue is not None:
            pending.reported = pending.dialogue.sends
        self.heard.append(Asked(now, request, repeat, self._codec.encode(request)))

    def _replaced(self, request: Framed, now: float) -> _Pending | None:
        """Remove the request before another one, and return it; None if it stays."""
        before = next((each for each in self._asking if each.request == request), None)
        if before is None and len(self._asking) == self._askers:
            before = self._asking[-1]
        if before is None:
            return None
        self._asking.remove(before)
        if before.begun and not before.answered and before.request != request:
            self._streams.append(before)
        elif not before.reported:  # the master did not wait for the deadline
            self.heard.append(Unanswered(now, before.sent))
        return before

    def _stop(self, request: Framed) -> None:
        """End the answers that a request has stopped."""
        for each in self._waiting if self._stops else ():
            stop = self._stops.get(each.command.name)
            if stop is not None and stop.by(request, each.request):
                each.answered = each.reported = True
        self._streams = [each for each in self._streams if not each.answered]

    def _continued(self, request: Framed, now: float) -> bool:
        """Note a later frame of a dialogue; return whether it is one."""
        pending = next((each for each in self._asking if each.follows(request, now)), None)
        if pending is None:
            return False
        dialogue = pending.dialogue
        assert dialogue is not None
        if dialogue.ended:
            pending.answered = pending.reported = True
        else:
            pending.deadline = self._awaited(pending, dialogue, now)
        self.heard.append(Asked(now, request, repeat=False, frame=self._codec.encode(request)))
        return True


def _same_frames(
    asking: Sequence[Framed | Fault], answering: Sequence[Framed | Fault]
) -> Iterator[tuple[Framed | None, Framed | None]]:
    """Pair the events of two decoders for the same frames; a byte may complete several."""
    if len(asking) == len(answering):  # both have decoded or refused the same frames
        yield from zip(map(_message_of, asking), map(_message_of, answering), strict=True)
        return
    responses = list(filter(is_message, answering))
    frames = [response.to_frame() for response in responses]
    for request in filter(is_message, asking):
        frame = request.to_frame()
        same = frames.index(frame) if frame in frames else None
        yield request, None if same is None else responses.pop(same)
        if same is not None:
            del frames[same]
    yield from ((None, response) for response in responses)


def _message_of(event: Framed | Fault) -> Framed | None:
    """Return a decoder's event if it is a message, None for a fault."""
    return event if is_message(event) else None
