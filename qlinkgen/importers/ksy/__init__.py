"""Imports a Kaitai Struct file: its frame if it has one, its types and enums."""

from __future__ import annotations

import os
from pathlib import Path

from qlinkgen.importers.document import Block, Document, Message, Notation, Record, Value, between
from qlinkgen.importers.frames import assumed
from qlinkgen.importers.ksy.bounds import bounded, size_of
from qlinkgen.importers.ksy.enums import Enums
from qlinkgen.importers.ksy.fields import Layout, Shared, is_open
from qlinkgen.importers.ksy.frame import LARGEST, Framed, framed, stream_of
from qlinkgen.importers.ksy.tree import Refused, Type, read_tree
from qlinkgen.importers.names import Names, schema_name
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.reading import content, text_of

__all__ = ["read_ksy"]


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
    root = read_tree(text_of(content(path), notes), notes)
    inside = stream_of(root, notes)
    order = "little" if inside.endian == "le" else "big"
    names = Names(notes, "type", types=True)
    shared = Shared(notes, order, names, Enums(names, notes))
    frame = _frame(inside, notes)
    meta = root.node.get("meta")
    called = (meta.text("id") if meta else "") or file.stem
    messages = _messages(frame, inside, called, shared)
    records = _records(shared)
    parts = _parts(frame, messages)
    messages = _bounded(messages, records, shared)
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


def _parts(frame: Framed | None, messages: tuple[Message, ...]) -> Value:
    """The frame that was found; without one the payload alone, if its size follows from its fields."""
    if frame is not None:
        return Block({"parts": Block(frame.parts)})
    if any(is_open(each.fields) for each in messages):
        return _assumed(messages)
    return Block({"parts": Block({"data": {"role": "payload", "size": between(0, LARGEST)}})})


def _frame(inside: Type, notes: Notes) -> Framed | None:
    try:
        return framed(inside, notes)
    except Refused as error:
        notes.add(error.line, f"the sequence is not divided into a frame: {error.text}")
        return None


def _messages(frame: Framed | None, inside: Type, called: str, shared: Shared) -> tuple[Message, ...]:
    names = Names(shared.notes, "message")
    if not inside.attributes:
        raise shared.notes.error(inside.line, "the file describes no bytes: it has no seq")
    listed: list[tuple[dict[str, Value], str, Type]]
    if frame is None:
        listed = [({}, inside.name.rpartition("::")[2] or called, inside)]
    else:
        listed = [({"id": number}, name, type_) for number, name, type_ in frame.messages]
    found: list[Message] = []
    for keys, name, type_ in listed:
        try:
            fields = Layout(type_, shared).fields(type_.attributes)
        except Refused as error:
            shared.notes.add(error.line, f"message {name[:60]} is left out: {error.text}")
            continue
        doc = type_.doc if type_.outer else ""
        numbered: dict[str, Value] = (
            {"id": 1, "confirmed": False} if frame is None and is_open(fields) else {}
        )
        found.append(Message(names.take(name, type_.line), fields, type_.line, {**keys, **numbered}, doc))
    return tuple(found)


def _assumed(messages: tuple[Message, ...]) -> Value:
    ids = [each.keys.get("id") for each in messages]
    greatest = max((int(each.text, 0) for each in ids if isinstance(each, Notation)), default=1)
    return assumed("A Kaitai Struct file", LARGEST, greatest)


def _bounded(
    messages: tuple[Message, ...], records: tuple[Record, ...], shared: Shared
) -> tuple[Message, ...]:
    sizes = {each.name: int(each.type[1:]) // 8 for each in shared.enums.all}
    for record in records:  # each after those that it contains
        sizes[record.name] = size_of(record.fields, sizes)
    return tuple(bounded(each, sizes, LARGEST) for each in messages)


def _records(shared: Shared) -> tuple[Record, ...]:
    """The records of all types that fields have; making one may ask for more."""
    made: dict[str, Record | None] = {}
    while left := [each for each in shared.wanted if each not in made]:
        for each in left:
            type_, called = shared.wanted[each]
            made[each] = None
            try:
                fields = Layout(type_, shared).fields(type_.attributes)
            except Refused as error:
                shared.notes.add(error.line, f"type {type_.name[:60]} is left out: {error.text}")
                continue
            made[each] = Record(called, fields, type_.line, type_.doc)
    return tuple(each for each in reversed(made.values()) if each is not None)
