"""A schema to be written: what an importer has found in a file, as typed classes.

Each class has the line of the input that it is from, for messages, and `data`, its mapping in the schema.
Values of a mapping are plain data; `Block` and `Commented` say how a value is laid out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from qlinkgen.importers.notes import Notes

Value: TypeAlias = "bool | int | str | Notation | list[Value] | dict[str, Value] | Commented"


@dataclass(frozen=True, slots=True)
class Notation:
    """Text in a notation of the schema language, such as ``0..26`` or ``0x1F``: written without quotes."""

    text: str


class Block(dict[str, Value]):
    """A mapping with a line for each key, also where one line would hold it."""


@dataclass(frozen=True, slots=True)
class Commented:
    """A value after a comment."""

    comment: str
    value: Value


def hexadecimal(number: int, digits: int = 2) -> Notation:
    """A number in hexadecimal notation."""
    return Notation(f"0x{number:0{digits}X}")


def between(first: object, last: object) -> Notation:
    """A range."""
    return Notation(f"{first}..{last}")


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a message, of a record or of `types`.

    Attributes:
        name: Name in the schema.
        type: Its type; empty if other keys state what it is.
        line: Line of the input.
        keys: Further keys in order.
        doc: Description.
    """

    name: str
    type: str
    line: int = 0
    keys: Mapping[str, Value] = field(default_factory=dict)
    doc: str = ""

    @property
    def data(self) -> Value:
        """The short form where there is nothing but a type."""
        if not self.keys and not self.doc:
            return self.type
        return {**typed(self.type), **self.keys, **documented(self.doc)}


@dataclass(frozen=True, slots=True)
class Constant:
    """A named number of an enum, or bit of flags."""

    name: str
    value: int
    doc: str = ""


@dataclass(frozen=True, slots=True)
class Constants:
    """An enum, or flags.

    Attributes:
        source: Notes on the file that it is from, where that is not the first one.
    """

    name: str
    type: str
    values: tuple[Constant, ...]
    line: int = 0
    doc: str = ""
    key: str = "value"
    source: Notes | None = None

    @property
    def data(self) -> Value:
        """Its mapping."""
        long = any(each.doc for each in self.values)
        values: dict[str, Value] = {each.name: self._value(each) for each in self.values}
        return {"type": self.type, **documented(self.doc), "values": Block(values) if long else values}

    def _value(self, constant: Constant) -> Value:
        return {self.key: constant.value, "doc": constant.doc} if constant.doc else constant.value


@dataclass(frozen=True, slots=True)
class Record:
    """A named type of fields in a row.

    Attributes:
        source: Notes on the file that it is from, where that is not the first one.
    """

    name: str
    fields: tuple[Field, ...]
    line: int = 0
    doc: str = ""
    source: Notes | None = None

    @property
    def data(self) -> Value:
        """Its mapping."""
        return {**documented(self.doc), "fields": layout(self.fields)}


@dataclass(frozen=True, slots=True)
class Message:
    """A message outside transactions.

    Attributes:
        keys: Keys before the fields; the id is one of them.
        source: Notes on the file that it is from, where that is not the first one.
    """

    name: str
    fields: tuple[Field, ...]
    line: int = 0
    keys: Mapping[str, Value] = field(default_factory=dict)
    doc: str = ""
    source: Notes | None = None

    @property
    def data(self) -> Value:
        """Its mapping."""
        return Block({**self.keys, **documented(self.doc), "fields": layout(self.fields)})


@dataclass(frozen=True, slots=True)
class Command:
    """A request and its response.

    Attributes:
        keys: Keys before the fields.
        answer: Keys of the response in its long form, such as an id of its own.
    """

    name: str
    request: tuple[Field, ...]
    response: tuple[Field, ...]
    line: int = 0
    keys: Mapping[str, Value] = field(default_factory=dict)
    doc: str = ""
    answer: Mapping[str, Value] = field(default_factory=dict)

    @property
    def data(self) -> Value:
        """Its mapping."""
        response = layout(self.response)
        if self.answer:
            response = {**self.answer, "fields": response}
        fields: dict[str, Value] = {"request": layout(self.request), "response": response}
        return Block({**self.keys, **documented(self.doc), **fields})


Item: TypeAlias = Constants | Record | Field | Message | Command


@dataclass(frozen=True, slots=True)
class Document:
    """A schema file.

    Attributes:
        protocol: The keys of `protocol`.
        frame: The frame, or `frames` if `frame_key` says so.
        sections: The parts of the file that list things by name: `enums`, `types`, `messages` and so on.
        comment: What a reader should know, at the beginning of the file.
        other_frame: The frame to write if lint refuses the first one.
    """

    protocol: Mapping[str, Value]
    byteorder: str
    frame: Value
    bus: Value
    sections: Mapping[str, tuple[Item, ...]]
    attributes: Mapping[str, Value] = field(default_factory=dict)
    defaults: Mapping[str, Value] = field(default_factory=dict)
    comment: str = ""
    other_frame: Value | None = None

    def without(self, gone: Iterable[tuple[str, str]]) -> Document:
        """A copy without some items, given by section and name."""
        left = set(gone)
        sections = {
            section: tuple(each for each in items if (section, each.name) not in left)
            for section, items in self.sections.items()
        }
        return replace(self, sections=sections)


def typed(name: str) -> dict[str, Value]:
    """The key `type`, without it if the name is empty."""
    return {"type": name} if name else {}


def documented(doc: str) -> dict[str, Value]:
    """The key `doc`, without it if there is nothing to say."""
    return {"doc": doc} if doc else {}


def layout(fields: Iterable[Field]) -> Value:
    """Fields in wire order: on lines of their own if one has a description."""
    listed = tuple(fields)
    data: dict[str, Value] = {each.name: each.data for each in listed}
    return Block(data) if any(each.doc for each in listed) else data
