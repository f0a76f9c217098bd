"""Counts of a master, for one node or for the bus. They only increase: read twice and subtract."""

from __future__ import annotations

from collections.abc import Iterable


class LinkCounters:
    """Counts of a master, for one node or for all.

    Attributes:
        requests: requests sent, including repeats.
        repeats: repeats among them.
        answers: answered requests.
        timeouts: attempts not answered in time.
        failures: failed transactions.
        refusals: answers that refused a request.
        refused: transactions not sent because the node is offline.
        damaged: damaged frames, by kind.
        strays: valid frames that did not answer the pending request.
        late: strays that answered an earlier attempt or request.
        collisions: attempts that failed after a changed echo.
        partial_echoes: incomplete echoes followed by an answer.
        missing_echoes: requests with neither a complete echo nor an answer.
        skipped: bytes outside frames.
    """

    __slots__ = (
        "answers", "collisions", "damaged", "failures", "late", "missing_echoes", "partial_echoes",
        "refusals", "refused", "repeats", "requests", "skipped", "strays", "timeouts",
    )  # fmt: skip

    def __init__(self) -> None:
        self.requests = 0
        self.repeats = 0
        self.answers = 0
        self.timeouts = 0
        self.failures = 0
        self.refusals = 0
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
        """Return the sum of several counters."""
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
