"""Reads a dialect of MAVLink and the files that it includes."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from qlinkgen.importers.notes import Notes
from qlinkgen.importers.reading import Unreadable, content
from qlinkgen.importers.xml_tree import Element, parse_xml

_MOST_FILES = 50
_TYPE = re.compile(r"(?P<base>\w+?)(?:\[(?P<count>\d{1,3})\])?")
#: Bytes of each type on the wire.
SIZES: Final[Mapping[str, int]] = {
    "char": 1, "int8_t": 1, "uint8_t": 1, "int16_t": 2, "uint16_t": 2, "int32_t": 4, "uint32_t": 4,
    "int64_t": 8, "uint64_t": 8, "float": 4, "double": 8,
}  # fmt: skip
_VERSION = "uint8_t_mavlink_version"


@dataclass(frozen=True, slots=True)
class FieldOf:
    """A field of a message.

    Attributes:
        type: Type of one item.
        count: Number of items, 0 for a field that is not an array.
        version: It has the version of the dialect.
        extension: It is sent by MAVLink 2 only, and not part of the definition that is checked.
    """

    name: str
    type: str
    count: int
    version: bool
    extension: bool
    element: Element

    @property
    def size(self) -> int:
        """Bytes of the field."""
        return SIZES[self.type] * (self.count or 1)


@dataclass(frozen=True, slots=True)
class MessageOf:
    """A message as the dialect lists it."""

    name: str
    id: int
    fields: tuple[FieldOf, ...]
    element: Element
    notes: Notes

    @property
    def line(self) -> int:
        """Line of the message in its file."""
        return self.element.line


@dataclass
class Dialect:
    """A dialect with everything that it includes.

    Attributes:
        version: Version of the outermost file that states one.
        enums: The elements of each enum: files may add entries to one.
    """

    version: str = ""
    messages: dict[int, MessageOf] = field(default_factory=dict)
    enums: dict[str, list[tuple[Element, Notes]]] = field(default_factory=dict)


def read_dialect(path: Path | str, notes: Notes) -> Dialect:
    """Read a file and what it includes, from its own folder only.

    Raises:
        ImportFileError: the file cannot be read, is not a dialect, or includes too much.
    """
    dialect = Dialect()
    start = Path(os.fspath(path))
    waiting = [(start, notes, 0, notes)]
    known = {start.name}
    while waiting:
        file, own, line, from_ = waiting.pop(0)
        if len(known) > _MOST_FILES:
            raise notes.error(0, f"more than {_MOST_FILES} files are included")
        try:
            root = parse_xml(content(file), own)
        except Unreadable as error:
            if file == start:
                raise
            from_.add(line, f"{file.name} is not included: {error.message}")
            continue
        if root.name != "mavlink":
            raise own.error(root.line, f"the root is <{root.name}>, not <mavlink>: this is not a dialect")
        for include in root.all("include"):
            if include.text in known:
                continue
            if include.text != Path(include.text).name or include.text in ("", ".."):
                own.add(
                    include.line,
                    f"'{include.text[:60]}' is not included: it is not a file of the same folder",
                )
                continue
            known.add(include.text)
            named = os.fspath(file.with_name(include.text))
            waiting.append((file.with_name(include.text), notes.of(named), include.line, own))
        _collect(dialect, root, own)
    return dialect


def _collect(dialect: Dialect, root: Element, notes: Notes) -> None:
    dialect.version = dialect.version or root.text_of("version")
    for group in root.all("enums"):
        for enum in group.all("enum"):
            dialect.enums.setdefault(enum.get("name"), []).append((enum, notes))
    for group in root.all("messages"):
        for element in group.all("message"):
            message = _message(element, notes)
            if message is None:
                continue
            other = dialect.messages.setdefault(message.id, message)
            if other is not message:
                notes.add(
                    message.line, f"message {message.name} is left out: {other.name} has its id {message.id}"
                )


def _message(element: Element, notes: Notes) -> MessageOf | None:
    name, number = element.get("name"), element.get("id")
    if not name or not (number.isascii() and number.isdecimal()) or int(number[:10]) >= 1 << 24:
        notes.add(element.line, f"message '{name[:40]}' is left out: it needs a name and an id of 24 bits")
        return None
    try:
        return MessageOf(name, int(number), tuple(_fields(element)), element, notes)
    except _Unknown as error:
        notes.add(error.line, f"message {name[:40]} is left out: {error}")
        return None


class _Unknown(Exception):
    """A field with a type that MAVLink does not have."""

    def __init__(self, line: int, text: str) -> None:
        super().__init__(text)
        self.line = line


def _fields(message: Element) -> Iterator[FieldOf]:
    extension = False
    for each in message.children:
        if each.name == "extensions":
            extension = True
        elif each.name == "field":
            text = each.get("type")
            found = _TYPE.fullmatch("uint8_t" if text == _VERSION else text)
            base = found["base"] if found else ""
            base = {"array": "int8_t"}.get(base, base)
            base = base if base in SIZES else f"{base}_t"
            if found is None or base not in SIZES or not each.get("name"):
                raise _Unknown(each.line, f"the type of field '{each.get('name')[:40]}' is '{text[:40]}'")
            yield FieldOf(each.get("name"), base, int(found["count"] or 0), text == _VERSION, extension, each)
