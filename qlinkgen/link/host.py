"""The host of a device that takes packets without a frame, and answers with a checksum.

A packet is a command byte and words. The start of a packet is not marked, so a lost byte leaves host and
device out of step: the device waits for the rest of a packet and takes the next command for it. This engine
detects that if it reads the checksums, and resynchronises by itself.

It is used like `MasterEngine` (see `qlinkgen.link.master`), with the same drivers. States:

==========  ========================================  ====================================================
state       meaning                                   transitions
==========  ========================================  ====================================================
idle        no transaction                            `start` -> ready, or guard if out of step
ready       a packet may be sent                      bytes_to_send -> selecting, waiting, or idle if no
                                                      answer is awaited
selecting   waiting for the answer to the context     right: ready; wrong, late: guard
waiting     waiting for the answer to the request     right: idle; wrong, late: guard for the next attempt,
                                                      or failed -> idle after the last
guard       out of step; waiting for a quiet line     quiet: filling; not quiet in time: failed -> idle
filling     one byte was sent to complete a packet    an answer, or silence after every byte: proving;
            that the device may wait for              silence: one more byte
proving     context and proof were sent               both right: ready; else guard, at most 5 times
==========  ========================================  ====================================================

A *context* is a request that determines what later ones act on, such as the current axis. A packet lists the
one that it needs, which is sent first if it may not be in force: at first use, after another context, and
after a wrong reply, since the device may have taken the rest of a packet for a context.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection

from qlinkgen.errors import BadReply, IllegalCommand, LinkError, NoReply
from qlinkgen.link.codec import Framed, Message
from qlinkgen.link.events import EVENTS_KEPT, Answered, Damaged, Event, Failed, Sent, TimedOut
from qlinkgen.link.host_events import Filled, HostCounters, InStep, OutOfStep
from qlinkgen.link.host_rules import Asked, CommandRules, HostCodec, HostRules, State, WayBack
from qlinkgen.link.host_timing import ROUNDS, SILENT_ROUNDS, HostTiming
from qlinkgen.link.timing import check_attempts
from qlinkgen.link.transaction import Packet, Question, Reply, settled


class HostEngine:
    """The host of one device.

    Attributes:
        codec: the generated module of the protocol.
        timing: all deadlines.
        events: events, oldest first; the driver removes them.
        verbose: also report each request and answer, not only irregularities.
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
        self.count = HostCounters()
        self.in_step = True
        self.context: type[Framed] | None = None
        self._commands = {
            command.request: CommandRules(command, timing, rules, check=checked is None or name in checked)
            for name, command in codec.COMMANDS.items()
        }
        self._byte_time = timing.byte_time
        self._decode = codec.decode_response
        self._decode_errors = codec.DecodeError
        self._check_size = self._commands[type(rules.proof)].check_size
        longest = max(command.request.MAX_WIRE_SIZE for command in codec.COMMANDS.values())
        self._most_fills = timing.fills(longest)
        self._state = State.IDLE
        self._outcome: Reply | LinkError | None = None
        # The packet of the transaction, and the current request: its own, a context, or the proof.
        self._packet = Packet(rules.proof)
        self._wanted = self._sendable(rules.proof)
        self._asked = self._wanted
        self._asked_check = True
        self._listening = False
        self._need = 0
        self._buffer = b""
        #: When all sent bytes have been transmitted.
        self._free_at = 0.0
        #: Pending bytes to be discarded, and their deadline.
        self._owed = 0
        self._owed_until = 0.0
        self._tries = 0
        self._attempt = 0
        self._started = 0.0
        self._sent_at = 0.0
        self._deadline = 0.0
        self._quiet_at = 0.0
        self._give_up_at = 0.0
        self._way = WayBack(rules.fill)
        #: Kind and bytes of each reply that was not the answer.
        self._wrong: list[tuple[str, bytes]] = []

    # What a driver calls ------------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """A transaction is in progress."""
        return self._state is not State.IDLE

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
        if self._state is not State.IDLE:
            raise RuntimeError("another transaction is pending; a host performs one at a time")
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
        self._tries = tries
        self._attempt = 0
        self._started = now
        self._way.rounds = self._way.silent = 0
        self._outcome = None
        if self._wrong:
            self._wrong = []
        if self._owed and now > self._owed_until:
            self._out_of_step(now, None, "unread checksums were not received in time")
        if self.in_step:
            self._state = State.READY
        else:
            self._guard(self._quiet_at, now)

    def bytes_to_send(self, now: float) -> bytes:
        """Return the bytes that the driver has to write now."""
        state = self._state
        if state is State.READY:
            return self._send(now)
        if state is State.GUARD and now >= self._quiet_at:
            return self._send_fill(now)
        if state is State.PROVING and not self._listening:
            return self._ask(self._sendable(self._proving()), now, check=True)
        return b""

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes."""
        self._way.heard = True
        if self._owed:
            data = self._without_owed(data)
            if not data:
                return
        if self._listening:
            self._buffer += data
            if len(self._buffer) >= self._need:
                self._arrived(now)
        else:
            self._unasked(data, now)

    def next_timer(self) -> float | None:
        """Return the time of the next call without received bytes; None if none is needed."""
        state = self._state
        if state is State.IDLE:
            return None
        if state is State.GUARD:
            return min(self._quiet_at, self._give_up_at)
        if self._listening:
            return self._deadline
        return self._started  # immediately: there are bytes to send

    def handle_timer(self, now: float) -> None:
        """Process expired timers."""
        if self._state is State.GUARD:
            if now < self._quiet_at and now >= self._give_up_at:
                self._fail(BadReply, "line never became idle: unsolicited traffic", now)
        elif self._listening and now >= self._deadline:
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
        if state is State.IDLE:
            return
        until = max(now, self._deadline) if self._listening else now
        if state is not State.READY:
            self._out_of_step(now, self._packet.request, "a transaction was aborted", until)
        self._state = State.IDLE
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
                self._state = State.SELECTING
                return self._ask(selection, now, check=True)
            first = self._send_off(selection, now)
        self._attempt += 1
        if not check and not command.payload:
            frame = self._send_off(wanted, now)
            self._succeed(command.response() if command.response is not None else None, now)
            return first + frame
        self._state = State.WAITING
        if self._attempt > 1:
            self.count.repeats += 1
        return first + self._ask(wanted, now, check=check)

    def _ask(self, asked: Asked, now: float, *, check: bool) -> bytes:
        """Send a packet and wait for its answer."""
        command = asked.command
        self.count.requests += 1
        self._asked = asked
        self._asked_check = check
        self._listening = True
        self._need = command.payload + command.check_size if check else command.payload
        self._buffer = b""
        self._sent_at = now
        self._deadline = self._line_up(asked, now)
        if self.verbose:
            attempt = self._attempt if self._state is State.WAITING else 1
            self.events.append(Sent(now, None, asked.request, attempt, asked.frame))
        return asked.frame

    def _send_off(self, asked: Asked, now: float) -> bytes:
        """Send a packet whose answer is discarded."""
        command = asked.command
        self.count.requests += 1
        self._sent_at = now
        self._owed += command.payload + command.check_size
        self._owed_until = self._line_up(asked, now)
        if command.moves:
            self.context = command.makes
        if self.verbose:
            self.events.append(Sent(now, None, asked.request, 1, asked.frame))
        return asked.frame

    def _line_up(self, asked: Asked, now: float) -> float:
        """Return the deadline of the answer, after all bytes still being sent and owed."""
        begin = max(now, self._free_at)
        self._free_at = begin + len(asked.frame) * self._byte_time
        return begin + asked.command.answer_time + self._owed * self._byte_time

    # Receiving ----------------------------------------------------------------------------------------------

    def _without_owed(self, data: bytes) -> bytes:
        skipped = min(self._owed, len(data))
        self._owed -= skipped
        return data[skipped:]

    def _unasked(self, data: bytes, now: float) -> None:
        """Handle bytes that do not belong to an answer."""
        self.count.skipped += len(data)
        if self.in_step:
            fault = self.codec.Fault("frame", 0, data, "unsolicited bytes")
            self.count.count_damaged("frame")
            self.events.append(Damaged(now, None, fault))
            self._out_of_step(now, None, "unsolicited bytes", received=data)
        quiet = self.timing.quiet
        if self._state is State.GUARD and now - min(self._quiet_at, self._give_up_at) > quiet:
            # A late caller: its process did not run and reads old bytes. Only later bytes show the state of
            # the line.
            self._give_up_at = max(self._give_up_at, now + self.timing.quiet_limit)
        self._quiet_at = max(self._quiet_at, now + quiet)

    def _arrived(self, now: float) -> None:
        """Handle the complete answer, and bytes after it."""
        if self._state is State.FILLING:
            self._filled()
            return
        asked, data, size = self._asked, self._buffer, self._need
        command = asked.command
        raw, rest = (data, b"") if len(data) == size else (data[:size], data[size:])
        try:
            if self._asked_check:
                response = self._decode(raw, asked)
            else:
                assert command.response is not None
                response = command.response.from_bytes(raw)
        except self._decode_errors as error:
            self._wrong_answer(getattr(error, "kind", "frame"), data, str(error), now)
            return
        if command.moves:
            self.context = command.makes
        if not self._asked_check:
            self._owed += command.check_size
            self._owed_until = self._deadline
            rest = self._without_owed(rest)
        self._listening = False
        if self._state is State.WAITING:
            self._succeed(response, now)
            if rest:
                self._unasked(rest, now)
        elif rest:
            self._wrong_answer("frame", data, f"{asked.NAME}: bytes after the answer", now)
        else:
            self._go_on(asked, now)

    def _go_on(self, asked: Asked, now: float) -> None:
        """Continue after the correct answer to a context or the proof."""
        if self._state is State.PROVING and asked.request is self.rules.proof:
            self.in_step = True
            self.count.in_step += 1
            self.count.completed += self._way.completed
            self.events.append(InStep(now, self._way.fills, self._way.completed))
        if self.in_step:
            self._state = State.READY

    # Getting back in step -----------------------------------------------------------------------------------

    def _out_of_step(
        self, now: float, request: Framed | None, reason: str, until: float = 0.0, received: bytes = b""
    ) -> None:
        """Discard all assumptions about the device until it is verified to be in step."""
        if self.in_step:
            self.count.out_of_step += 1
            self.events.append(OutOfStep(now, request, reason, received))
        if self.in_step or request is not None:
            fill = self.rules.fill
            self._way.fill = fill if request is None else self.rules.fills.get(type(request), fill)
        self.in_step = False
        self.context = None
        self._owed = 0
        self._listening = False
        self._buffer = b""
        self._quiet_at = max(now, until) + self.timing.quiet

    def _guard(self, quiet_at: float, now: float) -> None:
        """Wait for a quiet line, which may be so already."""
        quiet = self.timing.quiet_after(self._way.silent)
        self._state = State.GUARD
        self._way.heard = False
        self._listening = False
        self._quiet_at = quiet_at
        self._give_up_at = max(now, quiet_at) + quiet + self.timing.on_wire(self.timing.longest_frame)
        self._way.fills = 0
        self._way.completed = False

    def _guard_again(self, now: float) -> None:
        self._guard(now + self.timing.quiet_after(self._way.silent), now)

    def _send_fill(self, now: float) -> bytes:
        """Send a fill byte: a device in the middle of a packet would take the next command for its rest."""
        byte = bytes((self._way.fill,))
        self._state = State.FILLING
        self._listening = True
        self._buffer = b""
        self._need = self._check_size
        self._deadline = now + self.timing.fill_deadline(self._check_size)
        self._way.fills += 1
        self.count.fills += 1
        if self.verbose:
            self.events.append(Filled(now, self._way.fill))
        return byte

    def _filled(self) -> None:
        """Continue after an answer to a fill byte, or silence after all: the device is between packets."""
        self._way.completed = bool(self._buffer) and self._buffer[: self._check_size] != self.rules.refusal
        self._state = State.PROVING
        self._listening = False  # the next call of bytes_to_send asks
        self._buffer = b""

    def _proving(self) -> Framed:
        """Return the next packet of the proof: two different ones, so that a late answer is detected."""
        context = self._packet.context if self._packet.context is not None else self.rules.context
        if context is not None and self.context is not type(context):
            return context
        return self.rules.proof

    def _lost_round(self, reason: str, error: type[LinkError], now: float) -> None:
        """Handle a failed context, or a failed round of resynchronisation."""
        self._out_of_step(now, self._packet.request if self._attempt else None, reason)
        self._way.rounds += 1
        self._way.silent += not self._way.heard
        if self._way.rounds < ROUNDS and self._way.silent < SILENT_ROUNDS:
            self._guard_again(now)
        else:
            self._fail(error, f"host and device are out of step, and resynchronisation failed: {reason}", now)

    # The end of an attempt, and of a transaction ------------------------------------------------------------

    def _wrong_answer(self, kind: str, data: bytes, text: str, now: float) -> None:
        count = self.count
        count.count_damaged(kind)
        count.illegal += kind == "illegal"
        self.events.append(Damaged(now, None, self.codec.Fault(kind, 0, data, text)))
        if self._state is State.WAITING:
            self._wrong.append((kind, data))
            self._attempt_failed(text, now, data)
        else:
            self._lost_round(text, IllegalCommand if kind == "illegal" else BadReply, now)

    def _timed_out(self, now: float) -> None:
        state, data = self._state, self._buffer
        if state is State.FILLING:
            if self._way.fills < self._most_fills and not data:
                self._state = State.GUARD  # the line is quiet: the next byte goes out at once
                self._listening = False
                self._quiet_at = now
                self._give_up_at = now + 2 * self.timing.quiet
            else:
                self._filled()
            return
        self.count.timeouts += 1
        self.events.append(
            TimedOut(now, None, self._asked.request, self._attempt if state is State.WAITING else 1)
        )
        if data:
            self.count.count_damaged("truncated")
            self.count.skipped += len(data)
        reason = f"{self._asked.NAME}: {len(data)} of {self._need} bytes received" if data else "no answer"
        if state is State.WAITING:
            if data == self.rules.refusal:  # a refusal of an unknown command has no words
                self._wrong.append(("illegal", data))
            elif data:
                self._wrong.append(("truncated", data))
            self._attempt_failed(reason, now, data)
        else:
            self._lost_round(reason, BadReply if data else NoReply, now)

    def _attempt_failed(self, reason: str, now: float, data: bytes) -> None:
        self._out_of_step(now, self._packet.request, reason, received=data)
        if self._attempt < self._tries:
            self._guard_again(now)
            return
        kinds = {kind for kind, _ in self._wrong}
        if kinds == {"illegal"} and len(self._wrong) == self._attempt:
            self._fail(IllegalCommand, "unknown command: the checksum of the device is 0", now)
        elif kinds:
            self._fail(BadReply, f"received only invalid replies ({', '.join(sorted(kinds))})", now)
        else:
            self._fail(NoReply, "no answer", now)

    def _succeed(self, response: Message | None, now: float) -> None:
        self._state = State.IDLE
        elapsed = now - self._started
        self._outcome = Reply(response, self._attempt, elapsed, now, now - self._sent_at)
        self.count.answers += 1
        if self.verbose:
            self.events.append(Answered(now, None, self._packet.request, response, self._attempt, elapsed))

    def _fail(self, error: type[LinkError], reason: str, now: float) -> None:
        elapsed = now - self._started
        request = self._packet.request
        sent = f"sent {self._attempt} times" if self._attempt != 1 else "sent once"
        if not self._attempt:
            sent = "not sent"
        elif not self._wanted.command.definition.repeat_safe and error is not IllegalCommand:
            sent += "; it may have been executed, so check before repeating it"
        self._outcome = error(
            f"{request.NAME}: {reason}; {sent}, {elapsed * 1e3:.1f} ms",
            attempts=self._attempt,
            elapsed=elapsed,
            received=b"".join(raw for _, raw in self._wrong)[-64:],
        )
        if self.in_step:
            self._out_of_step(now, request, reason)
        self._state = State.IDLE
        self.count.failures += 1
        self.events.append(Failed(now, None, request, self._outcome))
