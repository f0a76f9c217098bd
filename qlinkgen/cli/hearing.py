"""Formats the events of a monitor, as lines of text and as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import assert_never

import click

from qlinkgen._dataclass import dataclass
from qlinkgen.cli import jsonlines
from qlinkgen.cli.codec import fields
from qlinkgen.cli.common import on_terminal
from qlinkgen.cli.decode import error_record, message_record
from qlinkgen.link.codec import Message, address_of
from qlinkgen.link.events import Damaged, Stray
from qlinkgen.link.monitor import Asked, Heard, Replied, Unanswered
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import Json

MASTER = "master"
EVERYBODY = "all"
#: Width of "node 16 > master", and of the longest message names that are aligned.
_WHO, MOST = 16, 32


@dataclass(frozen=True, slots=True)
class Telling:
    """One event, as JSON and as text.

    Attributes:
        record: the JSON object.
        who: sender and receiver.
        what: name of the message, or kind of the event.
        values: its fields as text.
        remarks: delays and irregularities.
        wrong: the event is an error.
    """

    record: Mapping[str, Json]
    who: str
    what: str
    values: str = ""
    remarks: Sequence[str] = ()
    wrong: bool = False

    def line(self, width: int) -> str:
        """Return the line of text, without its time; names have `width` columns."""
        parts = [
            f"{self.who:{_WHO}} {self.what:{width}}",
            self.values,
            *(f"[{each}]" for each in self.remarks),
        ]
        text = " ".join(part for part in parts if part).rstrip()
        return click.style(text, fg="yellow") if self.wrong and on_terminal() else text


class Teller:
    """Formats the events of a monitor.

    Args:
        protocol: the protocol on the line.
        codec: its live module.
        start: time that counts as 0.
        raw: add the bytes of each frame.
    """

    def __init__(self, protocol: Protocol, codec: ModuleType, start: float, *, raw: bool) -> None:
        self._protocol = protocol
        self._broadcast = codec.BUS.broadcast
        self._start = start
        self._raw = raw
        self._width = min(max(map(len, protocol.by_name)), MOST)

    def line(self, heard: Heard) -> str:
        """Return an event as a line of text."""
        return f"{self.seconds(heard.at):12.6f}  {self.tell(heard).line(self._width)}"

    def tell(self, heard: Heard) -> Telling:
        """Format an event."""
        match heard:
            case Asked():
                return self._asked(heard)
            case Replied():
                return self._replied(heard)
            case Unanswered():
                return self._unanswered(heard)
            case Stray():
                return self._stray(heard)
            case Damaged():
                return self._damaged(heard)
            case _:
                assert_never(heard)

    def seconds(self, at: float) -> float:
        """Return the seconds since the start."""
        return round(at - self._start, 6)

    def _asked(self, heard: Asked) -> Telling:
        whom = address_of(heard.request)
        record: dict[str, Json] = {
            **self._head(heard.at, MASTER, self._whom(whom)),
            **self._message(heard.request),
        }
        record["repeat"] = heard.repeat
        remarks = ["repeat"] if heard.repeat else []
        return self._told(record, heard.request, heard.frame, remarks, wrong=heard.repeat)

    def _replied(self, heard: Replied) -> Telling:
        record: dict[str, Json] = {
            **self._head(heard.at, address_of(heard.response), MASTER),
            **self._message(heard.response),
            "delay": round(heard.delay, 6),
            "late": heard.late,
        }
        delay = f"after {heard.delay * 1000:.2f} ms"
        remarks = [f"late, {delay}" if heard.late else delay]
        return self._told(record, heard.response, heard.frame, remarks, wrong=heard.late)

    def _stray(self, heard: Stray) -> Telling:
        direction = self._protocol.by_name[heard.message.NAME].direction
        speaker: int | str | None = address_of(heard.message) if direction == "response" else None
        record: dict[str, Json] = {
            **self._head(heard.at, speaker, MASTER if direction == "response" else None),
            **self._message(heard.message),
            "stray": True,
            "late": heard.late,
        }
        remarks = [
            "second answer" if heard.late else "answers nothing" if direction == "response" else "unasked"
        ]
        return self._told(record, heard.message, heard.message.to_frame(), remarks, wrong=True)

    def _unanswered(self, heard: Unanswered) -> Telling:
        node = address_of(heard.request)
        record: dict[str, Json] = {"at": self.seconds(heard.at), "unanswered": self._message(heard.request)}
        return Telling(
            record, f"{_name(node)} silent", heard.request.NAME, remarks=["not answered"], wrong=True
        )

    def _damaged(self, heard: Damaged) -> Telling:
        fault = heard.fault
        record: dict[str, Json] = {"at": self.seconds(heard.at), "asked": heard.node, **error_record(fault)}
        text = f"{fault.message}: {fault.raw.hex(' ')}"
        return Telling(record, "?", f"damaged ({fault.kind})", text, wrong=True)

    def _head(self, at: float, speaker: int | str | None, whom: int | str | None) -> dict[str, Json]:
        return {"at": self.seconds(at), "from": speaker, "to": whom}

    def _whom(self, address: int | None) -> int | str | None:
        return EVERYBODY if address is not None and address == self._broadcast else address

    def _message(self, message: Message) -> dict[str, Json]:
        return message_record(self._protocol, message)

    def _told(
        self, record: dict[str, Json], message: Message, frame: bytes, remarks: list[str], *, wrong: bool
    ) -> Telling:
        if self._raw:
            record["raw"] = frame.hex()
            remarks = [*remarks, frame.hex(" ")]
        text = values_text(self._protocol, message)
        who = f"{_name(record['from'])} > {_name(record['to'])}"
        return Telling(record, who, message.NAME, text, remarks, wrong)


def _name(who: Json) -> str:
    return "?" if who is None else who if isinstance(who, str) else f"node {who}"


def values_text(protocol: Protocol, message: Message) -> str:
    """Return the fields of a message as text."""
    values = fields(protocol.by_name[message.NAME], message)
    return " ".join(f"{name}={_shown(value)}" for name, value in values.items())


def _shown(value: Json) -> str:
    if isinstance(value, list):
        return ",".join(map(str, value)) or "none"
    # Quote texts with blanks, which separate fields, and with control characters.
    if value and isinstance(value, str) and value.isprintable() and " " not in value:
        return value
    return jsonlines.line(value)
