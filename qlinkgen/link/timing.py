"""Computes all deadlines.

A transaction fails when this time has passed since the request was handed to the port::

    deadline = time on the wire  +  the protocol's allowance  +  host slack
               request and          for the slave to begin       delay of driver, adapter
               longest answer       its answer                   and operating system

After a failed attempt the line has to be quiet before the next one, so that a late answer is received and
discarded before the next request is sent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from qlinkgen.link.codec import Command, Framed, Many, Module, OtherReply, StepSpan, meanings
from qlinkgen.link.echo import PROBE
from qlinkgen.link.gaps import break_of, idle_of, silence_of

#: Byte times after which a line counts as quiet; also Q.link's response time.
QUIET_BYTES = 3


@dataclass(frozen=True, slots=True)
class Timing:
    """The terms of every deadline on one bus, all in seconds.

    Attributes:
        baud: speed of the line in bits per second.
        bits_per_byte: bits of one byte on the line, including start and stop bits.
        host_slack: largest delay that driver, adapter and operating system add to a transaction; derived from
            the port if possible, see `qlinkgen doctor`.
        longest_frame: size of the longest frame of the protocol on the wire.
        paced: bytes are transmitted at the baud rate; not so on a pty, where they arrive at once.
        attempts: number of transmissions of a request that may be repeated.
        longest_allowance: longest allowance of any command of the protocol.
        silence: wait for the idle line that ends a frame, delays of the host included; 0 if frames end
            otherwise.
        line_break: seconds of the break that begins each frame, 0 without one.
        idle: silence that receivers need between two frames, whatever else ends one; 0 without one.
    """

    baud: int
    bits_per_byte: int
    host_slack: float
    longest_frame: int
    paced: bool = True
    attempts: int = 3
    longest_allowance: float = 0.0
    silence: float = 0.0
    line_break: float = 0.0
    idle: float = 0.0

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if not self.baud > 0:
            raise ValueError(f"baud must be 1 or more, not {self.baud}")
        if not 0 <= self.host_slack < float("inf"):
            raise ValueError(f"host_slack must be 0 s or more, not {self.host_slack}")
        check_attempts(self.attempts)

    @classmethod
    def of(
        cls,
        codec: Module,
        *,
        host_slack: float,
        baud: int | None = None,
        paced: bool = True,
        attempts: int = 3,
    ) -> Timing:
        """Make the timing of a protocol; `baud` is by default that of the schema."""
        speed = baud if baud is not None else codec.BUS.baud
        if speed is None:
            raise ValueError("the schema states no speed; pass baud")
        commands = codec.COMMANDS.values()
        if not commands:
            raise ValueError("the schema has no commands, so it has no deadlines")
        longest = max(*map(_longest_request, commands), *map(_longest_answer, commands))
        plain = cls(speed, codec.BUS.bits_per_byte, host_slack, longest, paced, attempts)
        idle = idle_of(codec, plain.byte_time)
        silence = idle + host_slack if silence_of(codec, plain.byte_time) else 0.0
        allowance = max(map(plain.allowance, commands))
        broken = break_of(codec, plain.byte_time)
        return replace(plain, longest_allowance=allowance, silence=silence, line_break=broken, idle=idle)

    @property
    def byte_time(self) -> float:
        """Duration of one byte on the line."""
        return self.bits_per_byte / self.baud

    def on_wire(self, size: int) -> float:
        """Return the duration of `size` bytes on the line."""
        return size * self.byte_time

    def allowance(self, command: Command) -> float:
        """Return the time that the protocol allows a slave before its answer."""
        return float(command.response_byte_times) * self.byte_time + float(command.response_seconds)

    def deadline(self, command: Command, request_size: int | None = None) -> float:
        """Return the time from sending a request of `request_size` bytes until its answer must be complete.

        Without a size, the longest request of the command counts. 0 for a command without a response.
        """
        if command.response is None:
            return 0.0
        sent = command.request.MAX_WIRE_SIZE if request_size is None else request_size
        size = sent + _longest_answer(command)
        return self.on_wire(size) + self.allowance(command) + self.slack

    def patience(self, command: Command, reply: OtherReply) -> float:
        """Return the time from a pending reply to the answer."""
        if reply.within is None or command.response is None:
            return self.deadline(command, 0)
        byte_times, seconds = reply.within
        allowance = self._time(byte_times, seconds) + self.slack
        return self.on_wire(_longest_answer(command)) + allowance

    def duration(self, many: Many) -> float:
        """Return the time in which several answers come, if that is their end."""
        return self._time(*many.within) if many.within is not None else 0.0

    def further(self, command: Command) -> float:
        """Return the time from one answer to the next, if another command stops them."""
        within: StepSpan | None = getattr(command.many, "next_within", None)
        if within is None:
            return self.deadline(command, 0)
        return self.on_wire(_longest_answer(command)) + self._time(*within) + self.slack

    def step(self, step: tuple[str, type[Framed], StepSpan | None]) -> float:
        """Return the time until a frame of a dialogue is complete, after the one before it."""
        _, message, within = step
        allowance = self._time(*within or (0.0, 0.0)) + self.slack
        return self.on_wire(message.MAX_WIRE_SIZE) + allowance

    def pause(self, reply: OtherReply) -> float:
        """Return the time until a request is sent again, if a reply asks for it."""
        return self._time(*reply.after)

    @property
    def slack(self) -> float:
        """Seconds that the host, and a silence or break of the frame, add to the bytes of an answer."""
        return self.host_slack + self.silence + self.line_break

    def _time(self, byte_times: float, seconds: float) -> float:
        return byte_times * self.byte_time + seconds

    @property
    def quiet(self) -> float:
        """Required silence on the line after a failed attempt."""
        return self.on_wire(QUIET_BYTES) + self.host_slack

    @property
    def quiet_limit(self) -> float:
        """Longest wait for that silence; enough for a late answer of full length."""
        return 2 * self.quiet + self.on_wire(self.longest_frame)

    def gap(self, command: Command) -> float:
        """Return the pause for slaves after a request without a response."""
        return max(self.allowance(command), self.silence, self.idle)

    def attempts_of(self, command: Command, attempts: int | None = None) -> int:
        """Return the largest number of transmissions of a request: 1 if it is unsafe to repeat."""
        wanted = self.attempts if attempts is None else check_attempts(attempts)
        return wanted if command.repeat_safe and command.response is not None else 1

    def worst_case(self, command: Command, attempts: int | None = None) -> float:
        """Return the longest duration of a call in seconds, for any traffic on the line.

        Infinite for several answers whose end the device decides; the duration to the first one if another
        command stops them. Functions that make frames take no time.

        The first term is the delay before the first attempt: an aborted request that may still be answered (a
        broadcast that is still being sent takes less), or the probe for an echo, with a quiet line before it.
        """
        given_up = self.on_wire(2 * self.longest_frame) + self.longest_allowance + self.host_slack
        search = self.quiet_limit + self.on_wire(len(PROBE)) + self.quiet
        before = self.quiet_limit + self.idle
        attempt = before + self.deadline(command)
        for step in command.steps:
            attempt += self.step(step) + (before if step[0] == "send" else 0.0)
        many = command.many
        if many is not None:
            endless = many.until is not None or many.reply is not None
            further = max(many.count - 1, 0) * self.deadline(command)
            attempt += float("inf") if endless else further + self.duration(many)
        tries = self.attempts_of(command, attempts)
        for reply in command.replies.values():
            if "again" in meanings(reply):
                tries = self.attempts if attempts is None else attempts
                attempt += self.pause(reply)
            if "pending" in meanings(reply):
                attempt += self.patience(command, reply)
        return max(given_up, search) + tries * attempt


def _longest_answer(command: Command) -> int:
    """Return the size of the longest answer on the wire, 0 without one."""
    answers = [command.response, *(reply.message for reply in command.replies.values())]
    answers += [message for who, message, _ in command.steps if who == "receive"]
    return max((answer.MAX_WIRE_SIZE for answer in answers if answer is not None), default=0)


def _longest_request(command: Command) -> int:
    """Return the size of the longest frame of a master on the wire."""
    messages = [command.request, *(message for who, message, _ in command.steps if who == "send")]
    return max(int(message.MAX_WIRE_SIZE) for message in messages)


def check_attempts(attempts: int) -> int:
    """Return the number of attempts if it is valid."""
    if type(attempts) is not int or attempts < 1:
        raise ValueError(f"attempts must be 1 or more, the first included, not {attempts!r}")
    return attempts
