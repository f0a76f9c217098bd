"""Formats the events of a ring node and of a listener on one fibre, as lines of text and as JSON."""

from __future__ import annotations

import math
import sys
from types import ModuleType
from typing import assert_never

from qlinkgen.cli import jsonlines
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.hearing import MOST, Telling, values_text
from qlinkgen.cli.wire_options import counted
from qlinkgen.link.codec import Message
from qlinkgen.link.ring_events import Blocked, Broken, Dropped, Passed, Queued, RingEvent, StatusRaised, Taken
from qlinkgen.model.naming import address_attribute
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import Json


class RingTeller:
    """Formats the events of a ring.

    Args:
        protocol: the protocol on the ring.
        codec: its live module.
        start: time that counts as 0.
        raw: add the bytes of each message.
    """

    def __init__(self, protocol: Protocol, codec: ModuleType, start: float, *, raw: bool) -> None:
        self._protocol = protocol
        self._codec = codec
        self._start = start
        self._raw = raw
        self.width = min(max(map(len, protocol.by_name)), MOST)

    def line(self, at: float, telling: Telling) -> str:
        """Return an event as a line of text."""
        return f"{self._seconds(at):12.6f}  {telling.line(self.width)}"

    def event(self, event: RingEvent) -> Telling | None:
        """Format an event of a node; None if it is not a received message."""
        match event:
            case Taken():
                return self.message(event.at, event.message, event.frame, sent_on=False)
            case Passed():
                return self._passed(event)
            case Broken():
                return self.broken(event.at, event.kind, event.raw, event.text, sent_on=event.cut_short)
            case Queued() | Blocked() | Dropped() | StatusRaised():
                return None
            case _:
                assert_never(event)

    def _passed(self, event: Passed) -> Telling:
        try:
            message = self._codec.decode(event.frame)
        except self._codec.DecodeError as error:
            return self.broken(event.at, error.kind, event.frame, str(error), sent_on=True)
        return self.message(event.at, message, event.frame, sent_on=True)

    def message(self, at: float, message: Message, frame: bytes, *, sent_on: bool | None = None) -> Telling:
        """Format a message; `sent_on` is None for a listener, which does not forward."""
        name = self._protocol.address_name or "address"
        record: dict[str, Json] = {"at": self._seconds(at), **message_record(self._protocol, message)}
        remarks = []
        if sent_on is not None:
            record["sent_on"] = sent_on
        if self._raw:
            record["raw"] = frame.hex()
            remarks.append(frame.hex(" "))
        who = f"{name} {getattr(message, address_attribute(name))}{', here' if sent_on is False else ''}"
        return Telling(record, who, message.NAME, values_text(self._protocol, message), remarks)

    def broken(
        self,
        at: float,
        kind: str,
        raw: bytes,
        text: str,
        *,
        offset: int | None = None,
        sent_on: bool | None = None,
    ) -> Telling:
        """Format bytes that are not a message."""
        fault = {"kind": kind, "offset": offset, "raw": raw.hex(), "message": text}
        record: dict[str, Json] = {"at": self._seconds(at), "error": fault}
        if sent_on is not None:
            record["sent_on"] = sent_on
        remarks = ["forwarded"] if sent_on else []
        return Telling(record, "?", f"damaged ({kind})", f"{text}: {raw.hex(' ')}", remarks, wrong=True)

    def _seconds(self, at: float) -> float:
        return round(at - self._start, 6)


class RingPrinter:
    """Prints the lines of a teller, and counts them.

    Attributes:
        shown: messages printed, including damaged ones.
        damaged: damaged messages among them.
    """

    def __init__(self, teller: RingTeller, *, as_json: bool, count: int | None) -> None:
        """Stop printing after `count` messages."""
        self._teller = teller
        self._as_json = as_json
        self._most = math.inf if count is None else count
        self.shown = self.damaged = 0

    @property
    def done(self) -> bool:
        """Whether `count` messages were printed."""
        return self.shown >= self._most

    def show(self, at: float, telling: Telling) -> None:
        """Print an event, unless `count` messages were printed."""
        if self.done:
            return
        self.shown += 1
        self.damaged += telling.wrong
        text = jsonlines.line(telling.record) if self._as_json else self._teller.line(at, telling)
        sys.stdout.write(f"{text}\n")

    def flush(self) -> None:
        """Flush, so that the reader of a pipe sees all lines."""
        sys.stdout.flush()

    def summary(self) -> str:
        """Return the counts as text."""
        return f"{counted(self.shown, 'message')}, {self.damaged} of them damaged"
