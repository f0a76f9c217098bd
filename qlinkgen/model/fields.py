"""Fields of messages and of records, and the values that users set and read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from functools import cached_property
from typing import ClassVar, SupportsInt, assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.model.condition import Condition
from qlinkgen.model.greatest import greatest
from qlinkgen.model.texts import Text
from qlinkgen.model.types import Array, BitField, Bits, Blob, Enum, Flags, Length, Scalar


@dataclass(frozen=True)
class Layout:
    """A named sequence of fields, for records of messages."""

    kind: ClassVar = "record"
    name: str
    fields: tuple[Field, ...]
    doc: Text = ""
    section: Text = ""
    confirmed: bool = True

    @cached_property
    def size(self) -> int:
        """Maximum size on the wire."""
        return greatest_size(self.fields)

    @cached_property
    def least(self) -> int:
        """Minimum size on the wire."""
        return sum(each.min_size for each in self.fields)

    @cached_property
    def usual(self) -> int:
        """Size on the wire of a new record."""
        return sum(each.usual_size for each in self.fields)

    @cached_property
    def fixed(self) -> bool:
        """Whether the size is constant."""
        return all(each.fixed for each in self.fields)

    @property
    def open(self) -> bool:
        """Whether a field takes the rest of the bytes."""
        return any(each.open for each in self.fields)

    def takes_rest(self, values: Mapping[str, object]) -> bool:
        """Whether a record with these native or raw values takes all bytes that are left."""
        for each in self.fields:
            inner = values.get(each.slot or each.name)
            if not each.open or not applies(each.when, values.get):
                continue
            if not isinstance(each.type, Record) or not isinstance(inner, Mapping):
                return True
            if each.type.layout.takes_rest(inner):
                return True
        return False

    @cached_property
    def values(self) -> tuple[Value, ...]:
        """Values in wire order."""
        return tuple(values_of(self.fields))

    @property
    def required(self) -> bool:
        """Whether the caller must provide a value of it."""
        return any(value.required for value in self.values)

    @property
    def docs(self) -> dict[str, str]:
        """Descriptions of fields and of the values inside them, by name."""
        return docs_of(self.fields)


@dataclass(frozen=True, slots=True)
class Record:
    """One record: a value with its own values."""

    layout: Layout

    @property
    def required(self) -> bool:
        """Whether the caller must provide it."""
        return self.layout.required


@dataclass(frozen=True, slots=True)
class Records:
    """An array of records."""

    layout: Layout
    length: Length
    #: The caller must provide the value: empty is not legal.
    required: bool = False
    #: The array ends with the first record of which this holds; () for others.
    last: Condition = ()
    #: Suffix for the name of its number of items.
    quantity: str = field(default="count", init=False)

    def size_of(self, number: int) -> int:
        """Maximum size of so many records."""
        return number * self.layout.size

    def items_in(self, size: int) -> int:
        """Maximum number of records that fit a size."""
        return size // self.layout.least


FieldType = Scalar | Bits | Blob | Array | Record | Records


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a message or a record. ``Bits`` hold several named values, all other types one."""

    name: str
    type: FieldType
    doc: Text = ""
    section: Text = ""
    confirmed: bool = True
    #: What it repeats of the request: a value, or a part of its frame; "" for others.
    repeats: str = ""
    #: Parts of the frame of the request that it is a check value of, () for others.
    proves: tuple[str, ...] = ()
    #: It is present only where this holds.
    when: Condition = ()
    #: It may be left out at the end.
    optional: bool = False
    #: A new message has it.
    given: bool = True
    #: The value of which it is a case, and the name of the case; "" for other fields.
    slot: str = ""
    case: str = ""
    #: A count tells the bytes of that value, or of its records of variable size.
    counted: bool = False

    @property
    def open(self) -> bool:
        """Whether it takes the rest of the payload."""
        kind = self.type
        if self.counted or self.terminated:
            return False
        if isinstance(kind, Record):
            return kind.layout.open
        if isinstance(kind, Records) and kind.layout.open:
            return True
        if not isinstance(kind, Blob | Array | Records) or kind.length.fixed or kind.length.counted_by:
            return False
        return not isinstance(kind, Records) or not kind.last

    @property
    def final(self) -> bool:
        """Whether nothing may follow it: a record in it takes all bytes that are left."""
        kind = self.type
        if isinstance(kind, Records):
            numbered = kind.last or kind.length.fixed or kind.length.counted_by
            return self.open and bool(numbered)
        return self.open and isinstance(kind, Record)

    @property
    def conditional(self) -> bool:
        """Whether it may be absent."""
        return self.optional or bool(self.when)

    @property
    def terminated(self) -> bool:
        """Whether a character ends it."""
        return isinstance(self.type, Blob) and bool(self.type.terminator)

    @property
    def omissible(self) -> bool:
        """Whether there may be no text of it after the last separator: it is optional, or a list."""
        return self.optional or (isinstance(self.type, Array) and not self.type.length.minimum)

    @property
    def min_size(self) -> int:
        """Minimum size on the wire, 0 if it may be absent."""
        return 0 if self.conditional else self.full_min_size

    @property
    def full_min_size(self) -> int:
        """Minimum size on the wire where it is present."""
        match self.type:
            case Blob():
                return self.type.size_of(self.type.length.minimum)
            case Array():
                return self.type.least_size
            case Records():
                return self.type.length.minimum * self.type.layout.least
            case Record():
                return self.type.layout.least
            case Scalar():
                return self.type.least_size
            case Bits():
                return self.type.size
            case _:
                assert_never(self.type)

    @property
    def usual_size(self) -> int:
        """Size on the wire in a new message, not between separators."""
        if not self.given:
            return 0
        match self.type:
            case Blob() | Array():
                return self.type.size_of(max(len(self.type.default), self.type.length.minimum))
            case Records():
                return self.type.length.minimum * self.type.layout.usual
            case Record():
                return self.type.layout.usual
            case Scalar() | Bits():
                return self.type.size
            case _:
                assert_never(self.type)

    @property
    def max_size(self) -> int:
        """Maximum size on the wire."""
        match self.type:
            case Blob() | Array() | Records():
                return self.type.size_of(self.type.length.maximum)
            case Record():
                return self.type.layout.size
            case Scalar() | Bits():
                return self.type.size
            case _:
                assert_never(self.type)

    @property
    def item_bits(self) -> int:
        """Bits of an item of a list, bytes or text; 0 for a single value."""
        match self.type:
            case Array():
                return self.type.item.bits if self.type.packed else 8 * self.type.item.size
            case Blob():
                return 8
            case Records():
                return 8 * self.type.layout.size
            case Record() | Scalar() | Bits():
                return 0
            case _:
                assert_never(self.type)

    @property
    def most(self) -> int:
        """Maximum number of items, 1 for a single value."""
        return self.type.length.maximum if isinstance(self.type, Blob | Array | Records) else 1

    @property
    def quantity(self) -> str:
        """Suffix for the name of its number of items, "" for one value."""
        return self.type.quantity if isinstance(self.type, Blob | Array | Records) else ""

    @property
    def fixed(self) -> bool:
        """Whether the size is constant."""
        if self.conditional or self.walked:
            return False
        number = self.type.item if isinstance(self.type, Array) else self.type
        if isinstance(number, Scalar) and number.text is not None and not number.text.fixed:
            return False
        return not isinstance(self.type, Blob | Array | Records) or self.type.length.fixed

    @property
    def walked(self) -> bool:
        """Whether its records have to be read one by one to find its end."""
        kind = self.type
        return isinstance(kind, Record | Records) and (
            not kind.layout.fixed or (isinstance(kind, Records) and bool(kind.last))
        )


@dataclass(frozen=True, slots=True)
class Value:
    """A value that the user sets and reads: an attribute of a message object, a member of a C struct."""

    name: str
    type: Scalar | Blob | Array | Record | Records
    doc: Text
    #: The field that holds it, and its bits if the field is divided into bits.
    field: Field
    bits: BitField | None = None

    @property
    def required(self) -> bool:
        """Whether the caller must provide the value; the default is used only in vectors."""
        return self.type.required and not self.field.conditional

    @property
    def number(self) -> Scalar | None:
        """Its number, or that of each item; None for bytes, text and records."""
        kind = self.type.item if isinstance(self.type, Array) else self.type
        return kind if isinstance(kind, Scalar) else None

    @property
    def unit(self) -> str:
        """The unit of its numbers, "" for bytes, text and records."""
        return self.number.unit if self.number else ""

    @property
    def flags(self) -> Flags | None:
        """The flags that it has, or that each item has; None for other values."""
        meaning = self.number.meaning if self.number else None
        return meaning if isinstance(meaning, Flags) else None

    @property
    def members(self) -> tuple[str, ...]:
        """Names of the values, flags or truths that it or each item can have."""
        meaning = self.number.meaning if self.number else None
        if meaning == "bool":
            return ("true", "false")
        return tuple(each.name for each in meaning.members) if isinstance(meaning, Enum | Flags) else ()

    @property
    def names(self) -> tuple[tuple[str, ...], str]:
        """The names that it may have, and the mark between several of them: "" if it has one."""
        many = isinstance(self.type, Array)
        if self.flags is not None:
            return ((), "") if many else (self.members, "|")
        return self.members, "," if many and self.members else ""


def greatest_size(fields: Iterable[Field]) -> int:
    """The greatest size of fields on the wire, where some of them exclude each other."""
    return greatest((each.when, each.max_size) for each in fields)


def separated_size(fields: Sequence[Field], *, leading: bool) -> tuple[int, int]:
    """The minimum and maximum size of fields with separators between them, or before each of them."""
    without = int(not leading)
    needed = max((index for index, each in enumerate(fields, 1) if not each.omissible), default=0)
    # A list without items has no separator either.
    kept = [each for each in fields[:needed] if each.optional or not each.omissible]
    least = sum(each.min_size for each in kept) + max(0, len(kept) - without)
    return least, sum(each.max_size for each in fields) + len(fields) - without


def values_of(fields: Iterable[Field]) -> Iterator[Value]:
    """Values in wire order; constants, reserved bytes and counts are not values."""
    for each in fields:
        kind = each.type
        match kind:
            case Bits():
                for member in kind.members:
                    yield Value(member.name, member.type, member.doc, each, member)
            case Scalar():
                if kind.settable:
                    yield Value(each.slot or each.name, kind, each.doc, each)
            case Blob() | Array() | Record() | Records():
                yield Value(each.slot or each.name, kind, each.doc, each)
            case _:
                assert_never(kind)


def chosen(values: Iterable[Value], native: Callable[[str], object]) -> tuple[Value, ...]:
    """The values that a message has: of each choice, the case for the tested number.

    Of a choice without a case for it, the first one, which is absent. ``native`` gives native or raw values
    by name.
    """
    found: dict[str, Value] = {}
    for value in values:
        if value.name not in found or applies(value.field.when, native):
            found[value.name] = value
    return tuple(found.values())


def applies(when: Condition, native: Callable[[str], object]) -> bool:
    """Whether a condition holds for native or raw numbers."""
    numbers = [(test, native(test.value)) for test in when]
    return all(isinstance(number, SupportsInt) and test.holds(int(number)) for test, number in numbers)


def docs_of(fields: Iterable[Field]) -> dict[str, str]:
    """Descriptions of fields and of the values inside them, by name."""
    found = {}
    for each in fields:
        found[each.name] = each.doc
        if isinstance(each.type, Bits):
            found |= {member.name: member.doc for member in each.type.members}
    return found


def layouts_of(fields: Iterable[Field]) -> tuple[Layout, ...]:
    """The layouts of records in fields, each before those that contain it."""
    found: dict[str, Layout] = {}
    for each in fields:
        if isinstance(each.type, Record | Records):
            inner = layouts_of(each.type.layout.fields)
            found |= {layout.name: layout for layout in (*inner, each.type.layout)}
    return tuple(found.values())
