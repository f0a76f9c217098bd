"""The layouts of a file: every list of fields that it writes, with its path."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from qlinkgen.schema.file_commands import AnswerSpec, CommandSpec, ResponseWord, StepMessageSpec, StepSpec
from qlinkgen.schema.file_fields import Fields, RecordSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.source import Path

#: What a layout is, as it matters for a key that only answers have.
Kind = Literal["request", "answer", "step", "message", "record"]


@dataclass(frozen=True, slots=True)
class Layout:
    """Fields of a message or a record, as written.

    Attributes:
        owner: name of the message or record, "" for the defaults of commands and replies of the whole file.
        fields: its fields.
        path: their place.
        kind: what it is.
    """

    owner: str
    fields: Fields
    path: Path
    kind: Kind


def layouts(file: SchemaFile) -> Iterator[Layout]:
    """All layouts of a file, in its order."""
    for name, spec in file.types.items():
        if isinstance(spec, RecordSpec):
            yield Layout(name, spec.fields, ("types", name, "fields"), "record")
    for name, reply in file.replies.items():
        yield Layout("", reply.fields, ("replies", name, "fields"), "answer")
    if file.defaults.request is not None:
        yield Layout("", file.defaults.request, ("defaults", "request"), "request")
    yield from _answer("", file.defaults.response, ("defaults", "response"))
    for name, command in file.commands.items():
        path = ("commands", name)
        if command.request is not None:
            yield Layout(f"{name}.request", command.request, (*path, "request"), "request")
        yield from _answer(f"{name}.response", command.response, (*path, "response"))
        for step in own_steps(name, command):
            kind: Kind = "answer" if step.last else "step"
            yield Layout(f"{name}.{step.name}", step.fields, step.fields_path, kind)
        for key, reply in command.replies.items():
            yield Layout(f"{name}.{key}", reply.fields, (*path, "replies", key, "fields"), "answer")
    for name, message in file.messages.items():
        yield Layout(name, message.fields, ("messages", name, "fields"), "message")


@dataclass(frozen=True, slots=True)
class OwnStep:
    """A frame of a dialogue that is a message of its own.

    Attributes:
        name: its name in the command.
        spec: the step as written.
        path: its place.
        key: send or receive.
        message: its message as written.
        last: it is the last answer, and thus the response.
    """

    name: str
    spec: StepSpec
    path: Path
    key: str
    message: StepMessageSpec | Fields
    last: bool

    @property
    def fields(self) -> Fields:
        """The fields of the message."""
        return self.message.fields if isinstance(self.message, StepMessageSpec) else self.message

    @property
    def fields_path(self) -> Path:
        """Their place."""
        place = (*self.path, self.key)
        return (*place, "fields") if isinstance(self.message, StepMessageSpec) else place


def own_steps(command: str, spec: CommandSpec) -> Iterator[OwnStep]:
    """The frames of a dialogue that are not messages with another name."""
    steps = spec.steps or ()
    last = max((index for index, step in enumerate(steps) if step.send is None), default=-1)
    for index, step in enumerate(steps):
        key, given = ("receive", step.receive) if step.send is None else ("send", step.send)
        if given is not None and not isinstance(given, str):
            path: Path = ("commands", command, "steps", index)
            yield OwnStep(step.name or f"step_{index + 1}", step, path, key, given, index == last)


def _answer(owner: str, given: Fields | AnswerSpec | ResponseWord | None, path: Path) -> Iterator[Layout]:
    fields = fields_of(given)
    if fields is not None:
        yield Layout(owner, fields, fields_path(given, path), "answer")


def fields_of(given: Fields | AnswerSpec | ResponseWord | None) -> Fields | None:
    """The fields of a response, None if it states none."""
    if isinstance(given, AnswerSpec):
        return given.fields
    return given if isinstance(given, dict) else None


def fields_path(given: Fields | AnswerSpec | ResponseWord | None, path: Path) -> Path:
    """The path of the fields of a response at a path."""
    return (*path, "fields") if isinstance(given, AnswerSpec) else path
