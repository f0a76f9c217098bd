"""What faults do to a transmission, and the account of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple, TypedDict

from qlinkgen.sim.fault_kinds import KINDS

TO_SLAVES: Final = "to_slaves"
TO_MASTER: Final = "to_master"
Direction = Literal["to_slaves", "to_master"]


class Disturbed(NamedTuple):
    """What becomes of one transmission.

    Attributes:
        data: what is left of it, b"" for nothing.
        lead: bytes lost at its head; they take their time all the same.
        tail: bytes lost at its tail.
        wait: seconds that it begins late.
        again: seconds from its end until it is sent once more, None for never.
        before: noise and strays that come first, one right behind the other.
        after: noise and strays that follow, each with its seconds from the end.
    """

    data: bytes
    lead: int = 0
    tail: int = 0
    wait: float = 0.0
    again: float | None = None
    before: Sequence[bytes] = ()
    after: Sequence[tuple[float, bytes]] = ()


class Injected(NamedTuple):
    """One fault that was injected.

    Attributes:
        at: seconds, the time of the transmission that it befell.
        kind: name of the fault.
        direction: where that transmission was going, "to_slaves" or "to_master".
        data: the bytes concerned: lost, left, changed, repeated, or extra ones.
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
    """How often each kind of fault was injected.

    Attributes:
        to_slaves: by kind, in what the master sent.
        to_master: by kind, in what slaves sent. "silent" counts the times of silence.
        silenced: answers that were swallowed in times of silence, the first of each included.
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
        """All faults of all kinds."""
        return sum(self.to_slaves.values()) + sum(self.to_master.values())

    def as_dict(self) -> PlainCounts:
        """Return everything in plain types."""
        return {TO_SLAVES: dict(self.to_slaves), TO_MASTER: dict(self.to_master), "silenced": self.silenced}

    def __repr__(self) -> str:
        return f"FaultCounts({', '.join(f'{kind}={self[kind]}' for kind in KINDS if self[kind])})"
