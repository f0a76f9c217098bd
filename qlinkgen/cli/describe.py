"""Descriptions of messages and transactions; those of parts and steps are in `plan.describe`."""

from __future__ import annotations

from decimal import Decimal
from typing import assert_never

from qlinkgen.model.fields import Record, Records
from qlinkgen.model.message import Message, Value
from qlinkgen.model.transaction import (
    Allowance,
    ByCommand,
    ByCount,
    ByEach,
    ByField,
    ByReply,
    ByTime,
    Command,
    Many,
    Reply,
)
from qlinkgen.model.values import default_of, to_json
from qlinkgen.plan.describe import number_text, span_text

ADDRESSING = {
    "node": "one node",
    "broadcast": "broadcast only",
    "either": "one node or broadcast",
    "answered_broadcast": "one node, or an answered broadcast",
    "none": "",
}


def default_text(value: Value) -> str:
    """Return the default as written on the command line, ``required`` if there is none."""
    if value.required:
        return "required"
    if not value.field.given:
        return "absent"
    if isinstance(value.type, Record | Records):
        return "its own" if isinstance(value.type, Record) else "none"
    shown = to_json(value, default_of(value))
    if isinstance(shown, list):
        return "none" if not shown else ",".join(map(str, shown))
    if isinstance(shown, bool):
        return str(shown).lower()
    if isinstance(shown, str):
        return shown or "empty"
    assert isinstance(shown, int | float | Decimal)
    return number_text(shown)


def addresses_text(message: Message) -> str:
    """Return the addresses that a message may have."""
    return ", ".join(span_text(first, last) for first, last in message.addresses)


def time_text(allowance: Allowance) -> str:
    """Return the longest response time."""
    parts = []
    if allowance.byte_times:
        parts.append(f"{number_text(allowance.byte_times)} byte times")
    if allowance.seconds:
        parts.append(f"{number_text(float(allowance.seconds * 1000))} ms")
    return " + ".join(parts)


def many_text(many: Many) -> str:
    """Return where several answers end."""
    match many:
        case ByCount():
            return f"as many answers as {many.field} says" if many.field else f"{many.most} answers"
        case ByField():
            return f"answers until {many.field} is {span_text(many.first, many.last)}"
        case ByReply():
            return f"answers until {many.reply.name}"
        case ByCommand():
            return f"answers until {many.command} stops them"
        case ByTime():
            return f"all answers within {time_text(many.within)}"
        case ByEach():
            return f"an answer of each of {many.field}{'.' + many.key if many.key else ''}"
        case _:
            assert_never(many)


def steps_text(command: Command) -> str:
    """Return the frames of a dialogue: ``sends load.request, receives ack, sends load.place``."""
    frames = [("sends", command.request.name)]
    frames += [("sends" if step.sent else "receives", step.message.name) for step in command.steps]
    return "the master " + ", ".join(f"{verb} {name}" for verb, name in frames)


def means_text(reply: Reply) -> str:
    """Return what a reply means: ``refused; code busy: again after 20 ms``."""
    times = {"again": f" after {time_text(reply.after)}" if time_text(reply.after) else "", "pending": ""}
    if reply.within is not None:
        times["pending"] = f" within {time_text(reply.within)}"
    cases = [
        f"{case.name or span_text(case.first, case.last)}: {case.means}{times.get(case.means, '')}"
        for case in reply.cases
    ]
    chosen = f"; {reply.switch} {', '.join(cases)}" if cases else ""
    return f"{reply.means}{times.get(reply.means, '')}{chosen}"


def repeat_text(command: Command) -> str:
    """Return whether a request may be repeated."""
    if command.repeat.counter:
        return f"by {command.repeat.counter}"
    return "safe" if command.repeat.safe else "unsafe"
