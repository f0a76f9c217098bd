"""Deadlines of a host and of its resynchronisation."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

from qlinkgen.link.codec import Command, Module
from qlinkgen.link.timing import QUIET_BYTES, Timing

#: Most rounds of resynchronisation in one transaction ...
ROUNDS = 5
#: ... and most rounds without any received byte: then the device is absent.
SILENT_ROUNDS = 3
#: Factor of the quiet time after each silent round: an answer may be very late.
PATIENCE = 4
#: Additional fill bytes, which may get lost or belong to a packet begun by noise.
SPARE = 4


@dataclass(frozen=True, slots=True)
class HostTiming(Timing):
    """The terms of every deadline between a host and its device, all in seconds.

    Attributes:
        forgets: silence after which the device discards an incomplete packet; 0 if it never does.
    """

    forgets: float = 0.0

    @classmethod
    def for_host(
        cls, codec: Module, *, baud: int, host_slack: float, paced: bool, attempts: int, forgets: float
    ) -> Self:
        """Make the timing of a protocol; see `Timing.of`."""
        if not 0 <= forgets < float("inf"):
            raise ValueError(
                f"forgets must be seconds, or 0 for a device that never discards a packet, not {forgets}"
            )
        plain = Timing.of(codec, baud=baud, host_slack=host_slack, paced=paced, attempts=attempts)
        terms = {each.name: getattr(plain, each.name) for each in fields(plain)}
        return cls(**terms, forgets=forgets)

    @property
    def quiet(self) -> float:
        """Required silence after a wrong reply."""
        return max(self.on_wire(QUIET_BYTES), self.forgets) + self.host_slack

    def quiet_after(self, silent: int) -> float:
        """Return the required silence after a number of rounds without any received byte."""
        return float(self.quiet * PATIENCE**silent)

    def fills(self, longest_request: int) -> int:
        """Return the largest number of fill bytes for an incomplete packet."""
        return longest_request - 1 + SPARE

    def fill_deadline(self, answer: int) -> float:
        """Return the time from sending one byte until an answer of `answer` bytes must be complete."""
        return self.on_wire(1 + answer) + self.host_slack

    def worst_case(self, command: Command, attempts: int | None = None) -> float:
        """Return the longest duration of a call in seconds, for any traffic on the line.

        Each attempt may need a context before it, and after each failure a full resynchronisation: a quiet
        line, all fill bytes, and two packets to verify it.
        """
        packet = self.on_wire(2 * self.longest_frame) + self.longest_allowance + self.host_slack
        fills = self.fills(self.longest_frame) * self.fill_deadline(self.longest_frame)
        quiet = self.quiet_after(SILENT_ROUNDS - 1)
        back = 2 * quiet + self.on_wire(self.longest_frame) + fills + 2 * packet
        return packet + (self.attempts_of(command, attempts) + ROUNDS) * (back + 2 * packet)
