"""Imports a Kaitai Struct file: its frame if it has one, its types and enums."""

from __future__ import annotations

import os
from pathlib import Path

from qlinkgen.importers.document import Block, Document, Message, Notation, Record, Value, between
from qlinkgen.importers.frames import assumed
from qlinkgen.importers.ksy.bounds import bounded, limited, size_of, varies
from qlinkgen.importers.ksy.enums import Enums
from qlinkgen.importers.ksy.fields import Layout, Shared, is_open
from qlinkgen.importers.ksy.flat import record_of
from qlinkgen.importers.ksy.frame import LARGEST, Framed, framed, stream_of
from qlinkgen.importers.ksy.tree import Refused, Type, read_tree
from qlinkgen.importers.names import Names, schema_name
from qlinkgen.importers.notes import Notes

__all__ = ["read_ksy"]

#: Bytes or items of the largest field of variable size in a record.
_LARGEST_FIELD = 255


def read_ksy(path: Path | str, notes: Notes, *, name: str = "") -> Document:
    """Read a Kaitai Struct file.

    Args:
        path: The file.
        notes: Told of what is left out.
        name: Name of the protocol; the id of the file by default.

    Raises:
        ImportFileError: the file cannot be read, or is not a Kaitai Struct file.
    """
    file = Path(os.fspath(path))
    root = read_tree(file, notes)
    inside = stream_of(root, notes)
    order = "little" if inside.endian == "le" else "big"
    names = Names(notes, "type", types=True)
    shared = Shared(notes, order, names, Enums(names, notes))
    frame = _frame(inside, notes)
    meta = root.node.get("meta")
    called = (meta.text("id") if meta else "") or file.stem
    messages = _messages(frame, inside, called, shared)
    records = _records(shared)
    parts = _parts(frame, inside, messages)
    messages, records = _bounded(messages, records, shared)
    protocol: dict[str, Value] = {"name": name or schema_name(called, "protocol")}
    if meta and meta.text("title"):
        protocol["title"] = meta.text("title")
    protocol |= {"revision": "", "source": file.name}
    if root.doc:
        protocol["doc"] = root.doc
    return Document(
        protocol=protocol,
        byteorder=order,
        frame=parts,
        bus={"kind": "master_slave"},
        sections={"enums": shared.enums.all, "types": records, "messages": messages},
        other_frame=_assumed(messages),
        comment="" if frame else f"The file does not limit the payload; {LARGEST} bytes are an assumption.",
    )


def _parts(frame: Framed | None, inside: Type, messages: tuple[Message, ...]) -> Value:
    """The frame that was found; without one the payload alone, if its size follows from its fields."""
    if frame is not None:
        return Block({"parts": Block(frame.parts)})
    if any(is_open(each.fields) for each in messages) or not inside.attributes:
        return _assumed(messages)
    return Block({"parts": Block({"data": {"role": "payload", "size": between(0, LARGEST)}})})


def _frame(inside: Type, notes: Notes) -> Framed | None:
    try:
        return framed(inside, notes)
    except Refused as error:
        error.note("the sequence is not divided into a frame")
        return None


def _messages(frame: Framed | None, inside: Type, called: str, shared: Shared) -> tuple[Message, ...]:
    names = Names(shared.notes, "message")
    listed: list[tuple[dict[str, Value], str, Type]]
    if frame is not None:
        listed = [({"id": number}, name, type_) for number, name, type_ in frame.messages]
    elif inside.attributes:
        listed = [({}, inside.name.rpartition("::")[2] or called, inside)]
    else:
        listed = [
            ({"id": at, "confirmed": False}, each.name.rpartition("::")[2], each)
            for at, each in enumerate(_unused(inside), 1)
        ]
        if not listed:
            raise shared.notes.error(inside.line, "the file describes no bytes: it has no seq")
    found: list[Message] = []
    for keys, name, type_ in listed:
        try:
            fields = Layout(type_, shared, record=False).fields()
        except Refused as error:
            error.note(f"message {name[:60]} is left out")
            continue
        doc = type_.doc if type_.outer else ""
        numbered: dict[str, Value] = (
            {"id": 1, "confirmed": False} if frame is None and not keys and is_open(fields) else {}
        )
        taken = names.take(name, type_.line, type_.notes)
        found.append(Message(taken, fields, type_.line, {**keys, **numbered}, doc, type_.notes))
    return tuple(found)


def _unused(root: Type) -> list[Type]:
    """The types that no other one has: the messages of a file without a sequence."""
    used: list[Type | None] = []
    for type_ in root.all():
        for each in type_.attributes:
            used.append(record_of(each))
            if each.switch is not None:
                used += [type_.find_type(case.word) for _, case in each.switch.mapping("cases")]
    return [each for each in root.types.values() if not any(each is other for other in used)]


def _assumed(messages: tuple[Message, ...]) -> Value:
    ids = [each.keys.get("id") for each in messages]
    numbers = [int(each.text, 0) if isinstance(each, Notation) else each for each in ids]
    greatest = max((each for each in numbers if isinstance(each, int)), default=1)
    return assumed("A Kaitai Struct file", LARGEST, greatest)


def _bounded(
    messages: tuple[Message, ...], records: tuple[Record, ...], shared: Shared
) -> tuple[tuple[Message, ...], tuple[Record, ...]]:
    """The messages and records with bounds, where fields need them."""
    sizes = {each.name: int(each.type[1:]) // 8 for each in shared.enums.all}
    limits: list[Record] = []
    varying: set[str] = set()
    for record in records:  # each after those that it contains
        limits.append(limited(record, sizes, _LARGEST_FIELD))
        sizes[record.name] = size_of(record.fields, sizes)
        if varies(limits[-1].fields, varying):
            varying.add(record.name)
    return tuple(bounded(each, sizes, varying, LARGEST) for each in messages), tuple(limits)


def _records(shared: Shared) -> tuple[Record, ...]:
    """The records of all types that fields have; making one may ask for more."""
    made: dict[str, Record | None] = {}
    while left := [each for each in shared.wanted if each not in made]:
        for each in left:
            type_, called = shared.wanted[each]
            made[each] = None
            try:
                fields = Layout(type_, shared).fields()
            except Refused as error:
                error.note(f"type {type_.name[:60]} is left out")
                continue
            made[each] = Record(called, fields, type_.line, type_.doc, type_.notes)
    return tuple(each for each in reversed(made.values()) if each is not None)
