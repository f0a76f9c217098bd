"""Third pass, echoes: fields of an answer that repeat something of the request.

``equals: request.NAME`` names a value of the request, or a part of its frame: a piece of the message id, the
address, or a value of every frame. ``echo: true`` is short for the field with the same name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import assert_never

from qlinkgen.model.fields import Field, FieldType, Record, Records, Value
from qlinkgen.model.frame import DelimitedFrame, Frame, FrameKinds, PartBits
from qlinkgen.model.message import Message
from qlinkgen.model.transaction import Command, Echo
from qlinkgen.model.types import Array, Bits, Blob, Enum, Float, Length, Scalar
from qlinkgen.schema.file_fields import Fields, FieldSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.layouts import layouts
from qlinkgen.schema.proofs import ProofBuilder
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_RULE = "bad-echo"
_KINDS = {
    "request": "a request",
    "step": "a step before the response",
    "message": "a message without a request",
    "record": "a record",
}
#: Error and fix.
Wrong = tuple[str, str]


class EchoBuilder:
    """Connects the fields of answers with what they repeat."""

    def __init__(
        self, file: SchemaFile, frame: Frame | None, places: Mapping[str, Path], report: Reporter
    ) -> None:
        """``places`` are the paths of the fields of messages; ``frame`` is None if it could not be built."""
        self._file = file
        self._frame = frame
        self._places = places
        self._report = report
        self._written: dict[Path, Fields] = {each.path: each.fields for each in layouts(file)}
        self._proofs = ProofBuilder(frame, report)

    def build(self, commands: Sequence[Command]) -> list[Command]:
        """The commands, each with what its answers repeat."""
        self._check_places(commands)
        return [replace(each, echoes=tuple(self._echoes(each))) for each in commands]

    def _check_places(self, commands: Sequence[Command]) -> None:
        """Report fields that repeat a request where there is none."""
        answers = {answer.name for command in commands for answer in command.answers}
        for layout in layouts(self._file):
            if layout.kind == "answer" or (layout.kind == "message" and layout.owner in answers):
                continue
            for name, spec in layout.fields.items():
                if spec.repeated(name) or spec.proves:
                    key, place = _key(spec), (*layout.path, name)
                    what = f"{key!r} has no effect in {_KINDS[layout.kind]}"
                    what = what if spec.echo else f"{_KINDS[layout.kind]} has no request to repeat"
                    hint = "remove it; only a field of a response can be an echo"
                    self._report.error(_RULE, (*place, key), what, hint, of_key=True, needs=(place,))
        for command in commands:
            for number, step in enumerate(command.steps):
                if not step.sent and step.message is not command.response and step.message.echoes:
                    self._report_step(command, number)

    def _report_step(self, command: Command, number: int) -> None:
        message, steps = command.steps[number].message, ("commands", command.name, "steps")
        repeated = [value.name for value in message.values if value.field.repeats]
        if repeated and message.command != command.name:
            what = f"{repeated[0]} of {message.name} repeats a request, which only the last answer can"
            hint = "write the fields of this step, or let it be the last answer"
            self._report.error(
                _RULE, steps, what, hint, of_key=True, needs=(steps, self._places[message.name])
            )

    def _echoes(self, command: Command) -> Iterator[Echo]:
        for answer in command.answers:
            for field in answer.fields:
                if field.repeats:
                    yield from self._repeated(answer, field, command.request)
                elif field.proves:
                    place = (*self._places[answer.name], field.name)
                    spec = self._written[self._places[answer.name]][field.name]
                    yield from self._proofs.build(command, answer, field, spec, place)

    def _repeated(self, answer: Message, field: Field, request: Message) -> Iterator[Echo]:
        path = self._places[answer.name]
        spec, place = self._written[path][field.name], (*path, field.name)
        if spec.echo and spec.equals:
            what, hint = f"{field.name} repeats two things", "remove echo"
            self._report.error(_RULE, (*place, "echo"), what, hint, of_key=True, needs=(place,))
            return
        parts = self._parts(request) if not spec.echo else {}
        part = parts.get(field.repeats)
        fault = _taken(field, request, part) or _fault(field, request, parts, _key(spec))
        if fault is not None:
            needs = (place, self._places[request.name], ("frame",), ("frames",))
            self._report.error(_RULE, (*place, _key(spec)), *fault, of_key=True, needs=needs)
        elif isinstance(part, PartBits) and part.is_id:
            yield Echo(answer.name, field.name, _piece(part, request))
        elif isinstance(field.type, Bits):
            yield from (Echo(answer.name, each.name, each.name) for each in field.type.members)
        else:
            yield Echo(answer.name, field.name, field.repeats)

    def _parts(self, request: Message) -> Mapping[str, PartBits | Value]:
        """What the frame of a request has beside its payload, by name."""
        frame = self._frame
        frame = frame.carrying(request.id)[0].frame if isinstance(frame, FrameKinds) else frame
        if not isinstance(frame, DelimitedFrame):
            return {}
        own = frame.towards("request")
        found: dict[str, PartBits | Value] = {each.name: each for each in own.values}
        found |= {each.name: each for each in own.id_bits if each.role == "message"}
        return found | ({own.address.name: own.address} if own.address else {})


def _key(spec: FieldSpec) -> str:
    return "echo" if spec.echo else "over" if spec.proves else "equals"


def _taken(field: Field, request: Message, part: PartBits | Value | None) -> Wrong | None:
    """Error and fix if a name has two meanings in a request."""
    if part is None or field.repeats not in {each.name for each in request.values}:
        return None
    what = f"{field.repeats} of {request.name} is a field and a part of the frame"
    return what, "rename the field, or write echo: true for a field of the same name"


def _fault(field: Field, request: Message, parts: Mapping[str, PartBits | Value], key: str) -> Wrong | None:
    """Error and fix for an echo, None if it is right."""
    fields = {each.name: each for each in request.fields if _settable(each)}
    if not _settable(field):
        return f"{field.name} cannot be an echo: the codec fills it", f"remove {key}"
    if _has_float(field.type):
        return f"{field.name} cannot be an echo: a NaN equals nothing, and digits are lost", f"remove {key}"
    known: Mapping[str, PartBits | Value | Field] = {**parts, **fields}
    asked, name = known.get(field.repeats), field.repeats
    if asked is None:
        hint = did_you_mean(name, known, f"its fields are {listed(known)}")
        return f"the request has no field {name!r} to repeat", hint
    if isinstance(asked, PartBits):
        return _part_fault(field, asked, request)
    if not holds(field.type, asked.type):
        return f"{field.name} cannot hold every {name} of the request", "give both the same type"
    return None


def _part_fault(field: Field, part: PartBits, request: Message) -> Wrong | None:
    """Error and fix for an echo of an address or of a piece of an id."""
    kind = field.type
    if not isinstance(kind, Scalar) or kind.scaling is not None or not isinstance(kind.meaning, Enum | None):
        return f"{field.name} cannot repeat {part.name}", "use a whole number, or an enum"
    if part.text:
        return f"{field.name} cannot repeat {part.name}, which is text", "repeat a piece that is a number"
    numbers = [_piece(part, request)] if part.is_id else [each for two in request.addresses for each in two]
    wrong = next((each for each in numbers if not kind.minimum <= each <= kind.maximum), None)
    if wrong is None:
        return None
    what = f"{field.name} cannot hold {part.name} {wrong:#x} of {request.name}"
    return what, f"its range is {kind.minimum}..{kind.maximum}; use a larger one"


def _piece(part: PartBits, request: Message) -> int:
    """The number of a piece in the id of a request."""
    return request.id >> part.at & ((1 << part.bits) - 1)


def _settable(field: Field) -> bool:
    return not isinstance(field.type, Scalar) or field.type.settable


def _has_float(kind: FieldType) -> bool:
    if isinstance(kind, Record | Records):
        return any(_has_float(field.type) for field in kind.layout.fields)
    number = kind.item if isinstance(kind, Array) else kind
    return isinstance(number, Scalar) and isinstance(number.meaning, Float)


def holds(kind: FieldType, other: FieldType) -> bool:
    """Whether a type can hold every value of another."""
    match kind:
        case Blob():
            if not isinstance(other, Blob) or kind.text != other.text or kind.pad != other.pad:
                return False
            return _longer(kind.length, other.length)
        case Array():
            return (
                isinstance(other, Array)
                and holds(kind.item, other.item)
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
            return all(a.name == b.name and holds(a.type, b.type) for a, b in pairs)
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
