"""Silences that end frames, where nothing else does."""

from __future__ import annotations

import math

from qlinkgen.link.codec import Module

#: Seconds of silence after which a slave no longer awaits the rest of a frame: longer than drivers, adapters
#: and programs delay its bytes, and shorter than most masters await an answer before they ask again.
ABANDONED = 0.1


def idle_of(codec: Module, byte_time: float) -> float:
    """Seconds of the idle line between two frames of a protocol, 0 if they may follow each other."""
    idle: tuple[float, float] | None = getattr(codec, "IDLE", None)
    return 0.0 if idle is None else max(idle[0] * byte_time, idle[1])


def silence_of(codec: Module, byte_time: float) -> float:
    """Seconds of the idle line that alone ends a frame of a protocol, 0 if something else does."""
    return idle_of(codec, byte_time) if getattr(codec, "IDLE_ALONE", False) else 0.0


def break_of(codec: Module, byte_time: float) -> float:
    """Seconds of the break that begins each frame of a protocol, 0 without one."""
    duration: tuple[float, float] | None = getattr(codec, "BREAK", None)
    return 0.0 if duration is None else max(duration[0] * byte_time, duration[1])


class Gap:
    """The time at which the line has been idle for long enough to end a frame.

    Attributes:
        span: seconds of that silence; 0 where frames end otherwise, and no time is kept.
        due: when the line will have been idle, None if no bytes wait for it.
    """

    __slots__ = ("_abandoned", "_heard_at", "due", "span")

    def __init__(self, span: float, abandoned: float = math.inf) -> None:
        """``abandoned``: seconds after which the rest of a frame no longer comes, whatever ends it."""
        self.span = span
        self._abandoned = abandoned
        self._heard_at = math.inf
        self.due: float | None = None

    def heard(self, now: float) -> None:
        """Restart the silence after received bytes."""
        self._heard_at = now
        if self.span:
            self.due = now + self.span

    def passed(self, now: float) -> bool:
        """Whether the silence is over; once for each."""
        if self.due is None or now < self.due:
            return False
        self.due = None
        return True

    def ended(self, now: float) -> bool:
        """Whether bytes received now begin a frame: the silence before them is over, or was so long."""
        return self.passed(now) or now - self._heard_at > self._abandoned

    def before(self, other: float | None) -> float | None:
        """The earlier of two times, either of which may be missing."""
        if self.due is None or other is None:
            return other if self.due is None else self.due
        return min(self.due, other)
