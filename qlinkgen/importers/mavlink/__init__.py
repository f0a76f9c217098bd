"""Imports a dialect of MAVLink: messages, enums, and the frame of version 1 or 2."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from qlinkgen.importers import cells
from qlinkgen.importers.document import Block, Document, Field, Message, Notation, Value, between
from qlinkgen.importers.mavlink.dialect import SIZES, Dialect, FieldOf, MessageOf, read_dialect
from qlinkgen.importers.mavlink.enums import Enums, described
from qlinkgen.importers.mavlink.layout import crc_extra, wire_order
from qlinkgen.importers.names import Names, schema_name
from qlinkgen.importers.notes import Notes

__all__ = ["read_mavlink"]

#: Names that a note lists.
_SHOWN = 5
_TYPES = {
    **{each: f"{'u' if each.startswith('u') else 'i'}{8 * size}" for each, size in SIZES.items()},
    "char": "u8",
    "float": "f32",
    "double": "f64",
}
#: Units of a fraction of another one that no one writes: steps in one of it, and its name.
_STEPS = {
    "degE7": (10**7, "deg"),
    "degE5": (10**5, "deg"),
    "cdeg": (100, "deg"),
    "ddeg": (10, "deg"),
    "cdegC": (100, "degC"),
    "cA": (100, "A"),
    "dA": (10, "A"),
    "c%": (100, "%"),
    "d%": (10, "%"),
}
_COVERED = {
    1: ["length", "sequence", "system", "component", "number", "data"],
    2: ["length", "incompatible", "compatible", "sequence", "system", "component", "number", "data"],
}
#: Parts that are attributes of messages, as their fields are.
_VALUES = {"compatible", "sequence", "system", "component"}


def read_mavlink(
    path: Path | str,
    notes: Notes,
    *,
    name: str = "",
    version: Literal[1, 2] = 2,
    only: Sequence[str] = (),
) -> Document:
    """Read a dialect with the files that it includes.

    Args:
        path: The XML file.
        notes: Told of what is left out.
        name: Name of the protocol; that of the file by default.
        version: Version of the frame. Version 1 has no extensions, and ids of one byte.
        only: The messages to take; all by default.

    Raises:
        ImportFileError: a file cannot be read, or is not a dialect.
    """
    dialect = read_dialect(path, notes)
    file = Path(os.fspath(path))
    messages = _chosen(dialect, notes, version, only)
    enums = Enums(dialect.enums, notes)
    names = Names(notes, "message")
    items = tuple(_message(each, names, enums, dialect, version) for each in messages)
    if left := enums.unused():
        notes.add(0, f"enums of no field are left out: {_some(left)}")
    return Document(
        protocol={
            "name": name or schema_name(file.stem, "protocol"),
            "title": f"MAVLink {version}, dialect {file.stem}",
            "revision": dialect.version,
            "source": file.name,
        },
        byteorder="little",
        frame=_frame(version, {field.name for item in items for field in item.fields}),
        bus={"kind": "master_slave", "nodes": between(1, 255)},
        sections={"enums": enums.enums, "flags": enums.flags, "messages": items},
        attributes={"crc_extra": {"type": "u8", "doc": "Checksum of the definition of the message"}},
    )


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more


def _chosen(dialect: Dialect, notes: Notes, version: Literal[1, 2], only: Sequence[str]) -> list[MessageOf]:
    by_name = {schema_name(each.name): each for each in dialect.messages.values()}
    for name in only:
        if schema_name(name) not in by_name:
            raise notes.error(0, f"message {name} is not in the dialect")
    wanted = [by_name[schema_name(name)] for name in only] or list(dialect.messages.values())
    found = sorted(wanted, key=lambda each: each.id)
    far = [each.name for each in found if version == 1 and each.id > 0xFF]
    if far:
        notes.add(0, f"messages with ids above 255 need MAVLink 2 and are left out: {_some(far)}")
        found = [each for each in found if each.id <= 0xFF]
    return found


def _message(
    message: MessageOf, names: Names, enums: Enums, dialect: Dialect, version: Literal[1, 2]
) -> Message:
    own = Names(message.notes, "field")
    fields = tuple(
        _field(each, own, enums, dialect, message.notes)
        for each in wire_order(message, extensions=version == 2)
    )
    return Message(
        names.take(message.name, message.line, message.notes),
        fields,
        message.line,
        {"id": message.id, "attributes": {"crc_extra": crc_extra(message)}},
        described(message.element),
        message.notes,
    )


def _field(found: FieldOf, names: Names, enums: Enums, dialect: Dialect, notes: Notes) -> Field:
    element = found.element
    name = names.take(found.name, element.line)
    type_, keys = _TYPES[found.type], dict[str, Value]()
    if found.version and dialect.version.isdecimal():
        keys["const"] = int(dialect.version[:3])
    if element.get("enum"):
        if type_[0] in "ui" and found.type != "char":
            type_ = enums.of(element.get("enum"), type_, element.line, notes)
        else:
            notes.add(
                element.line, f"the enum {element.get('enum')[:60]} is left out: {name} is not an integer"
            )
    elif type_[0] in "ui" and not found.version:
        keys |= _scale(element.get("multiplier"), element.line, notes)
    keys |= _unit(
        element.get("units"), scaled="scale" in keys, whole=type_[0] in "ui" and not element.get("enum")
    )
    if found.count:
        type_, keys = _array(found, type_, keys)
    invalid = f"Invalid: {element.get('invalid')}." if element.get("invalid") else ""
    return Field(name, type_, element.line, keys, " ".join(filter(None, (described(element), invalid))))


def _array(found: FieldOf, type_: str, keys: dict[str, Value]) -> tuple[str, dict[str, Value]]:
    if found.type == "char":
        return f"text[{found.count}]", {"pad": Notation("00")}
    if type_ == "u8" and not keys:
        return f"bytes[{found.count}]", keys
    return f"{type_}[{found.count}]", keys


def _scale(multiplier: str, line: int, notes: Notes) -> dict[str, Value]:
    if not multiplier:
        return {}
    value = cells.number(multiplier)
    if not value:
        notes.add(line, f"multiplier '{multiplier[:40]}' is not a number and left out")
        return {}
    return {} if value == 1 else {"scale": Notation(cells.spelt(value))}


def _unit(unit: str, *, scaled: bool, whole: bool) -> dict[str, Value]:
    """The unit of a field; that of integers without its decimal prefix, if it is not one of SI."""
    if unit in _STEPS and whole and not scaled:
        steps, plain = _STEPS[unit]
        return {"scale": Notation(f"1/{steps}"), "unit": plain}
    return {"unit": unit} if unit else {}


def _frame(version: Literal[1, 2], taken: set[str]) -> Value:
    """The frame; values of every frame are not called like a field."""
    named = {each: f"frame_{each}" if each in taken & _VALUES else each for each in _COVERED[version]}
    head: dict[str, Value] = {"start": Notation("FD" if version == 2 else "FE")}
    head["length"] = {"type": "u8", "counts": ["data"]}
    if version == 2:
        head["incompatible"] = {"type": "u8", "const": 0}  # such as a signature
        head[named["compatible"]] = {"type": "u8", "default": 0}
    data: dict[str, Value] = {"role": "payload", "size": between(0, 255)}
    check: dict[str, Value] = {
        "type": "u16",
        "algorithm": "crc-16/mcrf4xx",
        "over": [*named.values(), "attribute.crc_extra"],
    }
    parts: dict[str, Value] = {
        **head,
        named["sequence"]: {"role": "counter", "type": "u8", "per": "frame"},
        named["system"]: {"role": "address", "type": "u8"},
        named["component"]: {"type": "u8", "default": 1},
        "number": {"role": "message", "type": "u24" if version == 2 else "u8"},
        "data": {**data, "trim": {"zeros": True, "keep": 1}} if version == 2 else data,
        "crc": check,
    }
    return Block({"parts": Block(parts)})
