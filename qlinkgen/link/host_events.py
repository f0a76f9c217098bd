"""What happens between a host and its device beside what happens on every line, and the counts of it."""

from __future__ import annotations

from typing import NamedTuple

from qlinkgen.link.codec import Message
from qlinkgen.link.counters import LinkCounters


class OutOfStep(NamedTuple):
    """What came does not fit: what was sent may have reached the device as something else."""

    at: float
    #: Request that was under way, None where none was.
    request: Message | None
    reason: str
    received: bytes


class Filled(NamedTuple):
    """A byte was sent to fill up a packet of which the device may not have everything."""

    at: float
    byte: int


class InStep(NamedTuple):
    """The device has answered as it must: host and device agree on where a packet begins."""

    at: float
    #: Bytes that were sent to fill up.
    fills: int
    #: An unfinished packet was filled up, and so the device has carried out something that nobody wanted.
    completed: bool


class HostCounters(LinkCounters):
    """What a host has seen of its device.

    Attributes:
        contexts: packets that were sent to make another context current.
        illegal: answers that refuse a command.
        out_of_step: times that something came that does not fit.
        in_step: times that host and device came to agree again.
        fills: bytes that were sent for that.
        completed: unfinished packets that were filled up by them.
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
