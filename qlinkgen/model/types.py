"""What a field may hold: integers, with or without a meaning, byte strings, text, arrays.

Every type is immutable and knows its size on the wire and its range. Numbers are raw (the integer on the
wire) unless a name says physical. A scalar's bytes are described by chunks, one per wire byte, so that both
byte orders and groups of seven bits are one mechanism.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from decimal import Context, Decimal
from fractions import Fraction
from functools import cached_property
from typing import Literal

from qlinkgen.model.integer import ByteOrder, Chunk, Integer, byte_chunks, group_chunks
from qlinkgen.model.texts import Text

__all__ = [
    "DOUBLE_BITS",
    "Array",
    "BitField",
    "Bits",
    "Blob",
    "ByteOrder",
    "Chunk",
    "Constant",
    "Count",
    "Enum",
    "FieldType",
    "Flags",
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

#: Bits of a double's significand: a raw value with more of them is carried as a Decimal so that nothing is
#: lost.
DOUBLE_BITS = 53

_EXACT = Context(prec=100)


@dataclass(frozen=True, slots=True)
class NamedValue:
    """One name of an enum, or one bit of a set of flags."""

    name: str
    value: int
    doc: Text = ""


@dataclass(frozen=True, slots=True)
class Enum:
    """Named numbers. A number without a name is kept as it is."""

    name: str
    bits: int
    members: tuple[NamedValue, ...]
    doc: Text = ""
    section: Text = ""

    def name_of(self, value: int) -> str | None:
        """The name of a number, or None."""
        return next((member.name for member in self.members if member.value == value), None)


@dataclass(frozen=True, slots=True)
class Flags:
    """Named bits of an integer; ``NamedValue.value`` is the bit's number. Other bits are reserved."""

    name: str
    bits: int
    members: tuple[NamedValue, ...]
    #: True: a reserved bit that is set is a range error. False: reserved bits are kept as they are.
    reserved_zero: bool = False
    doc: Text = ""
    section: Text = ""

    @property
    def mask(self) -> int:
        """All named bits."""
        return sum(1 << member.value for member in self.members)


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

    def physical(self, raw: int) -> Fraction:
        """The exact value in the field's unit."""
        return raw * self.scale + self.offset

    def raw(self, physical: Fraction) -> int:
        """The nearest raw step (a tie goes to the even step); not range-checked."""
        return round((physical - self.offset) / self.scale)


def _gcd(a: int, b: int) -> int:
    while b:
        a, b = b, a % b
    return a


@dataclass(frozen=True, slots=True)
class Settable:
    """The caller chooses the value."""

    #: No default is written, and 0 is not legal.
    required: bool = False


@dataclass(frozen=True, slots=True)
class Constant:
    """Always sent as the default, and must be received as it."""


@dataclass(frozen=True, slots=True)
class Reserved:
    """Sent as the default, and ignored when received."""


@dataclass(frozen=True, slots=True)
class Count:
    """The size of a run that follows: filled and verified by the codec."""

    #: Name of the field of variable size.
    run: str
    #: What is counted of it.
    unit: Literal["items", "bytes"]


#: What a codec does with an integer.
Role = Settable | Constant | Reserved | Count


@dataclass(frozen=True, kw_only=True)
class Scalar:
    """An integer on the wire, whatever it means: number, bool, enum, flags, scaled or fixed-point value."""

    bits: int
    signed: bool = False
    chunks: tuple[Chunk, ...]
    minimum: int
    maximum: int
    default: int = 0
    role: Role = Settable()
    scaling: Scaling | None = None
    unit: Text = ""
    meaning: Enum | Flags | Literal["bool"] | None = None
    #: The named type that the field has, "" where its type has no name. Equal layouts may differ in it.
    type_name: str = field(default="", compare=False)

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        return len(self.chunks)

    @cached_property
    def integer(self) -> Integer:
        """How it lies in bytes."""
        return Integer(self.bits, self.signed, self.chunks)

    @property
    def byteorder(self) -> ByteOrder | None:
        """Byte order of a plain integer of whole bytes; None where groups of fewer bits are used."""
        return self.integer.byteorder

    @property
    def natural_minimum(self) -> int:
        """Least value that the bits can hold."""
        return self.integer.minimum

    @property
    def natural_maximum(self) -> int:
        """Greatest value that the bits can hold."""
        return self.integer.maximum

    @property
    def full_range(self) -> bool:
        """Every bit pattern is a legal value."""
        return (self.minimum, self.maximum) == (self.natural_minimum, self.natural_maximum)

    @property
    def settable(self) -> bool:
        """The caller chooses the value; the codec fills the others."""
        return isinstance(self.role, Settable)

    @property
    def required(self) -> bool:
        """The caller has to choose: no default is written, and 0 is not legal."""
        return self.role == Settable(required=True)

    @property
    def number(self) -> Literal["int", "float", "decimal"]:
        """Python type that holds every physical value without loss."""
        if self.scaling is None or self.scaling.divisor == 1:
            return "int"
        return "float" if self.bits <= DOUBLE_BITS else "decimal"

    def physical(self, raw: int) -> Number:
        """Raw integer to the value in the field's unit, as :attr:`number` says."""
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
    """A named run of bits inside an integer: a field of the message in its own right."""

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
    """An integer divided into bit fields; bits of no field are reserved: sent as 0, ignored when received."""

    container: Scalar
    members: tuple[BitField, ...]

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        return self.container.size


@dataclass(frozen=True, slots=True)
class Length:
    """How many items (array) or bytes (byte string, text) there are.

    minimum == maximum: fixed. ``counted_by`` names the field in front that carries the number; with neither,
    the rest of the payload is taken.
    """

    minimum: int
    maximum: int
    counted_by: str = ""

    @property
    def fixed(self) -> bool:
        """The number is always the same."""
        return self.minimum == self.maximum and not self.counted_by


@dataclass(frozen=True, slots=True)
class Blob:
    """A byte string, or text of 7-bit characters (control characters included)."""

    text: bool
    length: Length
    default: bytes = b""
    #: The caller has to choose: none is written, and empty is not legal.
    required: bool = False

    #: Bytes of one item.
    item_size: int = field(default=1, init=False)
    #: What the number of its items is called.
    quantity: str = field(default="size", init=False)


@dataclass(frozen=True, slots=True)
class Array:
    """Integers in a row."""

    item: Scalar
    length: Length
    default: tuple[int, ...] = ()
    #: The caller has to choose: none is written, and empty is not legal.
    required: bool = False
    #: What the number of its items is called.
    quantity: str = field(default="count", init=False)

    @property
    def item_size(self) -> int:
        """Bytes of one item."""
        return self.item.size


FieldType = Scalar | Bits | Blob | Array
