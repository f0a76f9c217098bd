"""Waiting for a quiet line, so that a late answer is received before the next request is sent."""

from __future__ import annotations


class Silence:
    """A wait for silence, for a limited time.

    Attributes:
        quiet: required silence in seconds.
        limit: longest wait for it in seconds.
        quiet_at: time at which the line is quiet, if nothing is received until then.
        give_up_at: time at which the wait fails.
    """

    __slots__ = ("give_up_at", "limit", "quiet", "quiet_at")

    def __init__(self, quiet: float, limit: float) -> None:
        self.quiet = quiet
        self.limit = limit
        self.quiet_at = 0.0
        self.give_up_at = 0.0

    def due(self) -> float:
        """Return the time at which the wait ends, one way or the other."""
        return min(self.quiet_at, self.give_up_at)

    def failed(self, now: float) -> bool:
        """Whether the line has not become quiet in time."""
        return self.give_up_at <= now < self.quiet_at

    def disturbed(self, now: float, *, waiting: bool = True) -> None:
        """Restart the silence after received bytes; a wait gets its whole limit again if the caller is late.

        A process that did not run for some time reads old bytes now; only later bytes show the state of the
        line.
        """
        if waiting and now - self.due() > self.quiet:
            self.give_up_at = max(self.give_up_at, now + self.limit)
        self.quiet_at = max(self.quiet_at, now + self.quiet)


class QuietLine(Silence):
    """The line of a master, which has to be quiet only while a late answer may arrive.

    Attributes:
        free_at: earliest time to send: a broadcast is still on the line, or an answer may be.
        suspect: a late answer may arrive, so the line must be quiet first.
    """

    __slots__ = ("free_at", "suspect")

    def __init__(self, quiet: float, limit: float) -> None:
        super().__init__(quiet, limit)
        self.free_at = 0.0
        self.suspect = False

    def due(self) -> float:
        """Return the time of the next change without received bytes."""
        return max(self.free_at, super().due()) if self.suspect else self.free_at

    def ready(self, now: float) -> bool:
        """Whether a request may be sent."""
        return now >= self.free_at and (not self.suspect or now >= self.quiet_at)

    def failed(self, now: float) -> bool:
        """Whether a suspect line has not become quiet in time."""
        return self.suspect and super().failed(now)

    def await_quiet(self, now: float) -> None:
        """Begin a wait of limited time for a suspect line."""
        self.give_up_at = max(now, self.free_at) + self.limit

    def distrust(self, now: float) -> None:
        """Require silence from now on, since a late answer may arrive."""
        self.suspect = True
        self.quiet_at = now + self.quiet
        self.give_up_at = now + self.limit
