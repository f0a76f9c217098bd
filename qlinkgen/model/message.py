"""A message: its fields in wire order, and what can be known about its payload before any byte is seen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, assert_never

from qlinkgen.model.texts import Text
from qlinkgen.model.types import Array, BitField, Bits, Blob, FieldType, Scalar

#: "request": master to slave; "response": slave to master; "message": sent by anybody, answered by nobody.
Direction = Literal["request", "response", "message"]


@dataclass(frozen=True, slots=True)
class Field:
    """A run of payload bytes. ``Bits`` hold several named values, every other type one."""

    name: str
    type: FieldType
    doc: Text = ""
    section: Text = ""
    confirmed: bool = True
    #: It repeats the field of the same name of the request.
    echo: bool = False

    @property
    def min_size(self) -> int:
        """Fewest bytes on the wire."""
        match self.type:
            case Blob() | Array():
                return self.type.length.minimum * self.type.item_size
            case Scalar() | Bits():
                return self.type.size
            case _:
                assert_never(self.type)

    @property
    def max_size(self) -> int:
        """Most bytes on the wire."""
        match self.type:
            case Blob() | Array():
                return self.type.length.maximum * self.type.item_size
            case Scalar() | Bits():
                return self.type.size
            case _:
                assert_never(self.type)

    @property
    def quantity(self) -> str:
        """What the number of its items is called, "" where it is an integer."""
        return self.type.quantity if isinstance(self.type, Blob | Array) else ""

    @property
    def fixed(self) -> bool:
        """The size is always the same."""
        return not isinstance(self.type, Blob | Array) or self.type.length.fixed


@dataclass(frozen=True, slots=True)
class Value:
    """Something that a caller sets and reads: an attribute of the message object, a C struct member."""

    name: str
    type: Scalar | Blob | Array
    doc: Text
    #: The field that carries it, and its place inside where that is an integer of several values.
    field: Field
    bits: BitField | None = None

    @property
    def required(self) -> bool:
        """The caller has to choose the value; its default is for vectors alone."""
        return self.type.required

    @property
    def unit(self) -> str:
        """The unit of its numbers, "" for bytes and text."""
        kind = self.type.item if isinstance(self.type, Array) else self.type
        return kind.unit if isinstance(kind, Scalar) else ""


@dataclass(frozen=True)
class Message:
    """One message in one direction.

    ``addresses`` are the (first, last) ranges of the address field that this message may carry, () where the
    frame has no address.
    """

    name: str
    command: str
    direction: Direction
    id: int
    fields: tuple[Field, ...]
    doc: Text = ""
    section: Text = ""
    confirmed: bool = True
    #: A payload of no bytes at all is taken as the message with every field at its default.
    empty_is_default: bool = False
    #: The frame's checksum is sent with this message.
    checksum: bool = True
    addresses: tuple[tuple[int, int], ...] = ()
    default_address: int = 0

    @cached_property
    def min_size(self) -> int:
        """Fewest payload bytes (``empty_is_default`` not considered)."""
        return sum(field.min_size for field in self.fields)

    @cached_property
    def max_size(self) -> int:
        """Most payload bytes."""
        return sum(field.max_size for field in self.fields)

    @property
    def fixed(self) -> bool:
        """The payload has always the same size."""
        return all(field.fixed for field in self.fields)

    @cached_property
    def variable(self) -> tuple[Field, ...]:
        """Fields of variable size, in wire order."""
        return tuple(field for field in self.fields if not field.fixed)

    @cached_property
    def values(self) -> tuple[Value, ...]:
        """What a caller sets and reads, in wire order, without constants, reserved bytes and counts."""
        return tuple(self._values())

    def _values(self) -> Iterator[Value]:
        for field in self.fields:
            kind = field.type
            match kind:
                case Bits():
                    for member in kind.members:
                        yield Value(member.name, member.type, member.doc, field, member)
                case Scalar():
                    if kind.settable:
                        yield Value(field.name, kind, field.doc, field)
                case Blob() | Array():
                    yield Value(field.name, kind, field.doc, field)
                case _:
                    assert_never(kind)

    @property
    def docs(self) -> dict[str, str]:
        """What the document says of fields, and of the values inside them."""
        found = {field.name: field.doc for field in self.fields}
        for field in self.fields:
            if isinstance(field.type, Bits):
                found |= {member.name: member.doc for member in field.type.members}
        return found

    def offset(self, name: str) -> int | None:
        """Bytes of payload before a field, None where a field of variable size stands before it."""
        position = 0
        for field in self.fields:
            if field.name == name:
                return position
            if not field.fixed:
                return None
            position += field.max_size
        raise KeyError(name)
