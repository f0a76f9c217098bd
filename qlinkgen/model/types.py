"""Types of fields: integers with or without a meaning, byte strings, text, arrays.

Every type is immutable and has a size on the wire and a range. Numbers are raw (the integer on the wire)
unless a name contains physical. Chunks, one per wire byte, describe the layout of a scalar, so that byte
orders and groups of seven bits share one mechanism.
"""

from __future__ import annotations

import math
from dataclasses import field
from decimal import Context, Decimal
from fractions import Fraction
from functools import cached_property
from typing import ClassVar, Literal

from qlinkgen._dataclass import dataclass
from qlinkgen.model.checksum import Checksum
from qlinkgen.model.floats import Float
from qlinkgen.model.integer import (
    BitOrder,
    ByteOrder,
    Chunk,
    Integer,
    TextForm,
    byte_chunks,
    group_chunks,
    packed_size,
)
from qlinkgen.model.texts import Text
from qlinkgen.model.words import Words

__all__ = [
    "DOUBLE_BITS",
    "Array",
    "BitField",
    "BitOrder",
    "Bits",
    "Blob",
    "ByteOrder",
    "Characters",
    "Checked",
    "Chunk",
    "Constant",
    "Count",
    "Derived",
    "Enum",
    "Flags",
    "Float",
    "Integer",
    "Length",
    "NamedValue",
    "Number",
    "Reserved",
    "Role",
    "Scalar",
    "Scaling",
    "Settable",
    "byte_chunks",
    "group_chunks",
]

Number = int | float | Decimal

#: Bits of a double's significand: raw values with more bits become a Decimal, which is exact.
DOUBLE_BITS = 53

_EXACT = Context(prec=100)


@dataclass(frozen=True, slots=True)
class NamedValue:
    """A member of an enum, or a bit of flags."""

    name: str
    value: int
    doc: Text = ""


@dataclass(frozen=True, slots=True)
class Enum:
    """Named numbers, or named words. A number without a name is legal."""

    kind: ClassVar = "enum"
    name: str
    bits: int
    members: tuple[NamedValue, ...]
    doc: Text = ""
    section: Text = ""
    #: What is sent in place of the numbers, which are those from 0 then.
    words: Words | None = None

    def name_of(self, value: int) -> str | None:
        """The name of a number, or None."""
        return next((member.name for member in self.members if member.value == value), None)


@dataclass(frozen=True, slots=True)
class Flags:
    """Named bits of an integer; ``NamedValue.value`` is the bit's number. Other bits are reserved."""

    kind: ClassVar = "flags"
    name: str
    bits: int
    members: tuple[NamedValue, ...]
    #: True: a set reserved bit is a range error. False: reserved bits are preserved.
    reserved_zero: bool = False
    doc: Text = ""
    section: Text = ""

    @property
    def mask(self) -> int:
        """All named bits."""
        return sum(1 << member.value for member in self.members)


@dataclass(frozen=True, slots=True)
class Characters:
    """Seven-bit characters, the first of which is the most significant byte of the integer.

    A value of every frame; texts among the fields of a message are a `Blob`.
    """

    number: int
    #: Characters that it does not have: those that end the frame.
    excluded: bytes = b""

    def allows(self, raw: int) -> bool:
        """Whether an integer is a legal text."""
        data = raw.to_bytes(self.number, "big")
        return data.isascii() and not {*data} & {*self.excluded}

    def text(self, raw: int) -> str:
        """The characters of an integer."""
        return raw.to_bytes(self.number, "big").decode("ascii")

    def nearest(self, raw: int) -> int:
        """The integer with other characters in the place of illegal ones."""
        near = next(each for each in b" 0x_~!" + bytes(range(0x80)) if each not in self.excluded)
        data = raw.to_bytes(self.number, "big")
        legal = (each & 0x7F for each in data)
        return int.from_bytes(bytes(near if each in self.excluded else each for each in legal), "big")


@dataclass(frozen=True, slots=True)
class Scaling:
    """physical = raw * scale + offset, exactly."""

    scale: Fraction
    offset: Fraction = Fraction(0)

    @property
    def divisor(self) -> int:
        """The d of physical = (raw * factor + bias) / d, all three integers."""
        common = self.scale.denominator * self.offset.denominator
        return common // _gcd(self.scale.denominator, self.offset.denominator)

    @property
    def factor(self) -> int:
        """The factor of physical = (raw * factor + bias) / divisor."""
        return int(self.scale * self.divisor)

    @property
    def bias(self) -> int:
        """The bias of physical = (raw * factor + bias) / divisor."""
        return int(self.offset * self.divisor)

    def raw(self, physical: Fraction) -> int:
        """The nearest raw step (ties to even); the range is not checked."""
        return round((physical - self.offset) / self.scale)


def _gcd(a: int, b: int) -> int:
    while b:
        a, b = b, a % b
    return a


@dataclass(frozen=True, slots=True)
class Settable:
    """The user sets the value."""

    #: The schema gives no default, and 0 is not legal.
    required: bool = False


@dataclass(frozen=True, slots=True)
class Constant:
    """Sent as the default; receivers reject other values, except those that are ``accepted``."""

    accepted: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Reserved:
    """Sent as the default and ignored when received."""


@dataclass(frozen=True, slots=True)
class Count:
    """The size of a later run: filled and verified by the codec."""

    #: Name of the field of variable size.
    run: str
    #: The unit of the count.
    unit: Literal["items", "bytes"]
    #: Names of fields of constant size whose bytes are counted too.
    beside: tuple[str, ...] = ()
    #: What it counts is its number * ``scale`` + ``offset``.
    scale: int = 1
    offset: int = 0


@dataclass(frozen=True, slots=True)
class Checked:
    """The check value of earlier fields that follow each other: filled and verified by the codec."""

    algorithm: Checksum
    #: Names of the first and the last of them.
    first: str
    last: str


@dataclass(frozen=True, slots=True)
class Derived:
    """An earlier number, inverted or not, plus ``added``: filled and verified by the codec."""

    of: str
    inverted: bool
    added: int


#: How a codec treats an integer.
Role = Settable | Constant | Reserved | Count | Checked | Derived


@dataclass(frozen=True, kw_only=True)
class Scalar:
    """An integer on the wire of any meaning: number, bool, enum, flags, scaled or fixed-point value.

    The integer of a floating-point number is its bits.
    """

    bits: int
    signed: bool = False
    chunks: tuple[Chunk, ...]
    #: Binary-coded decimal.
    bcd: bool = False
    #: Its digits, or the words for it, if it is sent as text.
    text: TextForm | None = None
    minimum: int
    maximum: int
    default: int = 0
    role: Role = Settable()
    scaling: Scaling | None = None
    unit: Text = ""
    meaning: Enum | Flags | Float | Characters | Literal["bool"] | None = None
    #: The named type of the field, "" if its type has no name. Not part of the layout.
    type_name: str = field(default="", compare=False)

    @property
    def size(self) -> int:
        """Bytes on the wire, the maximum of a text."""
        return self.integer.size

    @property
    def least_size(self) -> int:
        """Minimum number of bytes on the wire."""
        return self.text.shortest if self.text else self.size

    @cached_property
    def integer(self) -> Integer:
        """Its wire layout."""
        return Integer(self.bits, self.signed, self.chunks, self.bcd, self.text)

    @property
    def byteorder(self) -> ByteOrder | None:
        """Byte order of an integer of whole bytes; None if it is sent in smaller groups."""
        return self.integer.byteorder

    @property
    def natural_minimum(self) -> int:
        """Minimum value that the bits can hold."""
        return self.integer.minimum

    @property
    def natural_maximum(self) -> int:
        """Maximum value that the bits can hold."""
        return self.integer.maximum

    @property
    def full_range(self) -> bool:
        """Whether every bit pattern is a legal value."""
        return (self.minimum, self.maximum) == (self.natural_minimum, self.natural_maximum)

    @property
    def settable(self) -> bool:
        """Whether the user sets the value, not the codec."""
        return isinstance(self.role, Settable)

    @property
    def required(self) -> bool:
        """Whether the caller must provide the value: it has no default, and 0 is not legal."""
        return self.role == Settable(required=True)

    @property
    def number(self) -> Literal["int", "float", "decimal"]:
        """Python type that holds every physical value without loss."""
        if isinstance(self.meaning, Float):
            return "float"
        if self.scaling is None or self.scaling.divisor == 1:
            return "int"
        return "float" if self.bits <= DOUBLE_BITS else "decimal"

    @property
    def span(self) -> tuple[Number, Number]:
        """Minimum and maximum value in the field's unit."""
        if isinstance(self.meaning, Float):
            return self.meaning.bounds or (-math.inf, math.inf)
        low, high = sorted((self.physical(self.minimum), self.physical(self.maximum)))
        return low, high

    def physical(self, raw: int) -> Number:
        """The value of a raw integer in the field's unit, of the type :attr:`number`."""
        if isinstance(self.meaning, Float):
            return self.meaning.value(raw)
        if self.scaling is None:
            return raw
        value = raw * self.scaling.factor + self.scaling.bias
        if self.number == "int":
            return value
        if self.number == "float":
            return value / self.scaling.divisor
        return _EXACT.divide(Decimal(value), Decimal(self.scaling.divisor))


@dataclass(frozen=True, slots=True)
class BitField:
    """Named consecutive bits of an integer: a value of the message."""

    name: str
    shift: int
    type: Scalar
    doc: Text = ""

    @property
    def mask(self) -> int:
        """Mask of its bits, in place."""
        return ((1 << self.type.bits) - 1) << self.shift


@dataclass(frozen=True, slots=True)
class Bits:
    """An integer divided into bit fields; other bits are reserved: sent as 0, ignored when received."""

    container: Scalar
    members: tuple[BitField, ...]

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        return self.container.size


@dataclass(frozen=True, slots=True)
class Length:
    """The number of items (array) or bytes (byte string, text).

    It is fixed if minimum == maximum. ``counted_by`` names an earlier field that holds the number; otherwise
    the field takes the rest of the payload.
    """

    minimum: int
    maximum: int
    counted_by: str = ""

    @property
    def fixed(self) -> bool:
        """Whether the number is constant."""
        return self.minimum == self.maximum and not self.counted_by


@dataclass(frozen=True, slots=True)
class Blob:
    """A byte string, or text of 7-bit characters (control characters included)."""

    text: bool
    length: Length
    default: bytes = b""
    #: The byte that fills it up to its constant size; not part of the value. b"": it is not filled up.
    pad: bytes = b""
    #: Characters that a text between separators, or before a terminator or the end of a frame, does not have.
    excluded: bytes = b""
    #: The character that follows it; not part of the value. b"": its size is told otherwise.
    terminator: bytes = b""
    #: The caller must provide the value: it has no default, and empty is not legal.
    required: bool = False

    #: Suffix for the name of its number of items.
    quantity: str = field(default="size", init=False)

    def size_of(self, number: int) -> int:
        """Size of so many bytes."""
        return number + len(self.terminator)

    def items_in(self, size: int) -> int:
        """Number of bytes that fit a size."""
        return size - len(self.terminator)


@dataclass(frozen=True, slots=True)
class Array:
    """An array of numbers, of whole bytes each or, if it is ``packed``, of a few bits in a row."""

    item: Scalar
    length: Length
    default: tuple[int, ...] = ()
    packed: BitOrder | None = None
    #: The caller must provide the value: it has no default, and empty is not legal.
    required: bool = False
    #: Only the request tells the number of items; without it there are as many as fit the bytes.
    whole: bool = False
    #: The byte between items, which are texts; b"" if there is none.
    between: bytes = b""
    #: Suffix for the name of its number of items.
    quantity: str = field(default="count", init=False)

    def size_of(self, number: int) -> int:
        """Maximum size of so many items."""
        if self.packed:
            return packed_size(number, self.item.bits)
        return number * self.item.size + max(0, number - 1) * len(self.between)

    @property
    def least_size(self) -> int:
        """Minimum size of all items."""
        if not self.between:
            return self.size_of(self.length.minimum)
        return self.length.minimum * self.item.least_size + max(0, self.length.minimum - 1)

    def items_in(self, size: int) -> int:
        """Maximum number of items that fit a size."""
        return 8 * size // self.item.bits if self.packed else size // self.item.size
