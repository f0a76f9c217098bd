"""The host of a device that takes packets without a frame, and answers with a checksum.

A packet is a command byte and words. The start of a packet is not marked, so a lost byte leaves host and
device out of step: the device waits for the rest of a packet and takes the next command for it. This engine
detects that if it reads the checksums, and resynchronises by itself.

It is used like `MasterEngine` (see `qlinkgen.link.master`), with the same drivers. Its states are in
`qlinkgen.link.host_states`, as the table that is executed; its parts with a state of their own are in
`qlinkgen.link.host_parts`, and the attempts and the wait for a quiet line are those of a master.

A *context* is a request that determines what later ones act on, such as the current axis. A packet lists the
one that it needs, which is sent first if it may not be in force: at first use, after another context, and
after a wrong reply, since the device may have taken the rest of a packet for a context.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection

from qlinkgen.errors import BadReply, IllegalCommand, LinkError, NoReply
from qlinkgen.link.attempts import Attempts
from qlinkgen.link.codec import Framed, Message
from qlinkgen.link.dialogue import Dialogue
from qlinkgen.link.events import EVENTS_KEPT, Answered, Damaged, Event, Failed, Frame, Sent, TimedOut
from qlinkgen.link.host_events import Filled, HostCounters, InStep, OutOfStep
from qlinkgen.link.host_parts import Awaited, Unread, WayBack
from qlinkgen.link.host_rules import Asked, CommandRules, HostCodec, HostRules
from qlinkgen.link.host_states import HOST_MOVES, HostEvent, HostState
from qlinkgen.link.host_timing import HostTiming
from qlinkgen.link.quiet import Silence
from qlinkgen.link.state import Moves
from qlinkgen.link.timing import check_attempts
from qlinkgen.link.transaction import Packet, Question, Reply, settled

(
    _START, _START_LOST, _SELECT, _SENT, _UNREAD, _ANSWERED, _CONFIRMED, _LOST, _FILL, _SILENT, _FILLED,
    _FAIL, _ABORT,
) = (Moves(HOST_MOVES, event) for event in HostEvent)  # fmt: skip


class HostEngine:
    """The host of one device.

    Attributes:
        codec: the generated module of the protocol.
        timing: all deadlines.
        events: events, oldest first; the driver removes them.
        verbose: also report each request and answer, not only irregularities.
        frames: each packet, answer and fill byte, oldest first, which the driver removes; None, unless
            somebody is told.
        count: counts of requests, answers and faults.
        in_step: host and device agree on the start of packets, as far as known.
        context: class of the context in force, None if unknown.
    """

    def __init__(
        self,
        codec: HostCodec,
        timing: HostTiming,
        rules: HostRules,
        *,
        checked: Collection[str] | None = None,
    ) -> None:
        """Make an engine; `checked` are the commands whose checksum is read, by default all."""
        self.codec = codec
        self.timing = timing
        self.rules = rules
        self.events: deque[Event] = deque(maxlen=EVENTS_KEPT)
        self.verbose = True
        self.frames: deque[Frame] | None = None
        self.count = HostCounters()
        self.in_step = True
        self.context: type[Framed] | None = None
        self._commands = {
            command.request: CommandRules(command, timing, rules, check=checked is None or name in checked)
            for name, command in codec.COMMANDS.items()
        }
        self._decode = codec.decode_response
        self._decode_errors = codec.DecodeError
        self._check_size = self._commands[type(rules.proof)].check_size
        longest = max(command.request.MAX_WIRE_SIZE for command in codec.COMMANDS.values())
        self._most_fills = timing.fills(longest)
        self._state = HostState.IDLE
        self._outcome: Reply | LinkError | None = None
        self._packet = Packet(rules.proof)
        self._wanted = self._sendable(rules.proof)
        self._awaited = Awaited(self._wanted)
        self._unread = Unread(timing.byte_time)
        self._attempts = Attempts()
        self._line = Silence(timing.quiet, timing.quiet_limit)
        self._way = WayBack(rules)

    # What a driver calls ------------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """A transaction is in progress."""
        return self._state is not HostState.IDLE

    @property
    def total(self) -> HostCounters:
        """Counts of requests, answers and faults."""
        return self.count

    def start(
        self, request: Question, now: float, *, attempts: int | None = None, trial: bool = False
    ) -> None:
        """Begin a transaction.

        Args:
            request: message of the generated module, or a Packet.
            now: time.
            attempts: largest number of transmissions; by default that of the timing. A request that is unsafe
                to repeat is sent once in any case.
            trial: ignored by a host; drivers pass it to every engine.

        Raises:
            EncodeError: of the generated module; a value cannot be sent.
            TypeError: the message is not a request of this protocol.
            ValueError: attempts is less than 1.
            RuntimeError: another transaction is pending.
        """
        del trial
        if self._state is not HostState.IDLE:
            raise RuntimeError("another transaction is pending; a host performs one at a time")
        if isinstance(request, Dialogue):
            raise TypeError("a host has no dialogues")
        packet = request if type(request) is Packet else Packet(request)
        command = self._commands.get(type(packet.request))
        if command is None:
            name = type(packet.request).__name__
            raise TypeError(f"{name} is not a request of this protocol")
        tries = command.tries
        if attempts is not None:
            tries = self.timing.attempts_of(command.definition, check_attempts(attempts))
        self._wanted = Asked(packet.request, command, packet.request.to_frame())
        self._packet = packet
        self._attempts.begin(tries, now)
        self._way.begin()
        self._outcome = None
        if self._unread.overdue(now):
            self._out_of_step(now, None, "unread checksums were not received in time")
        if self.in_step:
            self._state = _START[self._state]
        else:
            self._state = _START_LOST[self._state]
            self._guard(self._line.quiet_at, now)

    def bytes_to_send(self, now: float) -> bytes:
        """Return the bytes that the driver has to write now."""
        state = self._state
        if state is HostState.READY:
            return self._send(now)
        if state is HostState.GUARD and now >= self._line.quiet_at:
            return self._send_fill(now)
        if state is HostState.PROVING and not self._awaited.listening:
            return self._ask(self._sendable(self._proving()), now, check=True)
        return b""

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes."""
        self._way.heard = True
        if self._unread.owed:
            data = self._unread.discard(data)
            if not data:
                return
        awaited = self._awaited
        if awaited.listening:
            awaited.data += data
            if len(awaited.data) >= awaited.need:
                self._arrived(now)
        else:
            self._unasked(data, now)

    def next_timer(self) -> float | None:
        """Return the time of the next call without received bytes; None if none is needed."""
        state = self._state
        if state is HostState.IDLE:
            return None
        if state is HostState.GUARD:
            return self._line.due()
        if self._awaited.listening:
            return self._awaited.deadline
        return self._attempts.started  # immediately: there are bytes to send

    def handle_timer(self, now: float) -> None:
        """Process expired timers."""
        if self._state is HostState.GUARD:
            if self._line.failed(now):
                self._fail(BadReply, "line never became idle: unsolicited traffic", now)
        elif self._awaited.late(now):
            self._timed_out(now)

    def take(self) -> Reply:
        """Return the reply of the transaction that has just ended.

        Raises:
            NoReply: no reply was received.
            BadReply: only corrupt or wrong replies were received.
            IllegalCommand: the device does not know the command.
        """
        outcome, self._outcome = self._outcome, None
        return settled(outcome)

    def abort(self, now: float) -> None:
        """Give up the pending transaction; an answer that still arrives is discarded."""
        state = self._state
        if state is HostState.IDLE:
            return
        until = max(now, self._awaited.deadline) if self._awaited.listening else now
        if state is not HostState.READY:
            self._out_of_step(now, self._packet.request, "a transaction was aborted", until)
        self._state = _ABORT[state]
        self._outcome = None

    # Sending ------------------------------------------------------------------------------------------------

    def _sendable(self, request: Framed) -> Asked:
        return Asked(request, self._commands[type(request)], request.to_frame())

    def _send(self, now: float) -> bytes:
        packet, wanted = self._packet, self._wanted
        command = wanted.command
        check = command.check if packet.check is None or command.response is None else packet.check
        context = packet.context
        first = b""
        if context is not None and type(context) is not self.context:
            self.count.contexts += 1
            selection = self._sendable(context)
            if check:
                self._state = _SELECT[self._state]
                return self._ask(selection, now, check=True)
            first = self._send_off(selection, now)
        self._attempts.number += 1
        if not check and not command.payload:
            frame = self._send_off(wanted, now)
            self._state = _UNREAD[self._state]
            self._succeed(command.response() if command.response is not None else None, now)
            return first + frame
        self._state = _SENT[self._state]
        if self._attempts.number > 1:
            self.count.repeats += 1
        return first + self._ask(wanted, now, check=check)

    def _ask(self, asked: Asked, now: float, *, check: bool) -> bytes:
        """Send a packet and wait for its answer."""
        self.count.requests += 1
        self._attempts.sent_at = now
        self._awaited.ask(asked, self._unread.line_up(asked, now), check=check)
        return self._sent(asked, now)

    def _sent(self, asked: Asked, now: float) -> bytes:
        """Report a packet that is sent, and return its bytes."""
        if self.verbose:
            self.events.append(Sent(now, None, asked.request, self._attempt, asked.frame))
        if self.frames is not None:
            self.frames.append(Frame(now, True, asked.frame, asked.request))
        return asked.frame

    def _tell(self, frame: Frame) -> None:
        if self.frames is not None:
            self.frames.append(frame)

    @property
    def _attempt(self) -> int:
        """Number of the attempt that a packet belongs to: 1 for one that the engine sends of itself."""
        return self._attempts.number if self._state is HostState.WAITING else 1

    def _send_off(self, asked: Asked, now: float) -> bytes:
        """Send a packet whose answer is discarded."""
        command = asked.command
        self.count.requests += 1
        self._attempts.sent_at = now
        self._unread.owe(command.payload + command.check_size, 0.0)
        self._unread.until = self._unread.line_up(asked, now)
        if command.moves:
            self.context = command.makes
        return self._sent(asked, now)

    # Receiving ----------------------------------------------------------------------------------------------

    def _unasked(self, data: bytes, now: float) -> None:
        """Handle bytes that do not belong to an answer."""
        self.count.skipped += len(data)
        self._tell(Frame(now, False, data))
        if self.in_step:
            fault = self.codec.Fault("frame", 0, data, "unsolicited bytes")
            self.count.count_damaged("frame")
            self.events.append(Damaged(now, None, fault))
            self._out_of_step(now, None, "unsolicited bytes", received=data)
            if self._state is HostState.READY:  # nothing is sent yet, and must not be before it is in step
                self._state = _LOST[self._state]
                self._guard(self._line.quiet_at, now)
        self._line.disturbed(now, waiting=self._state is HostState.GUARD)

    def _arrived(self, now: float) -> None:
        """Handle the complete answer, and bytes after it."""
        if self._state is HostState.FILLING:
            self._filled(now)
            return
        awaited = self._awaited
        asked, data, size = awaited.asked, awaited.data, awaited.need
        command = asked.command
        raw, rest = (data, b"") if len(data) == size else (data[:size], data[size:])
        try:
            if awaited.check:
                response = self._decode(raw, asked)
            else:
                assert command.response is not None
                response = command.response.from_bytes(raw)
        except self._decode_errors as error:
            self._wrong_answer(getattr(error, "kind", "frame"), data, str(error), now)
            return
        if self.frames is not None:
            self.frames.append(Frame(now, False, raw, response))
        if command.moves:
            self.context = command.makes
        if not awaited.check:
            self._unread.owe(command.check_size, awaited.deadline)
            rest = self._unread.discard(rest)
        awaited.listening = False
        if self._state is HostState.WAITING:
            self._state = _ANSWERED[self._state]
            self._succeed(response, now)
            if rest:
                self._unasked(rest, now)
        elif rest:
            self._wrong_answer("frame", data, f"{asked.NAME}: bytes after the answer", now)
        else:
            self._go_on(asked, now)

    def _go_on(self, asked: Asked, now: float) -> None:
        """Continue after the correct answer to a context or the proof."""
        if self._state is HostState.PROVING and asked.request is self.rules.proof:
            self.in_step = True
            self.count.in_step += 1
            self.count.completed += self._way.completed
            self.events.append(InStep(now, self._way.fills, self._way.completed))
        if self.in_step:
            self._state = _CONFIRMED[self._state]

    # Getting back in step -----------------------------------------------------------------------------------

    def _out_of_step(
        self, now: float, request: Framed | None, reason: str, until: float = 0.0, received: bytes = b""
    ) -> None:
        """Discard all assumptions about the device until it is verified to be in step."""
        if self.in_step:
            self.count.out_of_step += 1
            self.events.append(OutOfStep(now, request, reason, received))
        if self.in_step or request is not None:
            self._way.choose_fill(None if request is None else type(request))
        self.in_step = False
        self.context = None
        self._unread.owed = 0
        self._awaited.stop()
        self._line.quiet_at = max(now, until) + self._line.quiet

    def _guard(self, quiet_at: float, now: float) -> None:
        """Wait for a quiet line, which may be so already."""
        quiet = self.timing.quiet_after(self._way.silent)
        self._awaited.listening = False
        self._line.quiet_at = quiet_at
        self._line.give_up_at = max(now, quiet_at) + quiet + self.timing.on_wire(self.timing.longest_frame)
        self._way.begin_round()

    def _guard_again(self, now: float) -> None:
        self._state = _LOST[self._state]
        self._guard(now + self.timing.quiet_after(self._way.silent), now)

    def _send_fill(self, now: float) -> bytes:
        """Send a fill byte: a device in the middle of a packet would take the next command for its rest."""
        self._state = _FILL[self._state]
        self._awaited.listen(self._check_size, now + self.timing.fill_deadline(self._check_size))
        self.count.fills += 1
        if self.verbose:
            self.events.append(Filled(now, self._way.fill))
        fill = self._way.next_fill()
        self._tell(Frame(now, True, fill))
        return fill

    def _filled(self, now: float) -> None:
        """Continue after an answer to a fill byte, or silence after all: the device is between packets."""
        if self._awaited.data:
            self._tell(Frame(now, False, self._awaited.data))
        self._way.filled(self._awaited.data[: self._check_size])
        self._state = _FILLED[self._state]
        self._awaited.stop()  # the next call of bytes_to_send asks

    def _proving(self) -> Framed:
        """Return the next packet of the proof: two different ones, so that a late answer is detected."""
        context = self._packet.context if self._packet.context is not None else self.rules.context
        if context is not None and self.context is not type(context):
            return context
        return self.rules.proof

    def _lost_round(self, reason: str, error: type[LinkError], now: float) -> None:
        """Handle a failed context, or a failed round of resynchronisation."""
        self._out_of_step(now, self._packet.request if self._attempts.number else None, reason)
        if self._way.lose_round():
            self._guard_again(now)
        else:
            self._fail(error, f"host and device are out of step, and resynchronisation failed: {reason}", now)

    # The end of an attempt, and of a transaction ------------------------------------------------------------

    def _wrong_answer(self, kind: str, data: bytes, text: str, now: float) -> None:
        count = self.count
        count.count_damaged(kind)
        count.illegal += kind == "illegal"
        fault = self.codec.Fault(kind, 0, data, text)
        self.events.append(Damaged(now, None, fault))
        self._tell(Frame(now, False, data, None, fault))
        if self._state is HostState.WAITING:
            self._attempts.wrong.append((kind, data))
            self._attempt_failed(text, now, data)
        else:
            self._lost_round(text, IllegalCommand if kind == "illegal" else BadReply, now)

    def _timed_out(self, now: float) -> None:
        state, awaited = self._state, self._awaited
        data = awaited.data
        if state is HostState.FILLING:
            self._no_fill_answer(now)
            return
        self.count.timeouts += 1
        self.events.append(TimedOut(now, None, awaited.asked.request, self._attempt))
        if data:
            self.count.count_damaged("truncated")
            self.count.skipped += len(data)
            self._tell(Frame(now, False, data))
        reason = (
            f"{awaited.asked.NAME}: {len(data)} of {awaited.need} bytes received" if data else "no answer"
        )
        if state is HostState.WAITING:
            if data and data == self.rules.refusal:  # a refusal of an unknown command has no words
                self._attempts.wrong.append(("illegal", data))
            elif data:
                self._attempts.wrong.append(("truncated", data))
            self._attempt_failed(reason, now, data)
        else:
            self._lost_round(reason, BadReply if data else NoReply, now)

    def _no_fill_answer(self, now: float) -> None:
        if self._way.fills < self._most_fills and not self._awaited.data:
            self._state = _SILENT[self._state]
            self._awaited.listening = False
            self._line.quiet_at = now  # the line is quiet: the next byte goes out at once
            self._line.give_up_at = now + 2 * self._line.quiet
        else:
            self._filled(now)

    def _attempt_failed(self, reason: str, now: float, data: bytes) -> None:
        attempts = self._attempts
        self._out_of_step(now, self._packet.request, reason, received=data)
        if attempts.left:
            self._guard_again(now)
            return
        kinds = attempts.wrong_kinds()
        if kinds == ["illegal"] and len(attempts.wrong) == attempts.number:
            self._fail(IllegalCommand, "unknown command: the check value of the answer rejects it", now)
        elif kinds:
            self._fail(BadReply, f"received only invalid replies ({', '.join(kinds)})", now)
        else:
            self._fail(NoReply, "no answer", now)

    def _succeed(self, response: Message | None, now: float) -> None:
        self._outcome = reply = self._attempts.reply(response, now)
        self.count.answers += 1
        if self.verbose:
            event = Answered(now, None, self._packet.request, response, reply.attempts, reply.elapsed)
            self.events.append(event)

    def _fail(self, error: type[LinkError], reason: str, now: float) -> None:
        attempts, request = self._attempts, self._packet.request
        elapsed = now - attempts.started
        sent = f"sent {attempts.number} times" if attempts.number != 1 else "sent once"
        if not attempts.number:
            sent = "not sent"
        elif not self._wanted.command.definition.repeat_safe and error is not IllegalCommand:
            sent += "; it may have been executed, so check before repeating it"
        self._outcome = error(
            f"{request.NAME}: {reason}; {sent}, {elapsed * 1e3:.1f} ms",
            attempts=attempts.number,
            elapsed=elapsed,
            received=attempts.wrong_bytes()[-64:],
        )
        if self.in_step:
            self._out_of_step(now, request, reason)
        self._state = _FAIL[self._state]
        self.count.failures += 1
        self.events.append(Failed(now, None, request, self._outcome))
