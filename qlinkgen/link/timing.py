"""How long to wait, as arithmetic that anyone can follow.

A transaction is given up when the following time has passed since the request was handed to the port::

    deadline = time on the wire  +  the protocol's allowance  +  host slack
               request, and the     what the slave may take      what driver, adapter and
               longest answer       before it answers            operating system add

Before each attempt the line has to be quiet where the one before has failed, so that an answer that comes too
late is heard and thrown away before the next question is asked.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from qlinkgen.link.codec import Command, Module
from qlinkgen.link.echo import PROBE

#: A receiver needs as long to know that a line is quiet; three byte times are also Q.link's response time.
QUIET_BYTES = 3


@dataclass(frozen=True, slots=True)
class Timing:
    """The terms of every deadline on one bus, all in seconds.

    Attributes:
        baud: speed of the line in bits a second.
        bits_per_byte: bits that one byte takes on the line, start and stop bits included.
        host_slack: what driver, adapter and operating system may add to a transaction. The port knows it
            where it can be known; see `qlinkgen doctor`.
        longest_frame: most bytes of any frame of the protocol on the wire.
        paced: bytes take their time on the line. Not so on a pty, where they arrive at once.
        attempts: how often a request is sent before it has failed, where it may be repeated.
        longest_allowance: most time that any command of the protocol gives a slave before it answers.
    """

    baud: int
    bits_per_byte: int
    host_slack: float
    longest_frame: int
    paced: bool = True
    attempts: int = 3
    longest_allowance: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what no deadline can be computed from."""
        if not self.baud > 0:
            raise ValueError(f"baud: {self.baud} was given; a line needs at least 1 bit a second")
        if not 0 <= self.host_slack < float("inf"):
            raise ValueError(f"host_slack: {self.host_slack} was given; give seconds, 0 or more")
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
        """Make the timing of a protocol; `baud` is that of the schema unless given."""
        speed = baud if baud is not None else codec.BUS.baud
        if speed is None:
            raise ValueError("baud: the schema names no usual speed, so give one")
        commands = codec.COMMANDS.values()
        if not commands:
            raise ValueError("codec: the schema has no commands, so there is nothing to wait for")
        messages = (message for command in commands for message in (command.request, command.response))
        longest = max(message.MAX_WIRE_SIZE for message in messages if message is not None)
        plain = cls(speed, codec.BUS.bits_per_byte, host_slack, longest, paced, attempts)
        return replace(plain, longest_allowance=max(map(plain.allowance, commands)))

    @property
    def byte_time(self) -> float:
        """Time of one byte on the line."""
        return self.bits_per_byte / self.baud

    def on_wire(self, size: int) -> float:
        """Time of `size` bytes on the line."""
        return size * self.byte_time

    def allowance(self, command: Command) -> float:
        """Time that the protocol gives a slave before it answers."""
        return float(command.response_byte_times) * self.byte_time + float(command.response_seconds)

    def deadline(self, command: Command, request_size: int | None = None) -> float:
        """Time from handing over a request of `request_size` bytes until its answer must be complete.

        Without a size the longest request of the command counts. 0 where nothing answers.
        """
        if command.response is None:
            return 0.0
        sent = command.request.MAX_WIRE_SIZE if request_size is None else request_size
        size = sent + command.response.MAX_WIRE_SIZE
        return self.on_wire(size) + self.allowance(command) + self.host_slack

    @property
    def quiet(self) -> float:
        """Silence that the line must show after a failed attempt before anything is sent."""
        return self.on_wire(QUIET_BYTES) + self.host_slack

    @property
    def quiet_limit(self) -> float:
        """How long that silence is waited for; a late answer of full length fits in."""
        return 2 * self.quiet + self.on_wire(self.longest_frame)

    def gap(self, command: Command) -> float:
        """Time that slaves get after a request that nothing answers, before the next one begins."""
        return self.allowance(command)

    def attempts_of(self, command: Command, attempts: int | None = None) -> int:
        """How often a request is sent at most: once where it must not be repeated."""
        wanted = self.attempts if attempts is None else check_attempts(attempts)
        return wanted if command.repeat_safe and command.response is not None else 1

    def worst_case(self, command: Command, attempts: int | None = None) -> float:
        """Most seconds that a call can take, whatever is on the line.

        The first term is what may be in the way of the first attempt: a request that was given up and may
        still be answered (a broadcast that is still being sent takes less), or the search for an echo, with
        a quiet line before it.
        """
        given_up = self.on_wire(2 * self.longest_frame) + self.longest_allowance + self.host_slack
        search = self.quiet_limit + self.on_wire(len(PROBE)) + self.quiet
        attempt = self.quiet_limit + self.deadline(command)
        return max(given_up, search) + self.attempts_of(command, attempts) * attempt


def check_attempts(attempts: int) -> int:
    """Return the number of tries, if it is one."""
    if type(attempts) is not int or attempts < 1:
        raise ValueError(f"attempts: {attempts!r} was given; it counts all tries, so give 1 or more")
    return attempts
