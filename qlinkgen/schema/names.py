"""Names: checks spelling, and that names remain distinct after conversion to Python and C."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from qlinkgen.model import naming
from qlinkgen.model.fields import Layout, Records, Value, layouts_of
from qlinkgen.model.frame import DelimitedFrame, Frame, FrameKinds
from qlinkgen.model.message import Message
from qlinkgen.model.naming import snake, upper
from qlinkgen.model.types import Array, Blob, Scalar
from qlinkgen.schema.bit_items import items_of
from qlinkgen.schema.file_fields import Fields, RecordSpec
from qlinkgen.schema.file_frames import PartSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.kinds import NAME_PATTERN
from qlinkgen.schema.layouts import layouts, own_steps
from qlinkgen.schema.notation import shown
from qlinkgen.schema.replies import reply_messages
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path
from qlinkgen.schema.steps import step_messages

#: Maximum length of a name. In C the names of protocol and message precede it and a suffix follows, and only
#: 63 characters of an identifier are significant (C99, 5.2.4.1).
MAX_NAME = 40
_NAME = re.compile(NAME_PATTERN.removesuffix("$") + r"\Z")
#: Suffixes of classes of constants whose name is taken.
_KINDS = {"enums": "enum", "flags": "flags"}
#: Macros that the C header defines for each message.
_MESSAGE_MACROS = ("init", "id", "min_size", "max_size", "max_frame_size", "max_wire_size")
#: Macros that the C header defines for each scaled type.
_TYPE_MACROS = ("factor", "bias", "divisor")
#: Macros that the C header defines for each record.
_RECORD_MACROS = ("init", "size")
_GLOBAL_MACROS = ("ok", "max_payload_size", "max_wire_size", "enable_float")


def check_names(
    file: SchemaFile,
    frame: Frame | None,
    messages: Sequence[Message],
    places: Mapping[str, Path],
    report: Reporter,
) -> None:
    """Check every name of a file: spelling, reserved words, clashes after conversion.

    ``places`` are the paths of the fields of messages.
    """
    check = _Checker(report)
    check.spelling(file.protocol.name, ("protocol", "name"))
    check.declared(file)
    for name in file.attributes:
        check.spelling(name, ("attributes", name))
    address = check.parts(file, frame)
    for name in file.commands:
        check.spelling(name, ("commands", name))
    for name in file.messages:
        check.spelling(name, ("messages", name))
    for path, replies in _reply_groups(file):
        for name in replies:
            check.spelling(name, (*path, name))
    check.steps(file)
    for layout in layouts(file):
        check.fields(layout.fields, layout.path)
    records = layouts_of(field for message in messages for field in message.fields)
    for c in (False, True):
        for message in messages:
            beside = () if c else tuple(_beside(frame, address, places[message.name]))
            check.clashes((*beside, *_attributes(message.values, places[message.name], c=c)))
        for record in records:
            check.clashes(_attributes(record.values, ("types", record.name, "fields"), c=c))
    check.clashes(_classes(file))
    check.clashes(_methods(file))
    check.clashes(_macros(file, messages, places))


class _Checker:
    """Reports invalid names and clashes."""

    def __init__(self, report: Reporter) -> None:
        self._report = report

    def _error(self, rule: str, path: Path, what: str, hint: str) -> None:
        self._report.error(rule, path, what, hint, of_key=True, needs=())

    def spelling(self, name: str, path: Path) -> bool:
        if len(name) > MAX_NAME:
            what = f"{shown(name)} has {len(name)} characters"
            hint = f"use at most {MAX_NAME}: only 63 characters of a C identifier are significant"
            self._error("bad-name", path, what, hint)
            return False
        if _NAME.match(name):
            return True
        hint = "use lower-case letters, digits and underscores, beginning with a letter"
        self._error("bad-name", path, f"{shown(name)} is not a name", hint)
        return False

    def declared(self, file: SchemaFile) -> None:
        """Names of enums, flags, types and sides."""
        for group in ("enums", "flags"):
            for name, spec in getattr(file, group).items():
                self.spelling(name, (group, name))
                for member in spec.values:
                    self.spelling(member, (group, name, "values", member))
        for name in file.types:
            self.spelling(name, ("types", name))
        for index, side in enumerate(file.bus.sides or ()):
            self.spelling(side, ("bus", "sides", index))

    def parts(self, file: SchemaFile, frame: Frame | None) -> str | None:
        """Check the names of the parts of a frame; return the name of the address."""
        address = "address" if file.frame.marked is not None else None
        groups: list[tuple[Path, Mapping[str, PartSpec]]] = [
            (("frame", group), getattr(file.frame, group) or {}) for group in ("parts", "packet")
        ]
        for kind, spec in file.frames.items():
            self.spelling(kind, ("frames", kind))
            groups.append((("frames", kind, "parts"), spec.parts))
        for path, parts in groups:
            owners: dict[str, str] = {}
            for name, part in parts.items():
                self.spelling(name, (*path, name))
                if part.told == "address":
                    address = name
                for inner, bits in (part.bits or {}).items():
                    place = (*path, name, "bits", inner)
                    self.spelling(inner, place)
                    if inner in parts:
                        self._error(
                            "name-clash", place, f"{inner} is also a part of the frame", "rename one of them"
                        )
                    elif (owner := owners.setdefault(inner, name)) != name:
                        self._error("name-clash", place, f"{inner} is also in {owner}", "rename one of them")
                    if bits.role == "address":
                        address = inner
        stated = frame.address if isinstance(frame, DelimitedFrame) else None
        return stated.name if stated else address

    def steps(self, file: SchemaFile) -> None:
        for command, spec in file.commands.items():
            for step in own_steps(command, spec):
                self.spelling(step.name, (*step.path, "name") if step.spec.name else step.path)

    def fields(self, fields: Fields, path: Path) -> None:
        for name, spec in fields.items():
            self.spelling(name, (*path, name))
            for member in spec.bits or {}:
                self.spelling(member, (*path, name, "bits", member))

    def clashes(self, names: Iterable[tuple[str, str, Path]]) -> None:
        """Report equal names among (converted name, text for messages, path)."""
        seen: dict[str, str] = {}
        for result, called, path in names:
            other = seen.setdefault(result, called)
            if other != called:
                what = f"{called} and {other} both become {result}"
                self._error("name-clash", path, what, "rename one of them")


def _reply_groups(file: SchemaFile) -> Iterator[tuple[Path, Iterable[str]]]:
    yield ("replies",), file.replies
    yield from ((("commands", name, "replies"), each.replies) for name, each in file.commands.items())


def _beside(frame: Frame | None, address: str | None, path: Path) -> Iterator[tuple[str, str, Path]]:
    """Attributes of a message for the address and the values of its frame."""
    if address is not None:
        yield naming.address_attribute(address), f"the frame's '{address}'", path
    for value in frame.values if isinstance(frame, DelimitedFrame | FrameKinds) else ():
        yield naming.attribute(value.name), f"the frame's '{value.name}'", path


def _attributes(values: Iterable[Value], path: Path, *, c: bool) -> Iterator[tuple[str, str, Path]]:
    """Attributes of a message or record, or members of its C struct."""
    spelt = naming.member if c else naming.attribute
    for value in values:
        inside = ("bits", value.name) if value.bits else ()
        place = (*path, value.field.name, *inside)
        called = f"'{value.name}' in {value.field.name}" if inside else f"'{value.name}'"
        yield spelt(value.name), called, place
        if c and isinstance(value.type, Array | Blob | Records) and not value.type.length.fixed:
            suffix = value.type.quantity
            yield f"{value.name}_{suffix}", f"the {suffix} of '{value.name}'", place
        if c and value.field.conditional:
            name = value.field.name
            yield f"has_{name}", f"whether '{name}' is present", (*path, name)


def _classes(file: SchemaFile) -> Iterator[tuple[str, str, Path]]:
    """Names of classes: enums, flags and messages."""
    messages = frozenset(map(naming.message_class, _messages(file)))
    for group in ("enums", "flags"):
        for name in getattr(file, group):
            found = naming.constant_class(name, _KINDS[group], messages)
            yield found, f"'{name}'", (group, name)
    for name in records_of(file):
        yield naming.constant_class(name, "record", messages), f"the record '{name}'", ("types", name)
    for name in file.commands:
        for direction in ("request", "response"):
            found = naming.message_class(f"{name}_{direction}")
            yield found, f"the {direction} of '{name}'", ("commands", name)
    for name, path in reply_messages(file):
        yield naming.message_class(snake(name)), f"the reply '{name}'", path
    for name, path in step_messages(file):
        yield naming.message_class(snake(name)), f"the step '{name}'", path
    for name in file.messages:
        yield naming.message_class(name), f"the message '{name}'", ("messages", name)


def records_of(file: SchemaFile) -> Iterator[str]:
    """Names of records, those of items with bits included."""
    items = items_of(file)
    return (name for name, spec in file.types.items() if isinstance(spec, RecordSpec) or name in items)


def _messages(file: SchemaFile) -> Iterator[str]:
    yield from (f"{name}_{direction}" for name in file.commands for direction in ("request", "response"))
    yield from (snake(name) for name, _ in (*reply_messages(file), *step_messages(file)))
    yield from file.messages


def _methods(file: SchemaFile) -> Iterator[tuple[str, str, Path]]:
    """Names of methods of bus modules, and of members of handler tables."""
    for name in file.commands:
        yield naming.method(name), f"the command '{name}'", ("commands", name)
    for name in file.messages:
        yield naming.method(name), f"the message '{name}'", ("messages", name)
    for name, path in reply_messages(file):
        yield naming.method(snake(name)), f"the reply '{name}'", path
    for name, path in step_messages(file):
        yield naming.method(snake(name)), f"the step '{name}'", path


def _class_base(file: SchemaFile, name: str) -> str:
    """The stem of a message; a suffix is appended if an enum or flags have the same name."""
    found = naming.stem(file.protocol.name, name, "message")
    return f"{found}_message" if found in file.enums or found in file.flags else found


def _macros(
    file: SchemaFile, messages: Sequence[Message], places: Mapping[str, Path]
) -> Iterator[tuple[str, str, Path]]:
    """Names of constants of the C header; its functions differ if they do."""
    prefix = upper(file.protocol.name)
    for name in _GLOBAL_MACROS:
        yield f"{prefix}_{upper(name)}", "a constant of every header", ("protocol", "name")
    for group in ("enums", "flags"):
        for name, spec in getattr(file, group).items():
            for member in spec.values:
                base = naming.stem(file.protocol.name, name, _KINDS[group])
                result = f"{prefix}_{upper(base)}_{upper(member)}"
                yield result, f"'{member}' of {name}", (group, name, "values", member)
    for stem, owner, macros, path in (*_macro_owners(file, messages), *_conversions(file, messages, places)):
        for macro in macros:
            yield f"{prefix}_{upper(stem)}_{upper(macro)}", f"a constant of {owner}", path


def _macro_owners(
    file: SchemaFile, messages: Sequence[Message]
) -> Iterator[tuple[str, str, Sequence[str], Path]]:
    """Stem, owner, suffixes and path of constants of the C header."""
    records = frozenset(records_of(file))
    for name in file.types:
        stem = _type_stem(file, messages, name)
        what, macros = ("record", _RECORD_MACROS) if name in records else ("type", _TYPE_MACROS)
        yield stem, f"the {what} '{name}'", macros, ("types", name)
    for name in file.commands:
        for direction in ("request", "response"):
            yield f"{name}_{direction}", f"{name}.{direction}", _MESSAGE_MACROS, ("commands", name)
    for name, path in reply_messages(file):
        yield _class_base(file, snake(name)), f"the reply '{name}'", _MESSAGE_MACROS, path
    yield from _step_owners(file)
    for name in file.messages:
        yield _class_base(file, name), f"the message '{name}'", _MESSAGE_MACROS, ("messages", name)


def _step_owners(file: SchemaFile) -> Iterator[tuple[str, str, Sequence[str], Path]]:
    """The same for dialogues, and for several answers, which a master counts."""
    for name, path in step_messages(file):
        yield _class_base(file, snake(name)), f"the step '{name}'", (*_MESSAGE_MACROS, "turn"), path
    for name, spec in file.commands.items():
        place: Path = ("commands", name, "steps")
        if spec.steps is not None:
            yield name, f"the dialogue '{name}'", ("steps",), place
        if spec.many is not None:
            yield f"{name}_answers", f"the answers of '{name}'", ("init",), ("commands", name, "many")
        for index, step in enumerate(spec.steps or ()):
            if isinstance(step.send, str):
                yield _class_base(file, step.send), f"the message '{step.send}'", ("turn",), (*place, index)


def _conversions(
    file: SchemaFile, messages: Sequence[Message], places: Mapping[str, Path]
) -> Iterator[tuple[str, str, Sequence[str], Path]]:
    """The same for scaled values that may have conversions of their own instead of those of their type.

    If fields narrow a type, the selected messages determine which of them have the conversions of the type.
    """
    owners: list[tuple[str, Message | Layout, Path]] = [
        (_class_base(file, snake(message.name)), message, places[message.name]) for message in messages
    ]
    for layout in layouts_of(field for message in messages for field in message.fields):
        path: Path = ("types", layout.name, "fields")
        owners.append((_type_stem(file, messages, layout.name), layout, path))
    variants: dict[str, set[object]] = {}
    for _, stated, _ in owners:
        for value in stated.values:
            if isinstance(value.type, Scalar):
                variants.setdefault(value.type.type_name, set()).add(_converted(value.type))
    for base, stated, path in owners:
        for value in stated.values:
            if not isinstance(value.type, Scalar) or value.type.scaling is None:
                continue
            if value.type.type_name and len(variants[value.type.type_name]) == 1:
                continue
            inside = ("bits", value.name) if value.bits else ()
            owner = f"'{value.name}' of {stated.name}"
            yield f"{base}_{value.name}", owner, _TYPE_MACROS, (*path, value.field.name, *inside)


def _type_stem(file: SchemaFile, messages: Sequence[Message], name: str) -> str:
    """The stem of a named type; a suffix is appended if a message or one of its values has the same name."""
    taken = set()
    for message in messages:
        own = _class_base(file, snake(message.name))
        taken |= {own, *(f"{own}_{value.name}" for value in message.values)}
    stem = naming.stem(file.protocol.name, name, "type")
    while stem in taken:
        stem += "_type"
    return stem


def _converted(number: Scalar) -> object:
    """What a conversion depends on."""
    return number.bits, number.signed, number.minimum, number.maximum, number.scaling, number.unit
