"""Third pass, echoes: fields of a response that repeat a field of the request."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import assert_never

from qlinkgen.model.fields import Field, FieldType, Record, Records
from qlinkgen.model.transaction import Command
from qlinkgen.model.types import Array, Bits, Blob, Float, Length, Scalar
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.layouts import layouts
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_RULE = "bad-echo"
_KINDS = {
    "request": "a request",
    "step": "a step before the response",
    "message": "a message without a request",
    "record": "a record",
}


def check_echoes(
    file: SchemaFile, commands: Iterable[Command], places: Mapping[str, Path], report: Reporter
) -> None:
    """Check that every echo is in an answer and repeats a field of its request.

    ``places`` are the paths of the fields of messages.
    """
    for layout in layouts(file):
        for name, spec in layout.fields.items() if layout.kind != "answer" else ():
            if spec.echo:
                place, what = (*layout.path, name, "echo"), _KINDS[layout.kind]
                hint = "remove it; only a field of a response can be an echo"
                report.error(_RULE, place, f"'echo' has no effect in {what}", hint, of_key=True)
    for command in commands:
        asked = command.request
        for answer in command.answers:
            for field in answer.fields:
                if field.echo and (fault := _fault(field, asked.fields)):
                    place = (*places[answer.name], field.name)
                    needs = (place, places[asked.name])
                    report.error(_RULE, (*place, "echo"), *fault, of_key=True, needs=needs)


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
    if isinstance(kind, Record | Records):
        return any(_has_float(field.type) for field in kind.layout.fields)
    number = kind.item if isinstance(kind, Array) else kind
    return isinstance(number, Scalar) and isinstance(number.meaning, Float)


def _holds(kind: FieldType, other: FieldType) -> bool:
    """Whether a type can hold every value of another."""
    match kind:
        case Blob():
            if not isinstance(other, Blob) or kind.text != other.text or kind.pad != other.pad:
                return False
            return _longer(kind.length, other.length)
        case Array():
            return (
                isinstance(other, Array)
                and _holds(kind.item, other.item)
                and _longer(kind.length, other.length)
            )
        case Record():
            return isinstance(other, Record) and kind.layout == other.layout
        case Records():
            same = isinstance(other, Records) and kind.layout == other.layout
            return same and isinstance(other, Records) and _longer(kind.length, other.length)
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
