"""The master of a bus: one transaction at a time, with repeats, deadlines and quiet times.

The engine does no input or output and has no clock. A driver calls it with `now` from its own clock::

    engine.start(request, now)
    while engine.busy:
        port.write(engine.bytes_to_send(now))
        ... wait for bytes, at most until engine.next_timer() ...
        engine.receive(data, now)
        engine.handle_timer(now)
    reply = engine.take()

States and transitions:

========  ==========================================  ====================================================
state     meaning                                     transitions
========  ==========================================  ====================================================
idle      no transaction                              `start` -> guard
guard     a request waits for a quiet line            quiet: bytes_to_send -> waiting, or idle without a
                                                      response; not quiet in time: failed -> idle
probe     two bytes are sent to detect an echo;       received or timed out -> guard
          once, if the echo is "auto"
waiting   waiting for the answer until the deadline   answer -> idle; deadline -> guard for the next
                                                      attempt, or failed -> idle after the last
========  ==========================================  ====================================================
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from qlinkgen.errors import BadReply, Collision, LinkError, NoReply
from qlinkgen.link.codec import Codec, Fault, Framed, address_getter, is_message
from qlinkgen.link.counters import LinkCounters
from qlinkgen.link.echo import NOISE, PROBE, EchoCanceller, EchoMode
from qlinkgen.link.events import (
    EVENTS_KEPT,
    Answered,
    Damaged,
    EchoBroken,
    EchoFound,
    Event,
    Failed,
    HealthChanged,
    Refused,
    Sent,
    Stray,
    TimedOut,
)
from qlinkgen.link.health import HealthBook, HealthPolicy
from qlinkgen.link.timing import Timing, check_attempts
from qlinkgen.link.transaction import Accepts, CommandTiming, Packet, Question, Reply, settled

#: On a paced line, a frame complete before the request was transmitted is not its answer. The factor allows
#: for a difference between the clocks of both sides.
EARLY = 0.9

IDLE = "idle"
GUARD = "guard"
PROBING = "probe"
WAITING = "waiting"


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
    """

    def __init__(
        self,
        codec: Codec,
        timing: Timing,
        *,
        echo: EchoMode = "none",
        health: HealthPolicy | None = None,
        accepts: Mapping[str, Accepts] | None = None,
    ) -> None:
        hooks = accepts or {}
        self.codec = codec
        self.timing = timing
        self.events: deque[Event] = deque(maxlen=EVENTS_KEPT)
        self.verbose = True
        self.counters: dict[int | None, LinkCounters] = {None: LinkCounters()}
        self._bus = codec.BUS
        self.health = HealthBook(health, untracked=(None, self._bus.broadcast))
        self._commands = {
            command.request: CommandTiming(command, timing, hooks.get(name))
            for name, command in codec.COMMANDS.items()
        }
        self._decoder = codec.StreamDecoder("response")
        self._address = address_getter(codec)
        self._echo = EchoCanceller(echo)
        self._byte_time = timing.byte_time
        self._quiet = timing.quiet
        self._quiet_limit = timing.quiet_limit
        self._paced = timing.paced
        self._state = IDLE
        self._outcome: Reply | LinkError | None = None
        self._request: Framed  #: set by `start`
        self._command: CommandTiming = next(iter(self._commands.values()))
        self._node: int | None = None
        #: The previous command and node, whose answer may still arrive.
        self._earlier: tuple[CommandTiming, int | None] | None = None
        self._frame = b""
        self._count = self.counters[None]
        self._tries = 0
        self._trial = False
        self._attempt = 0
        self._started = 0.0
        self._sent_at = 0.0
        self._earliest = 0.0
        self._deadline = 0.0
        #: Earliest time to send: a broadcast is still on the line, or a late answer may arrive.
        self._free_at = 0.0
        self._quiet_at = 0.0
        self._give_up_at = 0.0
        self._suspect = False
        self._received = b""
        self._break = EchoBroken(0.0, None, b"", b"")
        #: Kind and bytes of each reply that was not the answer.
        self._wrong: list[tuple[str, bytes]] = []
        self._probe_until = 0.0
        self._probe_heard = b""

    # What a driver calls ------------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """A transaction is in progress."""
        return self._state is not IDLE

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
            request: message of the generated module.
            now: time.
            attempts: largest number of transmissions; by default that of the timing. A request that is unsafe
                to repeat is sent once in any case.
            trial: ask an offline node before its next trial is due; a missing answer does not count as a
                failure of the node.

        Raises:
            EncodeError: of the generated module; a value cannot be sent.
            TypeError: the message is not a request of this protocol.
            ValueError: attempts is less than 1.
            NoReply: the node is offline, and its next trial is not due yet; nothing was sent.
            RuntimeError: another transaction is pending.
        """
        if self._state is not IDLE:
            raise RuntimeError("another transaction is pending; a bus performs one at a time")
        if type(request) is Packet or (command := self._commands.get(type(request))) is None:
            raise TypeError(f"{type(request).__name__} is not a request of this protocol")
        tries = command.tries if attempts is None else self._tries_of(command, attempts)
        self._frame = self.codec.encode(request)
        if self._attempt:
            self._earlier = self._command, self._node
        self._request = request
        self._command = command
        node = self._node = self._address(request)
        count = self.counters.get(node)
        if count is None:
            count = self.counters[node] = LinkCounters()
        self._count = count
        self._started = now
        self._tries = tries
        self._attempt = 0
        self._trial = trial
        if self.health and not trial and command.response is not None:  # otherwise it does not wait
            self._look_at_health(now)
        if self._wrong:
            self._wrong = []
        self._received = b""
        self._outcome = None
        if self._suspect:
            self._give_up_at = max(now, self._free_at) + self._quiet_limit
        self._state = PROBING if self._echo.mode == "auto" else GUARD
        self._probe_until = 0.0

    def _tries_of(self, command: CommandTiming, attempts: int) -> int:
        check_attempts(attempts)
        return self.timing.attempts_of(command.definition, attempts)

    def bytes_to_send(self, now: float) -> bytes:
        """Return the bytes that the driver has to write now."""
        if self._state is WAITING or self._state is IDLE or now < self._free_at:
            return b""
        if self._suspect and not self._line_is_quiet(now):
            return b""
        if self._state is PROBING:
            return self._send_probe(now)
        return self._send(now)

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes."""
        if self._suspect:
            self._disturbed(now)
        if self._probe_until and self._state is PROBING:
            data = self._without_probe(data, now)
        if self._echo.active:
            data = self._without_echo(data, now)
            if not data:
                return
        self._received = data
        for event in self._decoder.feed(data):
            self._take_in(event, now)

    def next_timer(self) -> float | None:
        """Return the time of the next call without received bytes; None if none is needed."""
        state = self._state
        if state is WAITING:
            return self._deadline
        if state is IDLE:
            return None
        if state is PROBING and self._probe_until:
            return self._probe_until
        due = self._free_at
        if self._suspect:
            due = max(due, min(self._quiet_at, self._give_up_at))
        return due

    def handle_timer(self, now: float) -> None:
        """Process expired timers."""
        state = self._state
        if state is WAITING:
            if now >= self._deadline:
                self._timed_out(now)
        elif state is PROBING and self._probe_until:
            if now >= self._probe_until:
                self._probe_answered(found=False, now=now)
        elif state is not IDLE and self._suspect and not self._line_is_quiet(now) and now >= self._give_up_at:
            self._fail(BadReply, "line never became idle: unsolicited traffic", now)

    def take(self) -> Reply:
        """Return the reply of the transaction that has just ended.

        Raises:
            NoReply: no reply was received.
            BadReply: only corrupt or wrong replies were received.
            Collision: the echo of the request was changed.
        """
        outcome, self._outcome = self._outcome, None
        return settled(outcome)

    def abort(self, now: float) -> None:
        """Give up the pending transaction; an answer that still arrives is a stray."""
        if self._state is IDLE:
            return
        if self._state is WAITING:  # the node may still answer until the deadline
            self._free_at = max(now, self._deadline)
        self._distrust(max(now, self._free_at))
        self._state = IDLE
        self._outcome = None

    # Sending ------------------------------------------------------------------------------------------------

    def _send(self, now: float) -> bytes:
        for event in self._decoder.finish():  # bytes inside a damaged frame may be a message
            self._take_in(event, now)
        frame = self._frame
        count = self._count
        self._attempt += 1
        count.requests += 1
        if self._attempt > 1:
            count.repeats += 1
        if self._echo.mode == "expect" and self._echo.sent(frame):
            self._echo_missing(self.counters[None], None, now)
        self._suspect = False
        if self.verbose:
            self.events.append(Sent(now, self._node, self._request, self._attempt, frame))
        command = self._command
        on_wire = len(frame) * self._byte_time
        self._sent_at = now
        broadcast = self._node == self._bus.broadcast and self._node is not None
        if command.response is None or (broadcast and not command.answers_broadcast):
            if self._paced:
                self._free_at = now + on_wire + command.allowance
            self._succeed(None, now)
            return frame
        self._earliest = now + EARLY * on_wire if self._paced else now
        self._deadline = now + on_wire + command.answer_time
        self._state = WAITING
        return frame

    def _line_is_quiet(self, now: float) -> bool:
        return now >= self._quiet_at

    def _disturbed(self, now: float) -> None:
        """Restart the wait for a quiet line; the limit too if the caller is late.

        A process that did not run for some time reads old bytes now; only later bytes show the state of the
        line.
        """
        if now - max(self._free_at, min(self._quiet_at, self._give_up_at)) > self._quiet:
            self._give_up_at = max(self._give_up_at, now + self._quiet_limit)
        self._quiet_at = max(self._quiet_at, now + self._quiet)

    def _distrust(self, now: float) -> None:
        """Require a quiet line before the next request, since a late answer may arrive."""
        self._suspect = True
        self._quiet_at = now + self._quiet
        self._give_up_at = now + self._quiet_limit

    # Echo ---------------------------------------------------------------------------------------------------

    def _send_probe(self, now: float) -> bytes:
        if self._probe_until:
            return b""
        self._probe_until = now + self.timing.on_wire(len(PROBE)) + self._quiet
        self._probe_heard = b""
        return PROBE

    def _without_probe(self, data: bytes, now: float) -> bytes:
        """Look for the probe, which may have lost its first byte, or follow noise."""
        heard = self._probe_heard = self._probe_heard + data
        if heard[:1] == PROBE[:1] or 0 < heard.find(PROBE) <= NOISE:
            self._probe_answered(found=True, now=now)
            return data.replace(PROBE, b"", 1)
        return data

    def _probe_answered(self, *, found: bool, now: float) -> None:
        self._echo.mode = "expect" if found else "none"
        self.events.append(EchoFound(now, found))
        self._state = GUARD
        if found:  # the rest of the probe may still arrive
            self._suspect = True
            self._quiet_at = now + self.timing.on_wire(len(PROBE))
        self._give_up_at = now + self._quiet_limit

    def _without_echo(self, data: bytes, now: float) -> bytes:
        echo = self._echo
        broken, expected = echo.broken, echo.outstanding
        rest = echo.cancel(data)
        if echo.broken and not broken:  # reported once the frame itself can no longer follow
            self._break = EchoBroken(now, self._node, expected, data)
        return rest

    def _echo_missing(self, count: LinkCounters, node: int | None, now: float) -> None:
        count.missing_echoes += 1
        self.events.append(EchoBroken(now, node, self._echo.outstanding, b""))

    # Receiving ----------------------------------------------------------------------------------------------

    def _take_in(self, event: Framed | Fault, now: float) -> None:
        command = self._command
        if self._echo.broken and self._is_own(event):
            return
        if (
            self._state is WAITING
            and type(event) is command.response
            and now >= self._earliest
            and self._answers(command, event)
        ):
            self._succeed(event, now)
        elif is_message(event):
            self._stray(event, now)
        else:
            self._damaged(event, now)

    def _is_own(self, event: Framed | Fault) -> bool:
        return self._echo.is_own(self.codec.encode(event) if is_message(event) else event.raw)

    def _answers(self, command: CommandTiming, response: Framed) -> bool:
        """Whether a response of the right type answers the request."""
        request = self._request
        for name in command.echoes:
            if getattr(response, name) != getattr(request, name):
                return False
        if command.accepts is not None:
            return command.accepts(request, response)
        return self._address(response) == self._node or (
            command.answers_broadcast and self._node == self._bus.broadcast
        )

    def _stray(self, message: Framed, now: float) -> None:
        node = self._address(message)
        count = self.counters.get(node) or self.counters[None]
        asked = self._attempt > 0 and self._may_answer(self._command, self._node, message)
        late = asked or (self._earlier is not None and self._may_answer(*self._earlier, message))
        if asked and self._state is WAITING:
            self._wrong.append((message.NAME, self.codec.encode(message)))
        count.strays += 1
        count.late += late
        self.events.append(Stray(now, message, late))

    def _may_answer(self, command: CommandTiming, asked: int | None, message: Framed) -> bool:
        """Whether a message may be the answer of the asked node to an earlier attempt."""
        any_node = command.answers_broadcast and asked == self._bus.broadcast
        return type(message) is command.response and (any_node or self._address(message) == asked)

    def _damaged(self, fault: Fault, now: float) -> None:
        waiting = self._state is WAITING
        count = self._count if waiting else self.counters[None]
        count.count_damaged(fault.kind)
        if waiting:
            self._wrong.append((fault.kind, fault.raw))
        self.events.append(Damaged(now, self._node if waiting else None, fault))

    # The end of a transaction -------------------------------------------------------------------------------

    def _succeed(self, response: Framed | None, now: float) -> None:
        self._state = IDLE
        elapsed = now - self._started
        self._outcome = Reply(response, self._attempt, elapsed, now, now - self._sent_at)
        if response is None:
            return
        count = self._count
        count.answers += 1
        if self._echo.broken:
            count.partial_echoes += 1
            self.events.append(self._break)
            self._echo.forget()
        if self._attempt > 1:
            self._distrust(now)  # the answer to an earlier attempt may still arrive
        if self._paced and self.codec.encode(response)[-1:] != self._received[-1:]:
            self._free_at = now + self._byte_time  # the byte inserted after the last byte of the checksum
        if self.health.answered(self._node):
            self._tell_health(now)
        if self.verbose:
            event = Answered(now, self._node, self._request, response, self._attempt, elapsed)
            self.events.append(event)

    def _timed_out(self, now: float) -> None:
        self._count.timeouts += 1
        if self._echo.broken:
            self._count.collisions += 1
            self.events.append(self._break)
        elif self._echo.active:
            self._echo_missing(self._count, self._node, now)
            self._echo.forget()
        self.events.append(TimedOut(now, self._node, self._request, self._attempt))
        self._distrust(now)
        if self._attempt < self._tries:
            self._state = GUARD
        elif self._echo.broken:
            self._fail(Collision, "the echo of the request was changed: another station was sending too", now)
        elif self._wrong:
            kinds = ", ".join(sorted({kind for kind, _ in self._wrong}))
            self._fail(BadReply, f"received only invalid replies ({kinds})", now)
        else:
            self._fail(NoReply, "no answer", now)

    def _fail(self, error: type[LinkError], reason: str, now: float) -> None:
        elapsed = now - self._started
        node = "" if self._node is None else f" to node {self._node}"
        times = "once" if self._attempt == 1 else f"{self._attempt} times"
        received = b"".join(raw for _, raw in self._wrong) or self._received
        self._outcome = error(
            f"{self._request.NAME}{node}: {reason}; sent {times}, {elapsed * 1e3:.1f} ms",
            node=self._node,
            attempts=self._attempt,
            elapsed=elapsed,
            received=received[-64:],
        )
        self._state = IDLE
        self._count.failures += 1
        self.events.append(Failed(now, self._node, self._request, self._outcome))
        # A line that never becomes idle is not a failure of the node.
        if self._attempt and not self._trial and self.health.failed(self._node, now, elapsed + self._quiet):
            self._tell_health(now)

    def _look_at_health(self, now: float) -> None:
        """Refuse a request to an offline node, except for its trials."""
        health = self.health.offline(self._node)
        if health is None:
            return
        if now < health.next_trial:
            self._count.refused += 1
            self.events.append(Refused(now, self._node, self._request))
            raise NoReply(
                f"{self._request.NAME} to node {self._node}: not sent, since {health.failures} transactions "
                f"failed; next trial in {health.next_trial - now:.2f} s",
                node=self._node,
            )
        self._tries = 1

    def _tell_health(self, now: float) -> None:
        assert self._node is not None
        self.events.append(HealthChanged(now, self._node, self.health[self._node].state))
