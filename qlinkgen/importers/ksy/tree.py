"""Reads a Kaitai Struct file into typed classes with the lines of their keys."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path as FilePath
from typing import Final

from qlinkgen.importers.notes import Notes
from qlinkgen.importers.reading import Unreadable, content, text_of
from qlinkgen.schema.source import Data, Path, Source, parse

#: Keys of an attribute that change its bytes in a way that schemas cannot state.
_REFUSED: Final[Mapping[str, str]] = {
    "io": "another stream is not on the line",
    "pos": "a position is not on the line",
    "parent": "another parent is not known",
    "value": "a computed value has no bytes",
}
_KNOWN: Final = frozenset(
    """id doc doc-ref contents type repeat repeat-expr repeat-until if size size-eos enum valid terminator
    pad-right encoding include consume eos-error process""".split()  # noqa: SIM905
)
_DEEPEST = 20
_MOST_FILES = 100
_ASKED = re.compile(r"\b([a-z][a-z0-9_]*)\.")


class Refused(Exception):
    """A construct without which the rest of a type has no meaning."""

    def __init__(self, where: Node | Attribute, text: str) -> None:
        """Keep place and text for a note."""
        super().__init__(text)
        self._where = where
        self._text = text

    def note(self, about: str) -> None:
        """Add a note on what is left out because of it."""
        self._where.notes.add(self._where.line, f"{about}: {self._text}")


@dataclass(frozen=True, slots=True)
class Node:
    """A value of the file and its place.

    Attributes:
        notes: Those on its file.
    """

    value: Data
    path: Path
    source: Source
    notes: Notes

    @property
    def line(self) -> int:
        """Line of the key, or of the value in a list."""
        return self.source.position(self.path, of_key=True).line

    def get(self, key: str) -> Node | None:
        """The value of a key, None if this is not a mapping with it."""
        if isinstance(self.value, dict) and key in self.value:
            return Node(self.value[key], (*self.path, key), self.source, self.notes)
        return None

    def text(self, key: str) -> str:
        """The value of a key as text, empty if there is none."""
        found = self.get(key)
        return found.word if found else ""

    @property
    def word(self) -> str:
        """The value as text, empty for mappings and lists."""
        if isinstance(self.value, bool):
            return "true" if self.value else "false"
        return str(self.value) if isinstance(self.value, str | int | Decimal) else ""

    @property
    def items(self) -> Iterator[tuple[str, Node]]:
        """The keys and values of a mapping."""
        if isinstance(self.value, dict):
            for key, value in self.value.items():
                yield key, Node(value, (*self.path, key), self.source, self.notes)

    def mapping(self, key: str) -> Iterator[tuple[str, Node]]:
        """The keys and values of the mapping under a key."""
        found = self.get(key)
        return found.items if found else iter(())

    def listing(self, key: str) -> Iterator[Node]:
        """The items of the list under a key."""
        found = self.get(key)
        return found.listed if found else iter(())

    @property
    def listed(self) -> Iterator[Node]:
        """The items of a list."""
        if isinstance(self.value, list):
            for at, value in enumerate(self.value):
                yield Node(value, (*self.path, at), self.source, self.notes)


@dataclass(frozen=True, slots=True)
class Attribute:
    """A part of a sequence.

    Attributes:
        id: Its name.
        node: All of its keys.
        scope: The type of whose sequence it is, in which names are looked up.
        trouble: Why it cannot be taken, empty if it can.
        within: The fields in whose place it is: of records that are divided, from the outside inwards.
        label: What it is called, the id by default.
        given: The choices of which it is a part of a case, each with the numbers of the case.
    """

    id: str
    node: Node
    scope: Type
    trouble: str = ""
    within: tuple[str, ...] = ()
    label: str = ""
    given: tuple[tuple[Attribute, tuple[int, ...]], ...] = ()

    @property
    def line(self) -> int:
        """Line on which it begins."""
        return self.node.line

    @property
    def notes(self) -> Notes:
        """Those on its file."""
        return self.node.notes

    @property
    def path(self) -> str:
        """What an expression of the outermost sequence calls it."""
        return ".".join((*self.within, self.id))

    @property
    def single(self) -> bool:
        """Whether it is always present, once."""
        return not self.text("repeat") and not self.text("if")

    def text(self, key: str) -> str:
        """The value of a key as text."""
        return self.node.text(key)

    @property
    def type(self) -> str:
        """Name of the type, empty for bytes and for a choice."""
        return "" if self.text("process") else self.text("type")

    @property
    def switch(self) -> Node | None:
        """The choice of a type."""
        found = self.node.get("type")
        choice = found is not None and isinstance(found.value, dict) and not self.text("process")
        return found if choice else None

    @property
    def doc(self) -> str:
        """Its description."""
        return _doc(self.node)


@dataclass(slots=True)
class Type:
    """A type with the types and enums defined inside it.

    Attributes:
        name: Name as in the file; names of outer types precede it, with `::`.
        instances: What is computed, by name.
        imported: The outermost types of other files, by name.
        asked: Names of records in the file whose fields are in expressions; of an outermost type.
    """

    name: str
    node: Node
    outer: Type | None
    endian: str
    bit_endian: str
    encoding: str
    attributes: list[Attribute] = field(default_factory=list)
    types: dict[str, Type] = field(default_factory=dict)
    enums: dict[str, Node] = field(default_factory=dict)
    instances: dict[str, Node] = field(default_factory=dict)
    imported: dict[str, Type] = field(default_factory=dict)
    asked: frozenset[str] = frozenset()

    @property
    def line(self) -> int:
        """Line on which it begins."""
        return self.node.line

    @property
    def notes(self) -> Notes:
        """Those on its file."""
        return self.node.notes

    @property
    def doc(self) -> str:
        """Its description."""
        return _doc(self.node)

    @property
    def referenced(self) -> frozenset[str]:
        """Names of records in the file whose fields are in expressions."""
        return self.outer.referenced if self.outer else self.asked

    @property
    def expressions(self) -> Iterator[str]:
        """The expressions of its fields and instances."""
        for each in self.attributes:
            for key in ("size", "repeat-expr", "if"):
                yield each.text(key)
            if each.switch is not None:
                yield each.switch.text("switch-on")
        for instance in self.instances.values():
            yield instance.text("value")

    def all(self) -> Iterator[Type]:
        """This type and all inside it."""
        yield self
        for each in self.types.values():
            yield from each.all()

    def find_type(self, name: str) -> Type | None:
        """The type of a name, looked for from here outwards."""
        first, *rest = name.split("::")
        scope: Type | None = self
        while scope is not None:
            found = scope.types.get(first) or scope.imported.get(first)
            for each in rest:
                found = found.types.get(each) if found else None
            if found is not None:
                return found
            scope = scope.outer
        return None

    def find_enum(self, name: str) -> tuple[str, Node] | None:
        """Full name and values of an enum, looked for from here outwards."""
        *path, last = name.split("::")
        scope: Type | None = self
        while scope is not None:
            holder: Type | None = scope
            for each in path:
                holder = holder.types.get(each) or holder.imported.get(each) if holder else None
            if holder is not None and last in holder.enums:
                return f"{holder.name}::{last}" if holder.name else last, holder.enums[last]
            scope = scope.outer
        return None


def read_tree(path: FilePath, notes: Notes) -> Type:
    """The outermost type of a file, with those of the files of the same folder that it imports.

    Raises:
        ImportFileError: a file cannot be read, is not YAML, or not a Kaitai Struct file.
    """
    read: dict[str, Type] = {}
    root = read[path.name] = _read(path, "", notes)
    waiting = [root]
    while waiting:
        importing = waiting.pop()
        meta = importing.node.get("meta")
        for each in meta.listing("imports") if meta else ():
            name = each.word
            file = f"{name}.ksy"
            if not name or file != FilePath(file).name:
                importing.notes.add(each.line, f"'{name[:60]}' is not imported: it is not beside this file")
                continue
            if file not in read:
                if len(read) >= _MOST_FILES:
                    raise notes.error(0, f"more than {_MOST_FILES} files are imported")
                try:
                    own = notes.of(os.fspath(FilePath(notes.file).with_name(file)))
                    read[file] = _read(path.with_name(file), name, own)
                except Unreadable as error:
                    importing.notes.add(each.line, f"'{name[:60]}' is not imported: {error.message}")
                    continue
                waiting.append(read[file])
            importing.imported[name] = read[file]
    return root


def _read(path: FilePath, name: str, notes: Notes) -> Type:
    source = parse(text_of(content(path), notes))
    for fault in source.faults:
        if fault.rule == "duplicate-key":
            notes.add(fault.position.line, fault.message)
        else:
            raise notes.error(fault.position.line, f"this is not YAML: {fault.message}")
    root = Node(source.data, (), source, notes)
    meta = root.get("meta")
    if meta is None or not (meta.text("id") or root.get("seq")):
        raise notes.error(1, "this is not a Kaitai Struct file: it has no meta with an id")
    found = _type(name, root, None)
    texts = " ".join(each for type_ in found.all() for each in type_.expressions)
    found.asked = frozenset(_ASKED.findall(texts))
    return found


def _type(name: str, node: Node, outer: Type | None, depth: int = 0) -> Type:
    if depth > _DEEPEST:
        raise node.notes.error(node.line, f"types are nested more than {_DEEPEST} deep")
    meta = node.get("meta")
    endian = meta.get("endian") if meta else None
    if endian is not None and not endian.word:
        node.notes.add(endian.line, "a byte order that values decide is not taken")

    def of(key: str, inherited: str) -> str:
        return (meta.text(key) if meta else "") or inherited

    found = Type(
        name,
        node,
        outer,
        of("endian", outer.endian if outer else ""),
        of("bit-endian", outer.bit_endian if outer else "be"),
        of("encoding", outer.encoding if outer else ""),
    )
    for each, value in node.mapping("instances"):
        found.instances[each] = value
        node.notes.add(
            value.line, f"instance {each[:60]} is left out: it is computed, or at a place of its own"
        )
    for value in node.listing("params"):
        node.notes.add(value.line, f"parameter {value.text('id')[:60]} is left out: it is not on the line")
    for at, value in enumerate(node.listing("seq")):
        found.attributes.append(_attribute(value, at, found))
    for each, value in node.mapping("enums"):
        found.enums[each] = value
    for each, value in node.mapping("types"):
        full = f"{name}::{each}" if name else each
        found.types[each] = _type(full, value, found, depth + 1)
    return found


def _attribute(node: Node, at: int, scope: Type) -> Attribute:
    name = node.text("id") or f"unnamed_{at}"
    if not isinstance(node.value, dict):
        return Attribute(name, node, scope, "it is not a mapping")
    for key, reason in _REFUSED.items():
        if key in node.value:
            return Attribute(name, node, scope, reason)
    for key in node.value:
        if key not in _KNOWN and not key.startswith("-"):
            return Attribute(name, node, scope, f"the key '{key[:40]}' is not known")
    if node.text("consume") == "false" or node.text("include") == "true" or node.text("eos-error") == "false":
        return Attribute(name, node, scope, "a terminator that is kept or may be missing is not taken")
    if process := node.text("process"):
        if not node.text("size") and not node.text("size-eos"):
            return Attribute(name, node, scope, "a process is code, and the number of bytes is not stated")
        node.notes.add(node.line, f"{name[:60]} is a byte string: the process {process[:40]} is code")
    return Attribute(name, node, scope)


def _doc(node: Node) -> str:
    reference = node.text("doc-ref")
    return " ".join(filter(None, (node.text("doc").strip(), f"See {reference}." if reference else "")))
