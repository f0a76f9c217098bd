"""Second pass, answers without an end: the command that stops them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from qlinkgen.model.fields import Value
from qlinkgen.model.frame import DelimitedFrame, Frame, FrameKinds
from qlinkgen.model.message import Message
from qlinkgen.model.transaction import ByCommand, Command
from qlinkgen.model.types import Scalar
from qlinkgen.schema.echoes import holds
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path

_RULE = "bad-many"
#: Addressing of a command that may go to all nodes.
_TO_ALL = ("broadcast", "either", "answered_broadcast")


def stopped(commands: Sequence[Command], frame: Frame | None, report: Reporter) -> list[Command]:
    """The commands, with the values that the requests which stop others repeat."""
    known = {command.name: command for command in commands}
    return [
        replace(command, many=_completed(command, command.stopped, known, frame, report))
        if command.stopped
        else command
        for command in commands
    ]


def _completed(
    command: Command, many: ByCommand, known: Mapping[str, Command], frame: Frame | None, report: Reporter
) -> ByCommand:
    path: Path = ("commands", command.name, "many", "until")
    needs = (path, ("commands", many.command))
    stop = known[many.command]
    if (fault := _fault(command, stop)) is not None:
        report.error(_RULE, path, *fault, needs=needs)
        return many
    given = {**_settable(command.request.values), **_settable(_beside(frame, command.request))}
    repeats = []
    for name, value in {**_settable(stop.request.values), **_settable(_beside(frame, stop.request))}.items():
        if name in given and holds(value.type, given[name].type):
            repeats.append(name)
        elif name in given:
            what = f"{name} of {stop.name} cannot hold every {name} of {command.name}"
            report.error(_RULE, path, what, "give both the same type", needs=needs)
        elif value.required:
            what = f"{stop.name} needs {name}, which the request of {command.name} does not have"
            report.error(_RULE, path, what, "add it there, or give it a default", needs=needs)
    return replace(many, repeats=tuple(repeats))


def _fault(command: Command, stop: Command) -> tuple[str, str] | None:
    """What is wrong with a command that is to stop another one, and the fix; None for nothing."""
    hint = "name a command with one response, or none"
    if stop.name == command.name:
        return f"{command.name} cannot stop itself", hint
    if stop.many is not None or stop.steps:
        return f"{stop.name} has several answers or steps itself", hint
    if command.addressing == "either":
        return f"nothing answers a broadcast of {command.name}, so that it has no end", "use addressing: node"
    if command.addressing == "answered_broadcast" and stop.addressing not in _TO_ALL:
        return f"all nodes may answer {command.name}, but {stop.name} goes to one", "let it be broadcast, too"
    if stop.asker not in {command.asker, "either"}:
        return f"the side that sends {command.name} does not send {stop.name}", "give both the same from"
    return None


def _settable(values: Sequence[Value]) -> dict[str, Value]:
    """The values that a program gives, by name."""
    return {
        value.name: value for value in values if not isinstance(value.type, Scalar) or value.type.settable
    }


def _beside(frame: Frame | None, message: Message) -> Sequence[Value]:
    """The values of the frame of a request, but for the counter."""
    if isinstance(frame, FrameKinds):
        frame = next((kind.frame for kind in frame.carrying(message.id)), None)
    if not isinstance(frame, DelimitedFrame):
        return ()
    towards = frame.towards("request")
    return [
        value for value in towards.values if towards.counter is None or value.name != towards.counter.name
    ]
