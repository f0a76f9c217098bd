"""Additional events and counts of a host: resynchronisation with its device."""

from __future__ import annotations

from typing import NamedTuple

from qlinkgen.link.codec import Message
from qlinkgen.link.counters import LinkCounters


class OutOfStep(NamedTuple):
    """A reply was wrong: the device may have received something other than the packet sent."""

    at: float
    #: The pending request, None without one.
    request: Message | None
    reason: str
    received: bytes


class Filled(NamedTuple):
    """A byte was sent to complete a packet that the device may have received incompletely."""

    at: float
    byte: int


class InStep(NamedTuple):
    """The device has answered correctly: host and device agree on the start of packets."""

    at: float
    #: Number of fill bytes sent.
    fills: int
    #: The fill bytes have completed a packet, which the device has executed with a wrong value.
    completed: bool


class HostCounters(LinkCounters):
    """Counts of a host.

    Attributes:
        contexts: packets sent to select a context.
        illegal: answers that refuse a command.
        out_of_step: times that host and device got out of step.
        in_step: times that they got back in step.
        fills: fill bytes sent.
        completed: incomplete packets that the fill bytes completed.
    """

    __slots__ = ("completed", "contexts", "fills", "illegal", "in_step", "out_of_step")

    def __init__(self) -> None:
        super().__init__()
        self.contexts = 0
        self.illegal = 0
        self.out_of_step = 0
        self.in_step = 0
        self.fills = 0
        self.completed = 0

    def as_dict(self) -> dict[str, int | dict[str, int]]:
        """Return the counts by name."""
        return {name: getattr(self, name) for name in (*LinkCounters.__slots__, *self.__slots__)}

    def __repr__(self) -> str:
        seen = ", ".join(f"{name}={value}" for name, value in self.as_dict().items() if value)
        return f"HostCounters({seen})"
