"""Counts of what happened, for one node or for the bus. They only go up: read twice and subtract."""

from __future__ import annotations

from collections.abc import Iterable


class LinkCounters:
    """What a master has seen, of one node or of all.

    Attributes:
        requests: requests sent, repeats included.
        repeats: how many of them were repeats.
        answers: requests that were answered.
        timeouts: attempts that were not answered in time.
        failures: transactions that failed.
        refused: transactions that were not sent since the node is offline.
        damaged: damaged frames, by kind.
        strays: good frames that answered nothing.
        late: how many of them came too late.
        collisions: attempts that failed after what was sent had come back changed.
        partial_echoes: echoes that were not complete although the answer came.
        missing_echoes: requests whose echo did not come, or not to its end, and no answer either.
        skipped: bytes in no frame.
    """

    __slots__ = (
        "answers", "collisions", "damaged", "failures", "late", "missing_echoes", "partial_echoes",
        "refused", "repeats", "requests", "skipped", "strays", "timeouts",
    )  # fmt: skip

    def __init__(self) -> None:
        self.requests = 0
        self.repeats = 0
        self.answers = 0
        self.timeouts = 0
        self.failures = 0
        self.refused = 0
        self.damaged: dict[str, int] = {}
        self.strays = 0
        self.late = 0
        self.collisions = 0
        self.partial_echoes = 0
        self.missing_echoes = 0
        self.skipped = 0

    def count_damaged(self, kind: str) -> None:
        """Count one damaged frame."""
        self.damaged[kind] = self.damaged.get(kind, 0) + 1

    def as_dict(self) -> dict[str, int | dict[str, int]]:
        """Return the counts by name."""
        return {name: getattr(self, name) for name in self.__slots__}

    @classmethod
    def total(cls, parts: Iterable[LinkCounters]) -> LinkCounters:
        """Return the sum of several."""
        whole = cls()
        for part in parts:
            for name in cls.__slots__:
                if name != "damaged":
                    setattr(whole, name, getattr(whole, name) + getattr(part, name))
            for kind, count in part.damaged.items():
                whole.damaged[kind] = whole.damaged.get(kind, 0) + count
        return whole

    def __repr__(self) -> str:
        seen = ", ".join(f"{name}={value}" for name, value in self.as_dict().items() if value)
        return f"LinkCounters({seen})"
