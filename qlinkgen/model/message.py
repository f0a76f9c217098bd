"""A message: its fields in wire order, and the limits of its payload."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, assert_never

from qlinkgen.model.texts import Text
from qlinkgen.model.types import Array, BitField, Bits, Blob, FieldType, Scalar

#: "request": master to slave; "response": slave to master; "message": from any node, without a response.
Direction = Literal["request", "response", "message"]


@dataclass(frozen=True, slots=True)
class Field:
    """A field of the payload. ``Bits`` hold several named values, all other types one."""

    name: str
    type: FieldType
    doc: Text = ""
    section: Text = ""
    confirmed: bool = True
    #: It repeats the field of the same name of the request.
    echo: bool = False

    @property
    def min_size(self) -> int:
        """Minimum size on the wire."""
        match self.type:
            case Blob() | Array():
                return self.type.length.minimum * self.type.item_size
            case Scalar() | Bits():
                return self.type.size
            case _:
                assert_never(self.type)

    @property
    def max_size(self) -> int:
        """Maximum size on the wire."""
        match self.type:
            case Blob() | Array():
                return self.type.length.maximum * self.type.item_size
            case Scalar() | Bits():
                return self.type.size
            case _:
                assert_never(self.type)

    @property
    def quantity(self) -> str:
        """Suffix for the name of its number of items, "" for an integer."""
        return self.type.quantity if isinstance(self.type, Blob | Array) else ""

    @property
    def fixed(self) -> bool:
        """Whether the size is constant."""
        return not isinstance(self.type, Blob | Array) or self.type.length.fixed


@dataclass(frozen=True, slots=True)
class Value:
    """A value that the user sets and reads: an attribute of a message object, a member of a C struct."""

    name: str
    type: Scalar | Blob | Array
    doc: Text
    #: The field that holds it, and its bits if the field is divided into bits.
    field: Field
    bits: BitField | None = None

    @property
    def required(self) -> bool:
        """Whether the caller must provide the value; the default is used only in vectors."""
        return self.type.required

    @property
    def unit(self) -> str:
        """The unit of its numbers, "" for bytes and text."""
        kind = self.type.item if isinstance(self.type, Array) else self.type
        return kind.unit if isinstance(kind, Scalar) else ""


@dataclass(frozen=True)
class Message:
    """One message in one direction.

    ``addresses`` are the (first, last) ranges of legal addresses, () if the frame has no address.
    """

    name: str
    command: str
    direction: Direction
    id: int
    fields: tuple[Field, ...]
    doc: Text = ""
    section: Text = ""
    confirmed: bool = True
    #: An empty payload means that every field has its default.
    empty_is_default: bool = False
    #: The frame's checksum is sent with this message.
    checksum: bool = True
    addresses: tuple[tuple[int, int], ...] = ()
    default_address: int = 0

    @cached_property
    def min_size(self) -> int:
        """Minimum size of the payload, without regard to ``empty_is_default``."""
        return sum(field.min_size for field in self.fields)

    @cached_property
    def max_size(self) -> int:
        """Maximum size of the payload."""
        return sum(field.max_size for field in self.fields)

    @property
    def fixed(self) -> bool:
        """Whether the size of the payload is constant."""
        return all(field.fixed for field in self.fields)

    @cached_property
    def variable(self) -> tuple[Field, ...]:
        """Fields of variable size, in wire order."""
        return tuple(field for field in self.fields if not field.fixed)

    @cached_property
    def values(self) -> tuple[Value, ...]:
        """Values in wire order; constants, reserved bytes and counts are not values."""
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
    def echoes(self) -> tuple[str, ...]:
        """Values that repeat the value of the same name in the request."""
        return tuple(value.name for value in self.values if value.field.echo)

    @property
    def docs(self) -> dict[str, str]:
        """Descriptions of fields and of the values inside them, by name."""
        found = {field.name: field.doc for field in self.fields}
        for field in self.fields:
            if isinstance(field.type, Bits):
                found |= {member.name: member.doc for member in field.type.members}
        return found
