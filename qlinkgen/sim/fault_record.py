"""Effects of faults on a transmission, and their counts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple, TypedDict

from qlinkgen.sim.fault_kinds import KINDS

TO_SLAVES: Final = "to_slaves"
TO_MASTER: Final = "to_master"
Direction = Literal["to_slaves", "to_master"]


class Disturbed(NamedTuple):
    """One disturbed transmission.

    Attributes:
        data: the remaining bytes, b"" if none.
        lead: number of bytes lost at its head, which still take line time.
        tail: number of bytes lost at its tail.
        wait: delay in seconds.
        again: seconds from its end to its repetition, None without one.
        before: noise and strays before it, without gaps.
        after: noise and strays after it, each with the seconds from its end.
    """

    data: bytes
    lead: int = 0
    tail: int = 0
    wait: float = 0.0
    again: float | None = None
    before: Sequence[bytes] = ()
    after: Sequence[tuple[float, bytes]] = ()


class Injected(NamedTuple):
    """One injected fault.

    Attributes:
        at: time of the transmission in seconds.
        kind: name of the fault.
        direction: direction of the transmission, "to_slaves" or "to_master".
        data: the bytes concerned: lost, remaining, changed, repeated, or extra ones.
    """

    at: float
    kind: str
    direction: str
    data: bytes


class PlainCounts(TypedDict):
    """Counts of faults in plain types."""

    to_slaves: dict[str, int]
    to_master: dict[str, int]
    silenced: int


class FaultCounts:
    """Counts of injected faults.

    Attributes:
        to_slaves: by kind, in transmissions of the master.
        to_master: by kind, in transmissions of slaves. "silent" counts periods of silence.
        silenced: answers suppressed in periods of silence, including the first of each.
    """

    __slots__ = ("silenced", "to_master", "to_slaves")

    def __init__(self) -> None:
        self.to_slaves = dict.fromkeys(KINDS, 0)
        self.to_master = dict.fromkeys(KINDS, 0)
        self.silenced = 0

    def __getitem__(self, kind: str) -> int:
        """Return the count of a kind in both directions."""
        return self.to_slaves[kind] + self.to_master[kind]

    @property
    def total(self) -> int:
        """Number of faults of all kinds."""
        return sum(self.to_slaves.values()) + sum(self.to_master.values())

    def as_dict(self) -> PlainCounts:
        """Return everything in plain types."""
        return {TO_SLAVES: dict(self.to_slaves), TO_MASTER: dict(self.to_master), "silenced": self.silenced}

    def __repr__(self) -> str:
        return f"FaultCounts({', '.join(f'{kind}={self[kind]}' for kind in KINDS if self[kind])})"
