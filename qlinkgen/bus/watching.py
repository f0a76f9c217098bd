"""Tells of events and frames: to functions of the user, and to a logger."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from typing import Protocol

from qlinkgen.link.events import (
    EVENTS_KEPT,
    Answered,
    Damaged,
    EchoBroken,
    EchoFound,
    Event,
    Failed,
    Frame,
    HealthChanged,
    OtherAnswer,
    Refused,
    Sent,
    Stray,
    TimedOut,
)
from qlinkgen.link.ring_events import (
    Blocked,
    Broken,
    Dropped,
    Passed,
    Queued,
    RingEvent,
    StatusRaised,
    Taken,
)
from qlinkgen.transport.conversation import Asker, MasterDriver

#: Levels of events; what is not listed is expected on a line, and for debugging.
_LEVELS: dict[type[Event | RingEvent], int] = {
    Failed: logging.WARNING,
    HealthChanged: logging.WARNING,
    EchoBroken: logging.INFO,
    TimedOut: logging.INFO,
    Refused: logging.INFO,
    Damaged: logging.INFO,
    Stray: logging.INFO,
    Dropped: logging.WARNING,
    StatusRaised: logging.WARNING,
    Broken: logging.INFO,
    Blocked: logging.INFO,
}
#: Texts of events, with their values.
_TEXTS: dict[type[Event | RingEvent], str] = {
    Sent: "sent {request}",
    Answered: "{request} answered by {response}",
    OtherAnswer: "{request} answered by {reply}: {means}",
    TimedOut: "{request} not answered in time",
    Failed: "{request} failed: {error}",
    Refused: "{request} not sent: the node is offline",
    Stray: "stray {message}",
    Damaged: "damaged frame: {fault}",
    EchoFound: "echo of the adapter: {echo}",
    EchoBroken: "echo of the adapter is broken",
    HealthChanged: "node {node} is {state}",
    Taken: "taken {message}",
    Passed: "passed {frame}",
    Queued: "sent {message}",
    Broken: "broken message: {text}",
    Blocked: "blocked {header}",
    Dropped: "dropped {message}: {text}",
    StatusRaised: "status {bit}",
}


class Tracing(Protocol):
    """An engine that can tell of each frame."""

    frames: deque[Frame] | None


class TracingAsker(Asker, Tracing, Protocol):
    """An engine that sends requests, and can tell of each frame."""


def trace(engine: Tracing, on_frame: Callable[[Frame], None] | None) -> None:
    """Let an engine keep its frames if somebody is told of them."""
    engine.frames = None if on_frame is None else deque(maxlen=EVENTS_KEPT)


def tell_frames(engine: Tracing, on_frame: Callable[[Frame], None] | None) -> None:
    """Tell of each frame since the last call."""
    while on_frame is not None and engine.frames:
        on_frame(engine.frames.popleft())


def log_event(logger: logging.Logger, event: Event | RingEvent) -> None:
    """Write an event to a logger.

    The record has the name of the event as its attribute `event`, and the values of the event under their
    names: messages as their names, bytes as hex digits; a message has the name of its event: `stray`.
    """
    level = _LEVELS.get(type(event), logging.DEBUG)
    if not logger.isEnabledFor(level):
        return
    values = {name: _plain(value) for name, value in event._asdict().items()}
    text = _TEXTS.get(type(event), type(event).__name__).format(**values)
    if "message" in values:  # a record has an attribute of that name
        values[type(event).__name__.lower()] = values.pop("message")
    logger.log(level, "%s", text, extra={"event": type(event).__name__, **values})


def _plain(value: object) -> object:
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, Exception):
        return str(value)
    if isinstance(value, int | float | str | None):
        return value
    return getattr(value, "NAME", None) or getattr(value, "message", value)


class Watched(MasterDriver):
    """A driver that also tells of frames, and writes events to a logger.

    Attributes:
        on_frame: called with each frame; None, unless somebody is told of them.
        logger: gets a record of each event; None, unless events are logged.
    """

    engine: TracingAsker
    on_frame: Callable[[Frame], None] | None = None
    logger: logging.Logger | None = None

    def watch(self, on_frame: Callable[[Frame], None] | None, logger: logging.Logger | None) -> None:
        """Tell of frames and log events from now on."""
        self.on_frame, self.logger = on_frame, logger
        trace(self.engine, on_frame)
        self.engine.verbose = self._tells

    @property
    def _tells(self) -> bool:
        return self.logger is not None or super()._tells

    def _report(self) -> None:
        if self.logger is not None:
            for event in self.engine.events:
                log_event(self.logger, event)
        super()._report()
        if self.on_frame is not None:
            tell_frames(self.engine, self.on_frame)
