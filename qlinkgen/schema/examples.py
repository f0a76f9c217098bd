"""Examples: frames of the source document, each held to the description of its message."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from decimal import Decimal
from typing import TYPE_CHECKING, cast

from qlinkgen.model.fields import chosen
from qlinkgen.model.message import Example, Message, Value
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import BadValue, Json, Native, default_of, from_json, to_json
from qlinkgen.schema.file_commands import ExampleSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

if TYPE_CHECKING:
    from qlinkgen.plan.codec import Codec, Decoded
    from qlinkgen.plan.content import Raw
    from qlinkgen.plan.payload import Holder

_RULE = "wrong-example"
#: Kinds of faults of a frame in words.
_WRONG = {"crc": "its check value is not that of its bytes"}


def build_examples(file: SchemaFile, protocol: Protocol, report: Reporter) -> tuple[Example, ...]:
    """The examples of a file; reports those that differ from its description."""
    found = [*_specs(file)]
    if not found:
        return ()
    # Few files have any, and lint starts sooner without the plan.
    from qlinkgen.plan import plan_of  # noqa: PLC0415
    from qlinkgen.plan.codec import Codec  # noqa: PLC0415

    checker = _Checker(protocol, Codec(plan_of(protocol)), report)
    return tuple(example for path, spec in found if (example := checker.example(spec, path)))


def _specs(file: SchemaFile) -> Iterator[tuple[Path, ExampleSpec]]:
    for group, specs in (("commands", file.commands), ("messages", file.messages)):
        for name, spec in specs.items():
            for index, example in enumerate(spec.examples):
                yield (group, name, "examples", index), example


class _Checker:
    """Decodes each example and compares its values."""

    def __init__(self, protocol: Protocol, codec: Codec, report: Reporter) -> None:
        self._protocol = protocol
        self._codec = codec
        self._report = report

    def example(self, spec: ExampleSpec, path: Path) -> Example | None:
        """The example, None if it was reported."""
        found = self._values(spec, path)
        if found is None:
            return None
        message, key, values = found
        decoded = self._decoded(message, spec, path)
        if decoded is None:
            return None
        parts = {each: value for each, value in spec.parts.items() if each != key}
        self._compare_address(message, decoded, parts, path)
        beside = {member.name: member for _, member in decoded.message.envelope.values}
        every = self._protocol.beside(message)
        names = {_key(value.name): (value, beside[value.name]) for value in every}
        self._compare("the frame", names, decoded.beside, parts, path)
        steps = dict(zip(message.values, decoded.message.payload.settable, strict=True))
        inside = {value.name: (value, steps[value]) for value in chosen(steps, decoded.values.get)}
        self._compare(message.name, inside, decoded.values, values, (*path, key))
        return Example(message.name, spec.wire, spec.after, decode_only=spec.decode_only)

    def _error(self, path: Path, what: str, hint: str, *, of_key: bool = False) -> None:
        self._report.error(_RULE, path, what, hint, of_key=of_key)

    def _values(self, spec: ExampleSpec, path: Path) -> tuple[Message, str, Mapping[str, Json]] | None:
        """The message of the example, the key of its values, and these; None if that was reported."""
        forms = self._forms(str(path[0]), str(path[1]))
        typed = {"request": spec.request, "response": spec.response, "fields": spec.fields}
        given = {key: values for key, values in (*typed.items(), *spec.parts.items()) if values is not None}
        found = [key for key in given if key in forms or key in typed]
        if len(found) != 1 or found[0] not in forms:
            what = f"an example has the values of one message, not {listed(found)}"
            self._error(path, what, f"write its values under {listed(forms, 'or')}")
            return None
        (key,) = found
        values = given[key]
        if not isinstance(values, Mapping):
            self._error((*path, key), f"{shown(values)} is not a mapping", "write NAME: VALUE, or {}")
            return None
        return forms[key], key, cast("Mapping[str, Json]", values)

    def _forms(self, group: str, name: str) -> Mapping[str, Message]:
        """The messages of a command, or the one of this name, by the key of their values."""
        if group == "messages":
            return {"fields": self._protocol.by_name[name]}
        command = next(each for each in self._protocol.commands if each.name == name)
        both = {"request": command.request, "response": command.response}
        others = {reply.name: reply.message for reply in command.replies}
        others |= {each.name.partition(".")[2]: each for each in command.messages if each.command == name}
        return {key: each for key, each in both.items() if each} | others

    def _decoded(self, message: Message, spec: ExampleSpec, path: Path) -> Decoded | None:
        """What the bytes say; None if that was reported."""
        from qlinkgen.plan.reading import BadFrame  # noqa: PLC0415  # see build_examples

        place, planned = (*path, "wire"), self._codec.plan.message(message.name)
        try:
            decoded = self._codec.decode_as(planned, spec.wire, spec.after)
        except BadFrame as bad:
            why = _WRONG.get(bad.kind, f"{bad.kind} at byte {bad.end}")
            what = f"this is not a frame of {message.name}: {why}"
            hint = f"`qlinkgen explain {self._protocol.schema_file} {spec.wire.hex()}` describes every byte"
            self._error(place, what, hint)
            return None
        found = decoded.message.name
        if found != message.name and decoded.message.message.carries and not spec.after:
            self._error(
                path, "only its request tells what this frame is", "add after: the bytes of the request"
            )
            return None
        if found != message.name:
            self._error(place, f"this is a frame of {found}", f"move the example to {found}")
            return None
        values = {**decoded.values, **decoded.beside}
        sent = self._codec.encode(found, values, decoded.address, spec.after)
        if sent != spec.wire and not spec.decode_only:
            what = f"an encoder sends these values as {sent.hex(' ').upper()}"
            self._error(place, what, "correct one of both, or add decode_only: true")
        return decoded

    def _compare_address(
        self, message: Message, decoded: Decoded, given: dict[str, object], path: Path
    ) -> None:
        """Compare the address, and remove it from the values given."""
        name = self._protocol.address_name if message.addresses else None
        if name and given.pop(_key(name), message.default_address) != decoded.address:
            place = (*path, _key(name))
            self._error(place, f"{name} is {decoded.address} in these bytes", "correct one of both")

    def _compare(
        self,
        owner: str,
        values: Mapping[str, tuple[Value, Holder]],
        raws: Mapping[str, Raw],
        given: Mapping[str, object],
        path: Path,
    ) -> None:
        """Compare values by their keys; those that are left out have their default."""
        from qlinkgen.plan.natives import native_of  # noqa: PLC0415  # see build_examples

        unknown = [key for key in given if key not in values]
        for key in unknown:
            hint = did_you_mean(key, values, f"its values are {listed(values)}")
            self._error((*path, key), f"{owner} has no value {shown(key)}", hint, of_key=True)
        for key, (value, step) in values.items():
            if unknown and key not in given:
                continue  # probably misspelt
            found = to_json(value, native_of(step, raws[value.name]))
            try:
                native = from_json(value, cast("Json", given[key])) if key in given else _usual(value, raws)
            except BadValue as bad:
                self._error((*path, key), str(bad), f"these bytes have {_text(found)}")
                continue
            if to_json(value, native) != found:
                what = f"{key} is {_text(found)} in these bytes"
                self._error((*path, key), what, "correct one of both", of_key=key not in given)


def _usual(value: Value, raws: Mapping[str, Raw]) -> Native:
    """The default of a value; one with a condition has it wherever the bytes have the field."""
    if not value.field.when:
        return default_of(value)
    sent = raws[value.name] is not None
    return default_of(replace(value, field=replace(value.field, given=sent)))


def _key(name: str) -> str:
    """The key of a value of the frame, apart from those that every example may have."""
    return f"{name}_" if name in ExampleSpec.model_fields else name


def _text(value: Json) -> str:
    return str(value) if isinstance(value, int | float | Decimal) else shown(value)
