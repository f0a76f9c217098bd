"""How long a host waits for a device that has no time of its own."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

from qlinkgen.link.codec import Command, Module
from qlinkgen.link.timing import QUIET_BYTES, Timing

#: Times that getting back in step is tried in one transaction ...
ROUNDS = 5
#: ... and how many of them may be without any answer: then the device is not there.
SILENT_ROUNDS = 3
#: After one of these the line has to be quiet so many times as long: an answer may be very late.
PATIENCE = 4
#: Filling bytes that may get lost, or be lost in a packet that noise has begun.
SPARE = 4


@dataclass(frozen=True, slots=True)
class HostTiming(Timing):
    """The terms of every deadline between a host and its device, all in seconds.

    Attributes:
        forgets: silence after which the device forgets a packet of which not everything has come; 0 where it
            never does.
    """

    forgets: float = 0.0

    @classmethod
    def for_host(
        cls, codec: Module, *, baud: int, host_slack: float, paced: bool, attempts: int, forgets: float
    ) -> Self:
        """Make the timing of a protocol; see `Timing.of`."""
        if not 0 <= forgets < float("inf"):
            raise ValueError(
                f"forgets: {forgets} was given; give seconds, or 0 for a device that never forgets"
            )
        plain = Timing.of(codec, baud=baud, host_slack=host_slack, paced=paced, attempts=attempts)
        terms = {each.name: getattr(plain, each.name) for each in fields(plain)}
        return cls(**terms, forgets=forgets)

    @property
    def quiet(self) -> float:
        """Silence that the line must show after anything that does not fit."""
        return max(self.on_wire(QUIET_BYTES), self.forgets) + self.host_slack

    def quiet_after(self, silent: int) -> float:
        """Return the silence that the line must show after so many rounds without any answer."""
        return float(self.quiet * PATIENCE**silent)

    def fills(self, longest_request: int) -> int:
        """How many bytes are sent at most to fill up a packet of which not everything has come."""
        return longest_request - 1 + SPARE

    def fill_deadline(self, answer: int) -> float:
        """Time from handing over one byte until an answer of `answer` bytes must be complete."""
        return self.on_wire(1 + answer) + self.host_slack

    def worst_case(self, command: Command, attempts: int | None = None) -> float:
        """Most seconds that a call can take, whatever is on the line.

        Each attempt may need a context before it, and each of them, or a round that fails, the whole way back
        into step: a quiet line, every filling byte, and two packets as the proof.
        """
        packet = self.on_wire(2 * self.longest_frame) + self.longest_allowance + self.host_slack
        fills = self.fills(self.longest_frame) * self.fill_deadline(self.longest_frame)
        quiet = self.quiet_after(SILENT_ROUNDS - 1)
        back = 2 * quiet + self.on_wire(self.longest_frame) + fills + 2 * packet
        return packet + (self.attempts_of(command, attempts) + ROUNDS) * (back + 2 * packet)
