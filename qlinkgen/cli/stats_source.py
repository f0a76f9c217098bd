"""What happened on the line of a capture: the events of a monitor, or messages alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from decimal import Decimal
from types import ModuleType
from typing import assert_never

from qlinkgen.captures.records import NANO, Record
from qlinkgen.captures.statistics import Seen, What
from qlinkgen.cli.decode import means, message_record
from qlinkgen.cli.filters import Filter
from qlinkgen.cli.streams import Bad
from qlinkgen.cli.traffic import Placed
from qlinkgen.link.codec import Framed, Message, address_of
from qlinkgen.link.events import Damaged, Stray
from qlinkgen.link.monitor import Asked, Heard, Monitor, Replied, Unanswered
from qlinkgen.link.timing import Timing
from qlinkgen.link.transaction import Accepts
from qlinkgen.model.message import Direction
from qlinkgen.model.protocol import Protocol

#: Delay in seconds that the program which recorded may add to an answer.
SLACK = 0.02


_WHATS: Mapping[Direction, What] = {"request": "request", "response": "response", "message": "message"}


class Told:
    """Turns messages and faults into events of statistics."""

    def __init__(self, protocol: Protocol, wanted: Filter) -> None:
        """Leave out what a filter does not keep."""
        self._protocol, self._wanted = protocol, wanted
        self._commands = {
            message.name: command.name
            for message in protocol.messages
            if (command := protocol.command_of(message)) is not None
        }

    def keeps(self, message: Message, at: int | None) -> bool:
        """Whether a message is counted."""
        if not self._wanted.chooses:
            return True
        record = message_record(self._protocol, message)
        if at is not None:
            record["time"] = Decimal(at).scaleb(-9)
        return self._wanted.keeps(record)

    def name(self, message: Message) -> str:
        """Return the command of a message, or its name."""
        return self._commands.get(message.NAME, message.NAME)

    def refused(self, message: Message) -> bool:
        """Whether an answer refuses."""
        reply = self._protocol.replies.get(message.NAME)
        return reply is not None and means(reply, message) == "refused"


def heard_on_bus(
    protocol: Protocol,
    codec: ModuleType,
    records: Iterable[Record],
    wanted: Filter,
    *,
    baud: int,
    accepts: Mapping[str, Accepts] | None,
) -> Iterator[Seen]:
    """Return the events of a bus: requests with their answers, repeats, late and missing ones."""
    listening = Listening(codec, Timing.of(codec, host_slack=SLACK, baud=baud), accepts)
    told = Told(protocol, wanted)
    for heard in listening.heard(records):
        start = listening.start
        seen = _event(heard, told, None if start is None else start + round(heard.at * NANO))
        if seen is not None:
            yield seen


class Listening:
    """A monitor that listens to a capture.

    Captures without times are read as if bytes came one after the other.

    Attributes:
        monitor: it decodes.
        start: nanoseconds at 0 of the times of events; None if the capture has none.
    """

    def __init__(self, codec: ModuleType, timing: Timing, accepts: Mapping[str, Accepts] | None) -> None:
        self.monitor = Monitor(codec, timing, accepts=accepts)
        self.start: int | None = None
        self._timing = timing

    def heard(self, records: Iterable[Record]) -> Iterator[Heard]:
        """Return what is heard, with times in seconds since the first record."""
        timing, heard = self._timing, self.monitor.heard
        first: int | None = None
        now = 0.0
        for record in records:
            if record.at is None:
                now += timing.silence * 2 + len(record.data) * timing.byte_time
                self.start = None
            else:
                if first is None:
                    first = self.start = record.at
                now = max(now, (record.at - first) / NANO)
            self.monitor.receive(record.data, now)
            while heard:
                yield heard.popleft()
        self.monitor.finish(now)
        while heard:
            yield heard.popleft()


def _event(heard: Heard, told: Told, at: int | None) -> Seen | None:
    match heard:
        case Damaged():
            return Seen("fault", heard.fault.kind, heard.node, at, len(heard.fault.raw))
        case Asked():
            message, what = (
                heard.request,
                Seen("request", "", None, at, len(heard.frame), repeat=heard.repeat),
            )
        case Replied():
            message = heard.response
            delay = None if at is None else heard.delay
            what = Seen(
                "response", "", None, at, len(heard.frame), delay, heard.late, refused=told.refused(message)
            )
        case Unanswered():
            message, what = heard.request, Seen("unanswered", "", None, None)
        case Stray():
            message, what = heard.message, Seen("stray", "", None, at, len(heard.message.to_frame()))
        case _:
            assert_never(heard)
    if not told.keeps(message, at):
        return None
    asked: Framed = heard.request if isinstance(heard, Replied) else message
    return what._replace(name=told.name(asked), node=address_of(message))


def messages_alone(protocol: Protocol, frames: Iterable[Placed], wanted: Filter) -> Iterator[Seen]:
    """Return the messages and faults of a line whose answers, if there are any, follow their requests."""
    told = Told(protocol, wanted)
    asked: int | None = None
    for event, place in frames:
        if isinstance(event, Bad):
            yield Seen("fault", event.kind, None, place.at, place.size)
            continue
        what = _WHATS[protocol.by_name[event.NAME].direction]
        delay = (place.at - asked) / NANO if what == "response" and place.at is not None and asked else None
        asked = place.at if what == "request" else None
        if told.keeps(event, place.at):
            node = address_of(event)
            yield Seen(what, told.name(event), node, place.at, place.size, delay, refused=told.refused(event))
