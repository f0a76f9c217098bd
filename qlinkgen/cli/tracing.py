"""``--trace``: prints the bytes of a port with their times, and the messages in them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import ClassVar

import click

from qlinkgen.cli.hearing import values_text
from qlinkgen.cli.streams import Bad, Event, OneWay
from qlinkgen.link.codec import address_of
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.texts import visible
from qlinkgen.plan.framing import frame_plan

trace_option = click.option(
    "--trace", "traced", is_flag=True, help="Print the bytes sent and received with their times to stderr."
)


class Trace:
    """Prints one line for the bytes of each frame; `hear` is called with the bytes of a port."""

    #: What bytes of either way are called.
    labels: ClassVar[Mapping[bool, str]] = {True: "sent", False: "received"}

    def __init__(self, protocol: Protocol, codec: ModuleType) -> None:
        self._protocol = protocol
        self._ways: dict[bool, OneWay] = {}
        if not frame_plan(protocol.frame).needs_request:  # an answer without its request tells nothing
            for sent, way in ((True, protocol.directions[0]), (False, protocol.directions[-1])):
                self._ways[sent] = OneWay(codec, way)
        self._start: float | None = None
        self._held, self._since = b"", 0.0
        self._held_sent = False

    def hear(self, at: float, sent: bool, data: bytes) -> None:
        """Take bytes; those of an answer are collected until it is complete."""
        self._start = at if self._start is None else self._start
        if sent:
            way = self._ways.get(sent)
            self.end()
            self._line(at, sent, data, [*way.feed(data), *way.finish()] if way else ())
        else:
            self._collect(at, sent, data)

    def _collect(self, at: float, sent: bool, data: bytes) -> None:
        """Take bytes of an incomplete frame."""
        way = self._ways.get(sent)
        self._since = self._since if self._held else at
        self._held += data
        self._held_sent = sent
        events = way.feed(data) if way else []
        if way is None or events:
            self._flush(events)

    def end(self) -> None:
        """Print the bytes of a frame that is not complete, or was ended by silence."""
        way = self._ways.get(self._held_sent)
        events = way.finish() if way else []
        if self._held:
            self._flush(events)

    def _flush(self, events: Iterable[Event]) -> None:
        self._line(self._since, self._held_sent, self._held, events)
        self._held = b""

    def _line(self, at: float, sent: bool, data: bytes, events: Iterable[Event]) -> None:
        seconds = at - (self._start or 0.0)
        told = "".join(f" [{self._told(event)}]" for event in events)
        click.echo(visible(f"{seconds:12.6f}  {self.labels[sent]:8}  {data.hex(' ')}{told}"), err=True)

    def _told(self, event: Event) -> str:
        if isinstance(event, Bad):
            return f"damaged ({event.kind}): {event.message}"
        node = address_of(event)
        where = "" if node is None else f"{event.ADDRESS} {node}"
        return " ".join(part for part in (event.NAME, where, values_text(self._protocol, event)) if part)


class LineTrace(Trace):
    """Prints the frames on a simulated line: those of the master are sent in pieces, too."""

    labels: ClassVar[Mapping[bool, str]] = {True: "request", False: "answer"}

    def hear(self, at: float, sent: bool, data: bytes) -> None:
        """Take bytes of the master (`sent`) or a node; a frame ends at the latest when the other sends."""
        self._start = at if self._start is None else self._start
        if sent is not self._held_sent:
            self.end()
        self._collect(at, sent, data)
