"""The master of a bus: one transaction at a time, with repeats, deadlines and quiet times.

The engine does no input or output and has no clock. A driver calls it with `now` from its own clock::

    engine.start(request, now)
    while engine.busy:
        port.write(engine.bytes_to_send(now))
        ... wait for bytes, at most until engine.next_timer() ...
        engine.receive(data, now)
        engine.handle_timer(now)
    reply = engine.take()

Its states are in `qlinkgen.link.master_states`, as the table that is executed. Parts with a state of their
own: the attempts (`attempts`), the wait for a quiet line (`quiet`), the echo and the probe for it (`echo`),
and the health of the nodes (`health`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence

from qlinkgen.errors import BadReply, Collision, LinkError, NoReply
from qlinkgen.errors import Refused as RequestRefused
from qlinkgen.link.asked import AskedDecoder, NotAnAnswer, answer_to
from qlinkgen.link.attempts import Attempts
from qlinkgen.link.codec import (
    Codec,
    Decoder,
    Fault,
    Framed,
    Many,
    OtherReply,
    address_getter,
    cut,
    is_message,
    missized,
    reason_of,
    wrong_size,
)
from qlinkgen.link.counters import LinkCounters
from qlinkgen.link.dialogue import Conversation, Dialogue, Further
from qlinkgen.link.echo import PROBE, EchoCanceller, EchoMode, EchoProbe
from qlinkgen.link.events import (
    EVENTS_KEPT,
    Answered,
    Damaged,
    EchoBroken,
    EchoFound,
    Event,
    Failed,
    Frame,
    HealthChanged,
    OtherAnswer,
    Refused,
    Sent,
    Stray,
    TimedOut,
    heard,
)
from qlinkgen.link.gaps import Gap
from qlinkgen.link.health import HealthBook, HealthPolicy
from qlinkgen.link.many import Answers
from qlinkgen.link.master_states import MASTER_MOVES, MasterEvent, MasterState
from qlinkgen.link.numbering import MasterNumber, numbering_of
from qlinkgen.link.pending import Pending
from qlinkgen.link.quiet import QuietLine
from qlinkgen.link.state import Moves
from qlinkgen.link.streams import Streams
from qlinkgen.link.timing import Timing, check_attempts
from qlinkgen.link.transaction import Accepts, CommandTiming, Packet, Question, Reply, settled

#: On a paced line, a frame complete before the request was transmitted is not its answer. The factor allows
#: for a difference between the clocks of both sides.
EARLY = 0.9

IDLE, PROBING, WAITING, TURN = (
    MasterState.IDLE, MasterState.PROBING, MasterState.WAITING, MasterState.TURN,
)  # fmt: skip

(
    _START, _START_PROBE, _PROBED, _SENT, _UNANSWERED, _ANSWERED, _AGAIN, _MORE, _NEXT, _PENDING, _REPEAT,
    _FAIL, _ABORT,
) = (Moves(MASTER_MOVES, event) for event in MasterEvent)  # fmt: skip

#: Why a request failed whose answer was not a frame, and what usually causes it.
NO_FRAME = (
    "bytes were received that form no frame; two nodes may have answered at once, or speed, parity or wiring "
    "are wrong"
)


class MasterEngine:
    """The master of one bus.

    Attributes:
        codec: the generated module of the protocol.
        timing: all deadlines.
        events: events, oldest first; the driver removes them.
        verbose: also report each request and answer, not only irregularities. Each event costs half a
            microsecond.
        counters: counts for each node, and under None those without a node.
        health: state of each node.
        numbering: the counter of its frames, None without one.
        own: its number, where frames have a destination and a source.
        frames: each frame, oldest first, which the driver removes; None, unless somebody is told.
        streams: answers that come until another command stops them.
        break_time: seconds of the break that a driver sends before each frame, 0 for none.
    """

    def __init__(
        self,
        codec: Codec,
        timing: Timing,
        *,
        echo: EchoMode = "none",
        health: HealthPolicy | None = None,
        accepts: Mapping[str, Accepts] | None = None,
        decoder: Decoder | None = None,
        number: int | None = None,
    ) -> None:
        """Make the master of a bus; a `PeerEngine` gives it a decoder.

        Its ``number`` is that of its requests where frames have a destination and a source, by default that
        which the caller gives them.
        """
        hooks = accepts or {}
        self.codec = codec
        self.timing = timing
        self.events: deque[Event] = deque(maxlen=EVENTS_KEPT)
        self.verbose = True
        self.frames: deque[Frame] | None = None
        self.counters: dict[int | None, LinkCounters] = {None: LinkCounters()}
        self._broadcast = codec.BUS.broadcast
        self.health = HealthBook(health, untracked=(None, self._broadcast))
        self._commands = {
            command.request: CommandTiming(command, timing, hooks.get(name))
            for name, command in codec.COMMANDS.items()
        }
        answers, self._decoder = answer_to(codec), decoder or codec.StreamDecoder("response")
        if answers is not None:
            self._decoder = AskedDecoder(codec, self._decoder, answers, self._asked)
        self._address = address_getter(codec)
        self.numbering = numbering_of(codec)
        self.own = MasterNumber(codec, number)
        self._byte_time = timing.byte_time
        self._paced = timing.paced
        #: Its next frame waits; a silence that alone ends frames is over when one is received.
        self._keeps_idle = timing.paced and timing.idle > 0 and not timing.silence
        self._echo = EchoCanceller(echo)
        self._probe = EchoProbe()
        self._broken_echo = EchoBroken(0.0, None, b"", b"")
        self._line = QuietLine(timing.quiet, timing.quiet_limit)
        self._gap = Gap(timing.silence)
        self.break_time = timing.line_break
        self.streams = Streams(codec, timing, self._gap)
        self._attempts = Attempts()
        self._state = MasterState.IDLE
        self._outcome: Reply | LinkError | None = None
        self._pending: Pending  #: set by `start`
        #: The previous request, whose answer may still arrive.
        self._earlier: Pending | None = None
        self._wanted: int | None = None  #: attempts, as given by the caller
        #: A missing answer is not a failure of the node.
        self._trial = False
        self._earliest = 0.0
        self._deadline = 0.0
        self._received = b""
        #: Answers to a request that has several, None to others.
        self._answers: Answers | None = None
        #: The dialogue, None for a request and its response.
        self._dialogue: Conversation | None = None

    # What a driver calls ------------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """A transaction is in progress."""
        return self._state is not IDLE

    @property
    def echoes(self) -> bool:
        """Whether sent bytes are received too, as far as known."""
        return self._echo.mode == "expect"

    @property
    def line(self) -> QuietLine:
        """What it knows about the line."""
        return self._line

    @property
    def total(self) -> LinkCounters:
        """Counts of the whole bus."""
        whole = LinkCounters.total(self.counters.values())
        whole.skipped = self._decoder.counters.skipped
        return whole

    def start(
        self, request: Question, now: float, *, attempts: int | None = None, trial: bool = False
    ) -> None:
        """Begin a transaction.

        Args:
            request: message of the generated module, or a `Dialogue` for a command with steps.
            now: time.
            attempts: largest number of transmissions; by default that of the timing. A request that is unsafe
                to repeat is sent once in any case.
            trial: ask an offline node before its next trial is due; a missing answer does not count as a
                failure of the node.

        Raises:
            EncodeError: of the generated module; a value cannot be sent.
            TypeError: the message is not a request of this protocol, or not that of a step.
            ValueError: attempts is less than 1; a dialogue has other frames or goes to several nodes.
            NoReply: the node is offline, and its next trial is not due yet; nothing was sent.
            RuntimeError: another transaction is pending.
        """
        if self._state is not IDLE:
            raise RuntimeError("another transaction is pending; a bus performs one at a time")
        further: Sequence[Further] = ()
        if isinstance(request, Dialogue):
            request, further = request
        if type(request) is Packet or (command := self._commands.get(type(request))) is None:
            raise TypeError(f"{type(request).__name__} is not a request of this protocol")
        tries = command.tries if attempts is None else self._tries_of(command, attempts)
        self._fill(request)
        frame = self.codec.encode(request)
        node = self._address(request)
        dialogue = self._begun(command, request, further, node) if command.step_times or further else None
        if self._attempts.number:
            self._earlier = self._pending
        count = self.counters.get(node)
        if count is None:
            count = self.counters[node] = LinkCounters()
        to_all = node is not None and node == self._broadcast
        self._pending = Pending(request, command, node, frame, count, to_all)
        self._attempts.begin(tries, now)
        self._trial = trial
        self._wanted = attempts
        if self.health and not trial and command.response is not None:  # otherwise it does not wait
            self._look_at_health(now)
        self._received = b""
        self._outcome = None
        self._answers = None
        self._dialogue = dialogue
        self._await_quiet(now)
        if self._echo.mode == "auto":
            self._probe.until = 0.0
            self._state = _START_PROBE[IDLE]
        else:
            self._state = _START[IDLE]

    def _fill(self, message: Framed) -> None:
        """Give a message of this master its number and that of the master."""
        if self.numbering is not None:
            self.numbering.number(message)
        self.own.put(message)

    def _await_quiet(self, now: float) -> None:
        """Begin a wait for a quiet line; answers without an end leave no silence to wait for."""
        if self.streams:
            self._line.suspect = False
        elif self._line.suspect:
            self._line.await_quiet(now)

    def _begun(
        self, command: CommandTiming, request: Framed, further: Sequence[Further], node: int | None
    ) -> Conversation:
        """Return the dialogue of a request, after a check of all messages that are known yet."""
        dialogue = Conversation(command.definition, request, further)
        for each in further:
            if not callable(each):
                self.codec.encode(each)
                if self._address(each) != node:
                    raise ValueError(f"{each.NAME} is for another node than {request.NAME}")
        return dialogue

    def _tries_of(self, command: CommandTiming, attempts: int) -> int:
        check_attempts(attempts)
        return self.timing.attempts_of(command.definition, attempts)

    def bytes_to_send(self, now: float) -> bytes:
        """Return the bytes that the driver has to write now."""
        state = self._state
        if state is WAITING or state is IDLE or not self._line.ready(now):
            return b""
        if state is PROBING:
            return self._send_probe(now)
        return self._send_next(now) if state is TURN else self._send(now)

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes."""
        if self._line.suspect:
            self._line.disturbed(now)
        if self._state is PROBING and self._probe.until and self._probe.echoed(data):
            self._probed(found=True, now=now)
            data = data.replace(PROBE, b"", 1)
        if self._echo.active:
            data = self._without_echo(data, now)
            if not data:
                return
        if self._gap.passed(now):
            self._end_frame(now)
        self._received = data
        if self._dialogue is not None and self._dialogue.has_turns:
            for byte in data:
                self._take_byte(bytes((byte,)), self._dialogue, now)
        else:
            for event in self._decoder.feed(data):
                self._take_in(event, now)
        self._gap.heard(now)

    def _take_byte(self, byte: bytes, dialogue: Conversation, now: float) -> None:
        """Pass a byte to the message that is due if only its turn tells that, otherwise to the decoder."""
        if self._state is WAITING and dialogue.receives and dialogue.is_turned:
            event = dialogue.collect(byte, self._pending.asked, self.codec.DecodeError)
            if event is not None:
                self._take_in(event, now)
            return
        for found in self._decoder.feed(byte):
            self._take_in(found, now)

    def _end_frame(self, now: float) -> None:
        """The line was idle, or a request follows: bytes inside a damaged frame may be a message."""
        for event in self._decoder.finish():
            self._take_in(event, now)

    def next_timer(self) -> float | None:
        """Return the time of the next call without received bytes; None if none is needed."""
        state = self._state
        if state is WAITING:
            return self._gap.before(self._deadline)
        if state is IDLE:
            return None
        if state is PROBING and self._probe.until:
            return self._probe.until
        return self._line.due()

    def handle_timer(self, now: float) -> None:
        """Process expired timers."""
        if self._gap.passed(now):
            self._end_frame(now)
        if self.streams:
            self._expire_streams(now)
        state = self._state
        if state is WAITING:
            if now >= self._deadline:
                answers = self._answers
                if answers is not None and answers.items and self._enough(answers):
                    self._succeed(answers.items[-1], now)
                else:
                    self._timed_out(now)
        elif state is PROBING and self._probe.until:
            if now >= self._probe.until:
                self._probed(found=False, now=now)
        elif state is not IDLE and self._line.failed(now):
            self._fail(BadReply, "line never became idle: unsolicited traffic", now)

    def _expire_streams(self, now: float) -> None:
        for stream in self.streams.expire(now):
            pending, error = stream.pending, stream.error
            assert error is not None
            pending.count.timeouts += 1
            pending.count.failures += 1
            self.events.append(Failed(now, pending.node, pending.request, error))
            self._distrust(now)

    def _enough(self, answers: Answers) -> bool:
        """Whether the answers count although the time has passed: it ends them, or no attempt is left."""
        return answers.timed or (answers.nodes is not None and not self._attempts.left)

    def take(self) -> Reply:
        """Return the reply of the transaction that has just ended.

        Raises:
            NoReply: no reply was received.
            BadReply: only corrupt or wrong replies were received.
            Refused: the device refused the request, as the schema describes it.
            Collision: the echo of the request was changed.
        """
        outcome, self._outcome = self._outcome, None
        return outcome if type(outcome) is Reply else settled(outcome)

    def abort(self, now: float) -> None:
        """Give up the pending transaction; an answer that still arrives is a stray."""
        if self._state is IDLE:
            return
        line = self._line
        if self._state is WAITING:  # the node may still answer until the deadline
            line.free_at = max(now, self._deadline)
        line.distrust(max(now, line.free_at))
        self._state = _ABORT[self._state]
        self._outcome = None

    # Sending ------------------------------------------------------------------------------------------------

    def _send_probe(self, now: float) -> bytes:
        if self._probe.until:
            return b""
        if self.frames is not None:
            self.frames.append(Frame(now, True, PROBE))
        return self._probe.send(now + self.timing.on_wire(len(PROBE)) + self._line.quiet)

    def _send(self, now: float) -> bytes:
        self._end_frame(now)
        self._gap.due = None
        pending, attempts = self._pending, self._attempts
        if attempts.number and self.numbering is not None and self.numbering.per_frame:
            self.numbering.number(pending.request)
            pending.frame = self.codec.encode(pending.request)
        frame, count, command = pending.frame, pending.count, pending.command
        attempts.number = number = attempts.number + 1
        attempts.sent_at = now
        attempts.patient_until = 0.0
        count.requests += 1
        if number > 1:
            count.repeats += 1
        if self._echo.mode == "expect" and self._echo.sent(frame):
            self._echo_missing(self.counters[None], None, now)
        self._line.suspect = False
        if self.verbose:
            self.events.append(Sent(now, pending.node, pending.request, number, frame))
        if self.frames is not None:
            self.frames.append(Frame(now, True, frame, pending.request))
        on_wire = len(frame) * self._byte_time + self.break_time
        if not pending.is_answered:
            if self._paced or self._gap.span:
                self._line.free_at = now + on_wire + command.allowance
            self._stopped(pending, now + on_wire)
            self._outcome = attempts.reply(None, now)
            self._state = _UNANSWERED[self._state]
            return frame
        self._earliest = now + EARLY * on_wire if self._paced else now
        self._deadline = now + on_wire + command.answer_time
        if self._dialogue is not None:
            self._dialogue.restart()
            self._go_on(self._dialogue, now, on_wire)
            return frame
        if command.many is not None:
            self._await_several(pending, command.many)
        self._state = _SENT[self._state]
        return frame

    def _await_several(self, pending: Pending, many: Many) -> None:
        """Begin to take several answers, or go on with those that a repeat is to complete."""
        command, answers = pending.command, self._answers
        if answers is None or answers.nodes is None:
            alone = command.answers_broadcast and not pending.to_all
            self._answers = answers = Answers(many, pending.request, alone=alone)
        if answers.timed:
            self._deadline += self.timing.duration(many)
        self._deadline += answers.further * command.answer_time

    def _send_next(self, now: float) -> bytes:
        """Send the next frame of a dialogue."""
        dialogue, pending = self._dialogue, self._pending
        assert dialogue is not None
        message = dialogue.next()
        self._fill(message)
        frame = self.codec.encode(message)
        if type(message) is pending.command.definition.sized_by:
            pending.asked = message
        if self._address(message) != pending.node:
            raise ValueError(f"{message.NAME} is for another node than {pending.request.NAME}")
        self._attempts.patient_until = 0.0
        if self._echo.mode == "expect" and self._echo.sent(frame):
            self._echo_missing(self.counters[None], None, now)
        self._line.suspect = False
        if self.verbose:
            self.events.append(Sent(now, pending.node, message, self._attempts.number, frame))
        if self.frames is not None:
            self.frames.append(Frame(now, True, frame, message))
        on_wire = len(frame) * self._byte_time + self.break_time
        self._earliest = now + EARLY * on_wire if self._paced else now
        self._go_on(dialogue, now, on_wire)
        return frame

    def _go_on(self, dialogue: Conversation, now: float, on_wire: float = 0.0) -> None:
        """Await the next frame of a dialogue, let it be sent, or end after the last one."""
        command = self._pending.command
        if dialogue.receives:
            self._deadline = now + on_wire + command.step_times[dialogue.at]
            self._state = (_MORE if self._state is WAITING else _SENT)[self._state]
            return
        if on_wire and (self._paced or self._gap.span):
            self._line.free_at = now + on_wire + command.allowance
        if dialogue.ended:
            self._outcome = self._attempts.reply(tuple(dialogue.answers), now)
            self._state = _UNANSWERED[self._state]
        else:
            self._state = _NEXT[self._state]

    # Echo ---------------------------------------------------------------------------------------------------

    def _probed(self, *, found: bool, now: float) -> None:
        self._echo.mode = "expect" if found else "none"
        self.events.append(EchoFound(now, found))
        self._state = _PROBED[self._state]
        if found:  # the rest of the probe may still arrive
            self._line.suspect = True
            self._line.quiet_at = now + self.timing.on_wire(len(PROBE))
        self._line.give_up_at = now + self._line.limit

    def _without_echo(self, data: bytes, now: float) -> bytes:
        echo = self._echo
        broken, expected = echo.broken, echo.outstanding
        rest = echo.cancel(data)
        if echo.broken and not broken:  # reported once the frame itself can no longer follow
            self._broken_echo = EchoBroken(now, self._pending.node, expected, data)
        return rest

    def _echo_missing(self, count: LinkCounters, node: int | None, now: float) -> None:
        count.missing_echoes += 1
        self.events.append(EchoBroken(now, node, self._echo.outstanding, b""))

    # Receiving ----------------------------------------------------------------------------------------------

    def _take_in(self, event: Framed | Fault, now: float) -> None:
        if self._echo.broken and self._is_own(event):
            return
        if self.frames is not None:
            self.frames.append(heard(event, now, self.codec))
        if is_message(event) and not self.own.takes(event):
            self._stray(event, now)
            return
        if (
            self._state is WAITING
            and type(event) is self._pending.command.plain
            and now >= self._earliest
            and self._pending.answered_by(event, self._address(event))
        ):
            self._succeed(event, now)
        elif not is_message(event):
            self._damaged(event, now)
        elif not (self._state is WAITING and now >= self._earliest and self._other_reply(event, now)):
            self._stray(event, now)

    def _asked(self, message: Framed) -> Iterator[Framed]:
        """The requests that a message may answer, the last one first."""
        node = self._address(message)
        if self._state is WAITING and self._pending.from_asked(node):
            yield self._pending.request
        yield from self.streams.asked_of(lambda pending: pending.from_asked(node))

    def _other_reply(self, message: Framed, now: float) -> bool:
        """Handle an answer other than the response; return whether it is one."""
        pending, attempts = self._pending, self._attempts
        reply = pending.replied_by(message, self._address(message))
        if reply is None:
            return self._is_one_of_several(message, now)
        cut(pending.command.definition, pending.asked, message)
        means = reply.meaning(message)
        if means == "done" and self._dialogue is not None and type(message) is pending.command.response:
            return self._is_step(self._dialogue, message, now)
        event = OtherAnswer(now, pending.node, pending.request, message, means, attempts.number)
        self.events.append(event)
        if self._answers is not None and self._answers.ended_by(message):
            self._succeed(message, now)
        elif means == "done":
            if not self._is_one_of_several(message, now):
                self._succeed(message, now)
        elif means == "pending":
            self._wait_on(reply, now)
        else:
            self._answered(message, now)
            if means == "again" and attempts.number < (self._wanted or self.timing.attempts):
                self._again()
                self._line.free_at = max(self._line.free_at, now + self.timing.pause(reply))
                self._line.await_quiet(now)
            else:
                self._refused(reply, message, now)
        return True

    def _again(self) -> None:
        """Let the last frame be sent once more."""
        if self._dialogue is not None and self._dialogue.back():
            self._attempts.number += 1
            self._state = _NEXT[self._state]
        else:
            self._state = _AGAIN[self._state]

    def _is_one_of_several(self, message: Framed, now: float) -> bool:
        """Take one of several answers; return whether it is one."""
        if self._dialogue is not None:
            return self._is_step(self._dialogue, message, now)
        return self._is_one_of_many(message, now)

    def _is_step(self, dialogue: Conversation, message: Framed, now: float) -> bool:
        """Take an answer of a dialogue; return whether it is the one that is due."""
        pending, node = self._pending, self._address(message)
        if not dialogue.receives or type(message) is not dialogue.due:
            return False
        last = dialogue.is_last_answer
        right = pending.answered_by(message, node) if last else pending.from_asked(node)
        if not right:
            return False
        cut(pending.command.definition, pending.asked, message)
        dialogue.answer(message)
        if dialogue.ended:
            self._succeed(message, now)
            return True
        self._answered(message, now)
        event = OtherAnswer(now, pending.node, pending.request, message, "more", self._attempts.number)
        self.events.append(event)
        self._attempts.patient_until = 0.0
        self._go_on(dialogue, now)
        return True

    def _is_one_of_many(self, message: Framed, now: float) -> bool:
        """Take one of several answers; return whether it is one."""
        pending, answers = self._pending, self._answers
        if answers is None or type(message) is not pending.command.response:
            return False
        if not pending.answered_by(message, self._address(message)) or not answers.expects(message):
            return False
        cut(pending.command.definition, pending.asked, message)
        if answers.take(message):
            self._succeed(message, now)
            return True
        self._state = _MORE[self._state]
        event = OtherAnswer(now, pending.node, pending.request, message, "more", self._attempts.number)
        self.events.append(event)
        if not answers.timed and answers.nodes is None:
            self._deadline = now + pending.command.answer_time
        return True

    def _wait_on(self, reply: OtherReply, now: float) -> None:
        """Extend the deadline, once: a node cannot hold the line for ever by promising an answer."""
        attempts = self._attempts
        self._state = _PENDING[self._state]
        if not attempts.patient_until:
            attempts.patient_until = now + self.timing.patience(self._pending.command.definition, reply)
            self._deadline = max(self._deadline, attempts.patient_until)

    def _refused(self, reply: OtherReply, message: Framed, now: float) -> None:
        pending, attempts = self._pending, self._attempts
        self._state = _ANSWERED[self._state]
        pending.count.refusals += 1
        elapsed, reason = now - attempts.started, reason_of(reply, pending.command.definition, message)
        node = "" if pending.node is None else f" by node {pending.node}"
        self._outcome = RequestRefused(
            f"{pending.request.NAME}: refused{node}: {reason}; {elapsed * 1e3:.1f} ms",
            reason=reason,
            reply=message,
            request=pending.request,
            node=pending.node,
            attempts=attempts.number,
            elapsed=elapsed,
            received=self.codec.encode(message)[-64:],
        )
        self.events.append(Failed(now, pending.node, pending.request, self._outcome))

    def _is_own(self, event: Framed | Fault) -> bool:
        return self._echo.is_own(self.codec.encode(event) if is_message(event) else event.raw)

    def _stray(self, message: Framed, now: float) -> None:
        node = self._address(message)
        if self.streams and (stream := self.streams.take(message, node, now)) is not None:
            if self.verbose:
                more = OtherAnswer(now, stream.pending.node, stream.request, message, "more", 1)
                self.events.append(more)
            return
        count = self.counters.get(node) or self.counters[None]
        earlier, sent = self._earlier, self._attempts.number > 0
        asked = sent and self._pending.may_be_answered_by(message, node)
        if asked and self._state is WAITING and (fault := self._missized(message)) is not None:
            self._damaged(fault, now)
            return
        late = asked or (earlier is not None and earlier.may_be_answered_by(message, node))
        if asked and self._state is WAITING:
            self._attempts.wrong.append((message.NAME, self.codec.encode(message)))
        count.strays += 1
        count.late += late
        self.events.append(Stray(now, message, late))

    def _missized(self, message: Framed) -> Fault | None:
        """The fault of a response of another size than the request asks for, None if it has that size."""
        command, asked = self._pending.command.definition, self._pending.asked
        if type(message) is not command.response or not (name := wrong_size(command, asked, message)):
            return None
        text = missized(message, name, command, asked)
        return NotAnAnswer("length", 0, self.codec.encode(message), text)

    def _damaged(self, fault: Fault, now: float) -> None:
        waiting = self._state is WAITING
        count = self._pending.count if waiting else self.counters[None]
        count.count_damaged(fault.kind)
        if waiting:
            self._attempts.wrong.append((fault.kind, fault.raw))
        self.events.append(Damaged(now, self._pending.node if waiting else None, fault))

    # The end of a transaction -------------------------------------------------------------------------------

    def _succeed(self, response: Framed, now: float) -> None:
        pending, attempts = self._pending, self._attempts
        self._state = _ANSWERED[self._state]
        answers = self._answers
        if pending.command.sizes:
            cut(pending.command.definition, pending.asked, response)
        several: object = response if answers is None else answers.result
        if answers is not None and self.streams.is_one(pending):
            several = self.streams.begin(pending, response if answers.items else None, now)
        if self._dialogue is not None and self._dialogue.ended and not self._dialogue.is_alone:
            several = tuple(self._dialogue.answers)
        self._outcome = reply = attempts.reply(several, now)
        self._answered(response, now)
        self._stopped(pending, now)
        if self.verbose:
            event = Answered(now, pending.node, pending.request, response, reply.attempts, reply.elapsed)
            self.events.append(event)

    def _stopped(self, pending: Pending, now: float) -> None:
        """End the streams that a request has stopped; their last answers may still arrive."""
        if self.streams and self.streams.stop(pending.request):
            self._line.distrust(now)

    def _distrust(self, now: float) -> None:
        """Require a quiet line, if there can be one."""
        if not self.streams:
            self._line.distrust(now)

    def _answered(self, answer: Framed, now: float) -> None:
        """Note that the node has answered, in whatever way."""
        pending, count = self._pending, self._pending.count
        count.answers += 1
        if self._echo.broken:
            count.partial_echoes += 1
            self.events.append(self._broken_echo)
            self._echo.forget()
        if self._attempts.number > 1:
            self._distrust(now)  # the answer to an earlier attempt may still arrive
        if self._keeps_idle:
            self._line.free_at = max(self._line.free_at, now + self.timing.idle)
        elif self._paced and self.codec.encode(answer)[-1:] != self._received[-1:]:
            self._line.free_at = (
                now + self._byte_time
            )  # the byte inserted after the last byte of the checksum
        if self.health.answered(pending.node):
            self._tell_health(now)

    def _timed_out(self, now: float) -> None:
        pending, attempts, echo = self._pending, self._attempts, self._echo
        pending.count.timeouts += 1
        if echo.broken:
            pending.count.collisions += 1
            self.events.append(self._broken_echo)
        elif echo.active:
            self._echo_missing(pending.count, pending.node, now)
            echo.forget()
        self.events.append(TimedOut(now, pending.node, pending.request, attempts.number))
        self._distrust(now)
        if attempts.left:
            self._state = _REPEAT[self._state]
        elif echo.broken:
            self._fail(Collision, "the echo of the request was changed: another station was sending too", now)
        elif attempts.wrong:
            kinds = ", ".join(attempts.wrong_kinds())
            self._fail(BadReply, f"received only invalid replies ({kinds})", now)
        else:
            self._fail(NoReply, NO_FRAME if self._received else "no answer", now)

    def _fail(self, error: type[LinkError], reason: str, now: float) -> None:
        pending, attempts = self._pending, self._attempts
        elapsed = now - attempts.started
        node = "" if pending.node is None else f" to node {pending.node}"
        times = "once" if attempts.number == 1 else f"{attempts.number} times"
        received = attempts.wrong_bytes() or self._received  # the latter are not a frame
        self._outcome = error(
            f"{pending.request.NAME}{node}: {reason}; sent {times}, {elapsed * 1e3:.1f} ms",
            node=pending.node,
            attempts=attempts.number,
            elapsed=elapsed,
            received=received[-64:],
        )
        self._state = _FAIL[self._state]
        pending.count.failures += 1
        self.events.append(Failed(now, pending.node, pending.request, self._outcome))
        # A line that never becomes idle is not a failure of the node.
        blamed = attempts.number and not self._trial
        if blamed and self.health.failed(pending.node, now, elapsed + self._line.quiet):
            self._tell_health(now)

    def _look_at_health(self, now: float) -> None:
        """Refuse a request to an offline node, except for its trials."""
        pending = self._pending
        health = self.health.offline(pending.node)
        if health is None:
            return
        if now < health.next_trial:
            pending.count.refused += 1
            self.events.append(Refused(now, pending.node, pending.request))
            raise NoReply(
                f"{pending.request.NAME} to node {pending.node}: not sent, since {health.failures} "
                f"transactions failed; next trial in {health.next_trial - now:.2f} s",
                node=pending.node,
            )
        self._attempts.tries = 1

    def _tell_health(self, now: float) -> None:
        node = self._pending.node
        assert node is not None
        self.events.append(HealthChanged(now, node, self.health[node].state))
