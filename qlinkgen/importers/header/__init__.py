"""Imports the structures and enums of a C header."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal

from qlinkgen.importers.document import Constant, Constants, Document, Message, Record
from qlinkgen.importers.frames import assumed
from qlinkgen.importers.header.comments import Comments
from qlinkgen.importers.header.directives import Directives
from qlinkgen.importers.header.layout import Laid, Layouts, Types, integer_of
from qlinkgen.importers.header.nodes import CType, Declared, Enumeration, Refused, Structure
from qlinkgen.importers.header.pieces import pieces
from qlinkgen.importers.header.tokens import scan
from qlinkgen.importers.header.tree import Trees
from qlinkgen.importers.names import Names, schema_name, without_prefix
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.reading import content, text_of

__all__ = ["read_header"]

_SUFFIXES = ("_t", "_s", "_st", "_e")


def read_header(
    path: Path | str,
    notes: Notes,
    *,
    name: str = "",
    byteorder: Literal["big", "little"] = "little",
    structs: Sequence[str] = (),
) -> Document:
    """Read a C header.

    Args:
        path: The file.
        notes: Told of what is left out, of padding and of assumptions.
        name: Name of the protocol; that of the file by default.
        byteorder: Byte order of the machine, which is that of the line.
        structs: The structures that are messages; by default those that no other one contains.

    Raises:
        ImportFileError: the file cannot be read, is not a header, or has no structure for a message.
        ExtraMissing: the package `pycparser` is not installed.
    """
    tokens, comments = scan(text_of(content(path), notes), notes)
    trees = Trees(notes)
    declared = [each for piece in pieces(Directives(notes).run(tokens), notes) for each in trees.read(piece)]
    return _Header(path, notes, Comments(comments), declared, big=byteorder == "big").document(
        name or schema_name(Path(os.fspath(path)).stem, "protocol"), structs
    )


class _Header:
    """Makes a document of the declarations of a header."""

    def __init__(
        self, path: Path | str, notes: Notes, comments: Comments, declared: Iterable[Declared], *, big: bool
    ) -> None:
        self._file = Path(os.fspath(path)).name
        self._notes = notes
        self._comments = comments
        self._types = Types()
        self._called: dict[CType, str] = {}
        self._big = big
        for each in declared:
            self._types.add(each)
            self._collect(each.type, each.name)
        self._names = self._schema_names()
        self._outermost = {each.line: each for each in reversed(self._structures())}
        self._layouts = Layouts(self._types, self._names, comments, notes, big=big)

    def _collect(self, type_: CType, called: str, outer: str = "") -> None:
        """Note the names of structures and enums, those inside others included, in order of the text."""
        if isinstance(type_, Structure | Enumeration):
            self._called.setdefault(type_, called or type_.tag)
        if isinstance(type_, Structure):
            outer = _bare(self._called[type_]) or outer
            for member in type_.members:
                tag = member.type.tag if isinstance(member.type, Structure | Enumeration) else ""
                joined = f"{outer}_{member.name}" if outer and member.name else member.name
                self._collect(member.type, tag or joined, outer)

    def _schema_names(self) -> dict[CType, str]:
        names = Names(self._notes, "type", types=True)
        return {
            each: names.take(_bare(called), each.line)
            for each, called in self._called.items()
            if isinstance(each, Structure | Enumeration) and called
        }

    def document(self, name: str, structs: Sequence[str]) -> Document:
        """The document; messages are the structures named, or those that no other one contains."""
        messages = self._messages(structs)
        chosen = [each for each, _ in messages]
        largest = max((laid.size for _, laid in messages), default=0)
        if any(laid.open for _, laid in messages):
            largest = max(largest, 255)
        if not messages:
            raise self._notes.error(0, "the header has no structure that can be a message")
        items = tuple(
            Message(
                self._names[each],
                laid.fields,
                each.line,
                {"id": number, "confirmed": False},
                self._doc(each),
            )
            for number, (each, laid) in enumerate(messages, 1)
        )
        records = tuple(
            Record(self._names[each], laid.fields, each.line, self._doc(each))
            for each, laid in self._records(chosen)
        )
        return Document(
            protocol={"name": name, "revision": "", "source": self._file},
            byteorder="big" if self._big else "little",
            frame=assumed("A header", largest, len(items)),
            bus={"kind": "master_slave"},
            sections={"enums": self._enums(), "types": records, "messages": items},
            comment=f"From {self._file}. Message ids are numbered in order: replace them, then remove "
            "`confirmed: false`.",
        )

    def _doc(self, structure: Structure) -> str:
        """The comment above a structure; of several on one line, that of the outermost."""
        outermost = self._outermost[structure.line] is structure
        return self._comments.above(structure.line) if outermost else ""

    # Structures -----------------------------------------------------------------------------------------

    def _structures(self) -> list[Structure]:
        return [
            each
            for each, called in self._called.items()
            if isinstance(each, Structure) and called and not each.union
        ]

    def _messages(self, structs: Sequence[str]) -> list[tuple[Structure, Laid]]:
        inner = {member for each in self._structures() for member in self._inside(each)}
        wanted = [each for each in self._structures() if self._laid(each) and each not in inner]
        if structs:
            by_name = {
                called: each
                for each in self._structures()
                for called in (self._names[each], self._called[each], each.tag)
            }
            for called in structs:
                if called not in by_name:
                    raise self._notes.error(0, f"structure {called} is not in the header")
            wanted = [by_name[called] for called in dict.fromkeys(structs)]
        found = [(each, laid) for each in wanted if (laid := self._laid(each)) is not None]
        return [(each, laid) for each, laid in found if laid.fields]

    def _laid(self, structure: Structure) -> Laid | None:
        try:
            return self._layouts.of(structure)
        except Refused as error:
            self._notes.add(error.line, f"structure {self._called[structure]} is left out: {error.text}")
            return None

    def _inside(self, structure: Structure) -> list[Structure]:
        """The structures that are the types of members."""
        found = [self._types.resolved(each.type, each.line)[0] for each in structure.members]
        return [each for each in found if isinstance(each, Structure)]

    def _records(self, messages: Iterable[Structure]) -> list[tuple[Structure, Laid]]:
        """The structures inside messages, each after those that it contains."""
        found: dict[Structure, Laid] = {}

        def add(structure: Structure) -> None:
            for member in structure.members:
                inner, _ = self._types.resolved(member.type, member.line)
                if isinstance(inner, Structure):
                    add(inner)
                    if member.name and inner not in found:
                        found[inner] = self._layouts.of(inner)

        for each in messages:
            add(each)
        return list(found.items())

    # Enums ----------------------------------------------------------------------------------------------

    def _enums(self) -> tuple[Constants, ...]:
        used = {
            self._types.resolved(member.type, member.line)[0]
            for each in self._called
            if isinstance(each, Structure)
            for member in each.members
        }
        return tuple(
            self._enum(each, called, used=each in used)
            for each, called in self._called.items()
            if isinstance(each, Enumeration) and called
        )

    def _enum(self, enum: Enumeration, called: str, *, used: bool) -> Constants:
        sign, size = integer_of(enum, used=used)
        if used and not enum.packed:
            self._notes.add(enum.line, f"enum {called} has {size} bytes, as without -fshort-enums")
        names = Names(self._notes, "constant")
        values: list[Constant] = []
        seen: set[int] = set()
        for short, (raw, number, line) in zip(
            without_prefix([raw for raw, _, _ in enum.values]), enum.values, strict=True
        ):
            if number in seen:
                self._notes.add(line, f"constant {raw} is left out: {number} has a name already")
                continue
            seen.add(number)
            values.append(Constant(names.take(short, line), number, self._comments.of(line)))
        doc = self._comments.above(enum.line)
        return Constants(self._names[enum], f"{sign}{8 * size}", tuple(values), enum.line, doc)


def _bare(name: str) -> str:
    """A name without the suffix of a type."""
    suffix = next((each for each in _SUFFIXES if name.endswith(each) and len(name) > len(each)), "")
    return name.removesuffix(suffix)
