"""Silences that end frames, where nothing else does."""

from __future__ import annotations

from qlinkgen.link.codec import Module


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

    __slots__ = ("due", "span")

    def __init__(self, span: float) -> None:
        self.span = span
        self.due: float | None = None

    def heard(self, now: float) -> None:
        """Restart the silence after received bytes."""
        if self.span:
            self.due = now + self.span

    def passed(self, now: float) -> bool:
        """Whether the silence is over; once for each."""
        if self.due is None or now < self.due:
            return False
        self.due = None
        return True

    def before(self, other: float | None) -> float | None:
        """The earlier of two times, either of which may be missing."""
        if self.due is None or other is None:
            return other if self.due is None else self.due
        return min(self.due, other)
