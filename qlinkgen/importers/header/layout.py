"""Lays out structures as compilers do, and makes fields of their members and of the padding between them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from math import prod

from qlinkgen.importers.document import Field, Notation, Value
from qlinkgen.importers.header import scalars
from qlinkgen.importers.header.comments import Comments
from qlinkgen.importers.header.nodes import (
    Basic,
    CType,
    Declared,
    Enumeration,
    Member,
    Named,
    Pointer,
    Refused,
    Structure,
)
from qlinkgen.importers.header.scalars import Scalar
from qlinkgen.importers.names import Names, schema_name
from qlinkgen.importers.notes import Notes

#: Greatest size of a message, and number of members: a schema allows 65535 bytes.
_MOST = 65535
_DEEPEST = 20
#: Names of members without a meaning.
_SPARE = re.compile(r"(?:reserved|rsvd|padding|pad|unused|spare|dummy)_?\d*")


@dataclass(frozen=True, slots=True)
class Placed:
    """A type with its place in memory: name in the schema, size, alignment."""

    type: str
    size: int
    alignment: int
    scalar: Scalar | None = None
    open: bool = False


@dataclass(frozen=True, slots=True)
class Laid:
    """A structure with its layout."""

    fields: tuple[Field, ...]
    size: int
    alignment: int
    open: bool


@dataclass
class Types:
    """The types of a header by name."""

    typedefs: dict[str, Declared] = field(default_factory=dict)
    tags: dict[str, Structure | Enumeration] = field(default_factory=dict)

    def add(self, declared: Declared) -> None:
        """Add what a declaration defines."""
        if declared.name:
            self.typedefs[declared.name] = declared
        if isinstance(declared.type, Structure | Enumeration) and declared.type.tag:
            self.tags[declared.type.tag] = declared.type

    def resolved(self, type_: CType, line: int) -> tuple[CType, tuple[int, ...]]:
        """The type that a name has in the end, and the sizes of arrays that typedefs add."""
        counts: tuple[int, ...] = ()
        for _ in range(_DEEPEST):
            if not isinstance(type_, Named):
                return type_, counts
            if type_.tag or type_.name not in self.typedefs:
                return self.tags.get(type_.name, type_) if type_.tag else type_, counts
            declared = self.typedefs[type_.name]
            type_, counts = declared.type, (*counts, *declared.counts)
        raise Refused(line, "typedefs refer to one another without end")


class Layouts:
    """Lays out structures; each one once.

    Args:
        types: The types of the header.
        names: Names in the schema of structures and enums.
        big: The first bit field has the most significant bits.
    """

    def __init__(
        self, types: Types, names: dict[CType, str], comments: Comments, notes: Notes, *, big: bool
    ) -> None:
        self._types = types
        self._names = names
        self.comments = comments
        self.notes = notes
        self.big = big
        self._done: dict[Structure, Laid] = {}
        self._doing: list[Structure] = []

    def of(self, structure: Structure) -> Laid:
        """The layout of a structure. Raises Refused."""
        if structure not in self._done:
            if structure in self._doing or len(self._doing) >= _DEEPEST:
                raise Refused(structure.line, "a structure contains itself")
            self._doing.append(structure)
            try:
                self._done[structure] = _Layout(self, structure).laid()
            finally:
                self._doing.pop()
        return self._done[structure]

    def called(self, structure: Structure) -> str:
        """The name of a structure in the schema, for notes."""
        return self._names.get(structure, "the structure")

    def placed(self, type_: CType, line: int) -> tuple[Placed, tuple[int, ...]]:
        """Size and alignment of a type, and the sizes of arrays that typedefs add. Raises Refused."""
        found, counts = self._types.resolved(type_, line)
        match found:
            case Structure(union=True):
                raise Refused(line, "a union: which of its members is sent is not stated")
            case Structure():
                laid = self.of(found)
                return Placed(self._names.get(found, ""), laid.size, laid.alignment, open=laid.open), counts
            case Enumeration():
                return self._enum(found), counts
            case Pointer():
                raise Refused(line, "a pointer or function: it has no meaning on a line")
            case Basic(words):
                return self._scalar(scalars.basic(found), " ".join(words), line), counts
            case Named(name):
                return self._scalar(scalars.named(found), name, line), counts

    def _enum(self, enum: Enumeration) -> Placed:
        sign, size = integer_of(enum, used=True)
        return Placed(self._names.get(enum, f"{sign}{8 * size}"), size, size)

    def _scalar(self, scalar: Scalar | None, name: str, line: int) -> Placed:
        if scalar is None:
            raise Refused(line, f"the size of {name} is not known; use a type of stdint.h")
        return Placed(scalar.type, scalar.size, scalar.size, scalar)


def integer_of(enum: Enumeration, *, used: bool) -> tuple[str, int]:
    """Sign and bytes of the integer of an enum: an int if it is `used` and not packed, else the smallest."""
    low, high = min(number for _, number, _ in enum.values), max(number for _, number, _ in enum.values)
    sign = "i" if low < 0 else "u"
    for size in (1, 2, 4):
        bits = 8 * size
        fits = -(1 << (bits - 1)) <= low and high < 1 << (bits - 1) if low < 0 else high < 1 << bits
        if fits and (size == 4 or enum.packed or not used):
            return sign, size
    return sign, 8


class _Layout:
    """Lays out one structure."""

    def __init__(self, all_: Layouts, structure: Structure) -> None:
        self._all = all_
        self._structure = structure
        self._names = Names(all_.notes, "member")
        self._fields: list[Field] = []
        self._at = 0
        self._alignment = 1
        self._open = False
        self._paddings = 0
        self._own = {schema_name(each.name) for each in structure.members}

    def laid(self) -> Laid:
        """Place every member. Raises Refused."""
        if not self._structure.members:
            raise Refused(self._structure.line, "it has no members")
        for bits, group in groupby(self._structure.members, key=lambda each: each.bits is not None):
            members = tuple(group)
            if bits:
                self._bit_fields(members, last=members[-1] is self._structure.members[-1])
            else:
                for member in members:
                    self._member(member)
            if self._at > _MOST:
                raise Refused(self._structure.line, f"more than {_MOST} bytes do not fit a frame")
        if not self._open:
            self._pad(-self._at % self._alignment, self._structure.members[-1].line, "after the last member")
        return Laid(tuple(self._fields), self._at, self._alignment, self._open)

    # Members --------------------------------------------------------------------------------------------

    def _member(self, member: Member) -> None:
        if self._open:
            raise Refused(member.line, "a member after an array without size")
        placed, inner = self._all.placed(member.type, member.line)
        counts = (*member.counts, *inner)
        self._align(placed, member.line, member.name)
        if not member.name and isinstance(member.type, Structure):
            self._inline(self._all.of(member.type))
            return
        self._fields.append(self._field(member, placed, counts))
        self._at += placed.size * prod(counts)
        self._open = placed.open or 0 in counts
        if len(counts) > 1:
            text = " by ".join(map(str, counts))
            self._all.notes.add(member.line, f"{member.name}: {text} items are one array, row by row")

    def _inline(self, laid: Laid) -> None:
        """Take over the fields of an unnamed structure."""
        for each in laid.fields:
            name = self._names.take(each.name, each.line)
            self._fields.append(Field(name, each.type, each.line, each.keys, each.doc))
        self._at += laid.size

    def _field(self, member: Member, placed: Placed, counts: tuple[int, ...]) -> Field:
        name = self._names.take(member.name, member.line)
        doc = self._doc(member)
        type_, keys = placed.type, dict[str, Value]()
        size = placed.size * prod(counts)
        if (
            _SPARE.fullmatch(name)
            and 0 < size <= 8
            and placed.scalar
            and placed.scalar.kind in ("number", "byte")
        ):
            type_, keys = f"u{8 * size}", {"reserved": True}
        elif counts:
            items = "" if 0 in counts else str(prod(counts))
            kind = placed.scalar.kind if placed.scalar else "number"
            base = {"character": "text", "byte": "bytes"}.get(kind, type_)
            type_ = f"{base}[{items}]" if items or base == type_ else base
            if kind == "character" and items:
                keys = {"pad": Notation("00")}
        return Field(name, type_, member.line, keys, doc)

    def _doc(self, member: Member) -> str:
        """The comment of a member; one above a structure of one line is that of the structure."""
        return self._all.comments.of(member.line, above=member.line != self._structure.line)

    # Places ---------------------------------------------------------------------------------------------

    def _align(self, placed: Placed, line: int, name: str) -> None:
        alignment = 1 if self._structure.packed else min(placed.alignment, self._structure.pack or 16)
        self._alignment = max(self._alignment, alignment)
        self._pad(-self._at % alignment, line, f"before {name}" if name else "before this member")

    def _pad(self, size: int, line: int, where: str) -> None:
        if size == 0:
            return
        called = self._all.called(self._structure)
        plural = "" if size == 1 else "s"
        self._all.notes.add(line, f"{called}: {size} byte{plural} of padding {where}")
        self._reserve(size, line)

    def _reserve(self, size: int, line: int) -> None:
        self._at += size
        while size > 0:
            part = min(size, 8)
            self._fields.append(Field(self._padding(line), f"u{8 * part}", line, {"reserved": True}))
            size -= part

    def _padding(self, line: int) -> str:
        """The next name for padding that no member has."""
        while True:
            self._paddings += 1
            name = "padding" if self._paddings == 1 else f"padding_{self._paddings}"
            if name not in self._own:
                return self._names.take(name, line)

    # Bit fields -----------------------------------------------------------------------------------------

    def _bit_fields(self, members: Sequence[Member], *, last: bool) -> None:
        """Place bit fields that follow one another, if every compiler does it in the same way."""
        placed = [self._all.placed(each.type, each.line)[0] for each in members]
        size, line = placed[0].size, members[0].line
        if any(each.size != size for each in placed):
            raise Refused(line, "bit fields of several types: compilers place them in different ways")
        if not self._structure.packed and self._at % size:
            raise Refused(line, f"bit fields that do not begin at a multiple of {size} bytes")
        self._align(placed[0], line, members[0].name)
        units = list(_units(members, 8 * size))
        for number, unit in enumerate(units, 1):
            filled = sum(each.bits or 0 for each in unit) == 8 * size
            closed = any(each.bits == 0 for each in unit) or (number == len(units) and last)
            if not filled and size > 1 and not (closed and not self._structure.packed):
                raise Refused(line, f"bit fields that do not fill {8 * size} bits; name the remaining ones")
            self._unit(unit, size)

    def _unit(self, members: Sequence[Member], size: int) -> None:
        bits: dict[str, Value] = {}
        names = Names(self._all.notes, "bit field")
        at = 0
        for member in members:
            width = member.bits or 0
            first = 8 * size - at - width if self._all.big else at
            at += width
            if member.name:
                # Names of all bits of a message are attributes beside its fields.
                name = names.take(self._names.take(member.name, member.line), member.line)
                bits[name] = self._bit(member, first, width)
        line = members[0].line
        if bits:
            name = self._names.take(f"bits_{self._at}", line)
            self._fields.append(Field(name, f"u{8 * size}", line, {"bits": bits}))
            self._at += size
        else:
            self._reserve(size, line)

    def _bit(self, member: Member, first: int, width: int) -> Value:
        doc = self._doc(member)
        placed = self._all.placed(member.type, member.line)[0]
        at: Value = first if width == 1 else Notation(f"{first}..{first + width - 1}")
        signed = placed.scalar is not None and placed.scalar.signed and width > 1
        if not signed and not doc:
            return at
        keys: dict[str, Value] = {"at": at}
        if signed:
            keys["signed"] = True
        return {**keys, "doc": doc} if doc else keys


def _units(members: Sequence[Member], size: int) -> Iterator[list[Member]]:
    """Divide bit fields into the integers that hold them. Raises Refused for one that crosses a border."""
    unit: list[Member] = []
    at = 0
    for member in members:
        width = member.bits or 0
        if width > size or width < 0:
            raise Refused(member.line, f"a bit field of {width} bits in {size} bits")
        if at + width > size:
            if at != size:
                raise Refused(member.line, f"{member.name or 'a bit field'} crosses a border of {size} bits")
            yield unit
            unit, at = [], 0
        unit.append(member)
        at += width
        if member.bits == 0:
            if at:
                yield unit
            unit, at = [], 0
    if unit:
        yield unit
