"""Third pass, echoes: fields of a response that repeat a field of the request."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import assert_never

from qlinkgen.model.message import Field
from qlinkgen.model.transaction import Command
from qlinkgen.model.types import Array, Bits, Blob, FieldType, Float, Length, Scalar
from qlinkgen.schema.file_model import Fields, SchemaFile
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_RULE = "bad-echo"


def check_echoes(file: SchemaFile, commands: Iterable[Command], report: Reporter) -> None:
    """Check that every echo is in a response and repeats a field of its request."""
    for fields, path, what in _unanswering(file):
        for name, spec in fields.items():
            if spec.echo:
                place = (*path, name, "echo")
                hint = "remove it; only a field of a response can be an echo"
                report.error(_RULE, place, f"'echo' has no effect in {what}", hint, of_key=True)
    for command in commands:
        paths = [_path(file, command.name, direction) for direction in ("request", "response")]
        for field in command.response.fields if command.response else ():
            if field.echo and (fault := _fault(field, command.request.fields)):
                place = (*paths[1], field.name)
                report.error(_RULE, (*place, "echo"), *fault, of_key=True, needs=(place, paths[0]))


def _unanswering(file: SchemaFile) -> Iterator[tuple[Fields, Path, str]]:
    """Fields that are not part of a response, their path, and a name for their message."""
    yield file.defaults.request or {}, ("defaults", "request"), "a request"
    for name, command in file.commands.items():
        yield command.request or {}, ("commands", name, "request"), "a request"
    for name, message in file.messages.items():
        yield message.fields, ("messages", name, "fields"), "a message without a request"


def _path(file: SchemaFile, name: str, direction: str) -> Path:
    """The path of the fields of a command."""
    written = getattr(file.commands[name], direction) is not None
    return ("commands", name, direction) if written else ("defaults", direction)


def _fault(field: Field, request: Iterable[Field]) -> tuple[str, str] | None:
    """Error and fix for an echo, None if it is right."""
    known = {each.name: each for each in request if _settable(each)}
    asked = known.get(field.name)
    if not _settable(field):
        return f"{field.name} cannot be an echo: the codec fills it", "remove echo"
    if asked is None:
        hint = did_you_mean(field.name, known, f"its fields are {listed(known)}")
        return f"the request has no field '{field.name}' to repeat", hint
    if _has_float(field.type):
        return f"{field.name} cannot be an echo: a NaN equals nothing, and digits are lost", "remove echo"
    if not _holds(field.type, asked.type):
        return f"{field.name} cannot hold every {field.name} of the request", "give both the same type"
    return None


def _settable(field: Field) -> bool:
    return not isinstance(field.type, Scalar) or field.type.settable


def _has_float(kind: FieldType) -> bool:
    number = kind.item if isinstance(kind, Array) else kind
    return isinstance(number, Scalar) and isinstance(number.meaning, Float)


def _holds(kind: FieldType, other: FieldType) -> bool:
    """Whether a type can hold every value of another."""
    match kind:
        case Blob():
            return isinstance(other, Blob) and kind.text == other.text and _longer(kind.length, other.length)
        case Array():
            return (
                isinstance(other, Array)
                and _holds(kind.item, other.item)
                and _longer(kind.length, other.length)
            )
        case Bits():
            if not isinstance(other, Bits) or len(kind.members) != len(other.members):
                return False
            pairs = zip(kind.members, other.members, strict=True)
            return all(a.name == b.name and _holds(a.type, b.type) for a, b in pairs)
        case Scalar():
            if not isinstance(other, Scalar):
                return False
            within = kind.minimum <= other.minimum and other.maximum <= kind.maximum
            return within and _nature(kind) == _nature(other)
        case _:
            assert_never(kind)


def _longer(length: Length, other: Length) -> bool:
    return length.minimum <= other.minimum and other.maximum <= length.maximum


def _nature(scalar: Scalar) -> tuple[object, ...]:
    """The properties of a number except its byte order."""
    return scalar.bits, scalar.signed, scalar.scaling, scalar.unit, scalar.meaning
