"""What nodes of rings are made of: engines, an inbox, and who is told of events."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from logging import Logger

from qlinkgen.bus.options import RingEngineOptions
from qlinkgen.bus.ring_status import RingHandlers, paced_baud
from qlinkgen.bus.watching import log_event
from qlinkgen.link.codec import Framed
from qlinkgen.link.events import Frame
from qlinkgen.link.ring import RingCodec, RingNode
from qlinkgen.link.ring_events import Broken, Dropped, Passed, Queued, RingEvent, Taken
from qlinkgen.transport.port import Port
from qlinkgen.transport.ring_driver import OnEvent

#: Most messages that wait for `receive`; further ones are dropped, and reported as such.
INBOX = 1000


class Inbox:
    """The messages to a node that has no handlers, until they are received."""

    def __init__(self) -> None:
        self._messages: deque[Framed] = deque()
        self.node: RingNode | None = None

    def handle(self, message: Framed, now: float) -> None:
        """Keep a message, or drop it if they are not received."""
        if len(self._messages) < INBOX:
            self._messages.append(message)
        elif self.node is not None:
            text = f"{INBOX} messages wait already: call `receive`, or pass handlers"
            self.node.events.append(Dropped(now, message, text))

    def take(self, _now: float) -> Framed | None:
        """Remove and return the oldest message, None if there is none."""
        return self._messages.popleft() if self._messages else None


def make_node(
    codec: RingCodec, port: Port, handlers: RingHandlers | None, options: RingEngineOptions
) -> tuple[RingNode, Inbox]:
    """Make the engine of a node on a port, and the inbox of a node without handlers."""
    inbox = Inbox()
    taker = inbox if handlers is None else handlers
    node = RingNode(codec, taker.handle, baud=paced_baud(port), **options)
    inbox.node = node
    return node, inbox


def teller(
    codec: RingCodec,
    on_event: OnEvent | None,
    on_frame: Callable[[Frame], None] | None,
    logger: Logger | None,
) -> OnEvent | None:
    """Return who is told of each event of a node; None without one."""
    if on_event is None and on_frame is None and logger is None:
        return None

    def tell(event: RingEvent) -> None:
        if logger is not None:
            log_event(logger, event)
        if on_event is not None:
            on_event(event)
        if on_frame is not None and (frame := _frame_of(event, codec)) is not None:
            on_frame(frame)

    return tell


def _frame_of(event: RingEvent, codec: RingCodec) -> Frame | None:
    """Return the frame that an event is about, None for other events."""
    match event:
        case Taken(at, message, data):
            return Frame(at, False, data, message)
        case Passed(at, data):
            return Frame(at, False, data)
        case Queued(at, message):
            return Frame(at, True, codec.encode(message), message)
        case Broken(at, _, raw):
            return Frame(at, False, raw, None, event)
    return None
