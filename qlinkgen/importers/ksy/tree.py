"""Reads a Kaitai Struct file into typed classes with the lines of their keys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Final

from qlinkgen.importers.notes import Notes
from qlinkgen.schema.source import Data, Path, Source, parse

#: Keys of an attribute that change its bytes in a way that schemas cannot state.
_REFUSED: Final[Mapping[str, str]] = {
    "process": "a process is code",
    "io": "another stream is not on the line",
    "pos": "a position is not on the line",
    "parent": "another parent is not known",
    "value": "a computed value has no bytes",
}
_KNOWN: Final = frozenset(
    """id doc doc-ref contents type repeat repeat-expr repeat-until if size size-eos enum valid terminator
    pad-right encoding include consume eos-error""".split()  # noqa: SIM905
)
_DEEPEST = 20


class Refused(Exception):
    """A construct without which the rest of a type has no meaning."""

    def __init__(self, line: int, text: str) -> None:
        """Keep line and text for a note."""
        super().__init__(text)
        self.line = line
        self.text = text


@dataclass(frozen=True, slots=True)
class Node:
    """A value of the file and its place."""

    value: Data
    path: Path
    source: Source

    @property
    def line(self) -> int:
        """Line of the key, or of the value in a list."""
        return self.source.position(self.path, of_key=True).line

    def get(self, key: str) -> Node | None:
        """The value of a key, None if this is not a mapping with it."""
        if isinstance(self.value, dict) and key in self.value:
            return Node(self.value[key], (*self.path, key), self.source)
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
                yield key, Node(value, (*self.path, key), self.source)

    @property
    def listed(self) -> Iterator[Node]:
        """The items of a list."""
        if isinstance(self.value, list):
            for at, value in enumerate(self.value):
                yield Node(value, (*self.path, at), self.source)


@dataclass(frozen=True, slots=True)
class Attribute:
    """A part of a sequence.

    Attributes:
        id: Its name.
        node: All of its keys.
        trouble: Why it cannot be taken, empty if it can.
    """

    id: str
    node: Node
    trouble: str = ""

    @property
    def line(self) -> int:
        """Line on which it begins."""
        return self.node.line

    def text(self, key: str) -> str:
        """The value of a key as text."""
        return self.node.text(key)

    @property
    def type(self) -> str:
        """Name of the type, empty for bytes and for a choice."""
        return self.text("type")

    @property
    def switch(self) -> Node | None:
        """The choice of a type."""
        found = self.node.get("type")
        return found if found is not None and isinstance(found.value, dict) else None

    @property
    def doc(self) -> str:
        """Its description."""
        return _doc(self.node)


@dataclass(slots=True)
class Type:
    """A type with the types and enums defined inside it.

    Attributes:
        name: Name as in the file; names of outer types precede it, with `::`.
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

    @property
    def line(self) -> int:
        """Line on which it begins."""
        return self.node.line

    @property
    def doc(self) -> str:
        """Its description."""
        return _doc(self.node)

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
            found = scope.types.get(first)
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
                holder = holder.types.get(each) if holder else None
            if holder is not None and last in holder.enums:
                return f"{holder.name}::{last}" if holder.outer else last, holder.enums[last]
            scope = scope.outer
        return None


def read_tree(text: str, notes: Notes) -> Type:
    """The outermost type.

    Raises:
        ImportFileError: the text is not YAML, or not a Kaitai Struct file.
    """
    source = parse(text)
    for fault in source.faults:
        if fault.rule == "duplicate-key":
            notes.add(fault.position.line, fault.message)
        else:
            raise notes.error(fault.position.line, f"this is not YAML: {fault.message}")
    root = Node(source.data, (), source)
    meta = root.get("meta")
    if meta is None or not (meta.text("id") or root.get("seq")):
        raise notes.error(1, "this is not a Kaitai Struct file: it has no meta with an id")
    for imported in (Node(meta.value, meta.path, source).get("imports") or Node(None, (), source)).listed:
        notes.add(imported.line, f"'{imported.word[:60]}' is not imported: types of other files are unknown")
    return _type("", root, None, notes)


def _type(name: str, node: Node, outer: Type | None, notes: Notes, depth: int = 0) -> Type:
    if depth > _DEEPEST:
        raise notes.error(node.line, f"types are nested more than {_DEEPEST} deep")
    meta = node.get("meta")
    endian = meta.get("endian") if meta else None
    if endian is not None and not endian.word:
        notes.add(endian.line, "a byte order that values decide is not taken")

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
    for each, value in (node.get("instances") or Node(None, (), node.source)).items:
        notes.add(value.line, f"instance {each[:60]} is left out: it is computed, or at a place of its own")
    for value in (node.get("params") or Node(None, (), node.source)).listed:
        notes.add(value.line, f"parameter {value.text('id')[:60]} is left out: it is not on the line")
    for at, value in enumerate((node.get("seq") or Node(None, (), node.source)).listed):
        found.attributes.append(_attribute(value, at))
    for each, value in (node.get("enums") or Node(None, (), node.source)).items:
        found.enums[each] = value
    for each, value in (node.get("types") or Node(None, (), node.source)).items:
        full = f"{name}::{each}" if name else each
        found.types[each] = _type(full, value, found, notes, depth + 1)
    return found


def _attribute(node: Node, at: int) -> Attribute:
    name = node.text("id") or f"unnamed_{at}"
    if not isinstance(node.value, dict):
        return Attribute(name, node, "it is not a mapping")
    for key, reason in _REFUSED.items():
        if key in node.value:
            return Attribute(name, node, reason)
    for key in node.value:
        if key not in _KNOWN and not key.startswith("-"):
            return Attribute(name, node, f"the key '{key[:40]}' is not known")
    if node.text("consume") == "false" or node.text("include") == "true" or node.text("eos-error") == "false":
        return Attribute(name, node, "a terminator that is kept or may be missing is not taken")
    return Attribute(name, node)


def _doc(node: Node) -> str:
    reference = node.text("doc-ref")
    return " ".join(filter(None, (node.text("doc").strip(), f"See {reference}." if reference else "")))
