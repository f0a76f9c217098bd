"""Payloads: classes that protocols need in addition to those of construct.

A Message consists of integers, from construct or Groups, wrapped in Ranged, Clear, Boolean, Scaled and
OpenFlags; of BitFields, whose fields are Bits; of ArrayField, BytesField and TextField, which a Count may
count. Enum and FlagsEnum of construct name numbers and bits; its Default, Const and Rebuild provide values
that are not given. All errors are ConstructErrors.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from decimal import Context, Decimal
from fractions import Fraction
from io import BytesIO
from typing import Any, BinaryIO, NamedTuple

from construct import (
    Adapter,
    Construct,
    Container,
    Default,
    FlagsEnum,
    IntegerError,
    RangeError,
    Renamed,
    StringError,
    Subconstruct,
    ValidationError,
    stream_read,
    stream_read_entire,
    stream_write,
)

_EXACT = Context(prec=100)

#: Values by name. Any: each field checks its own values.
Values = Mapping[str, Any]
#: A value of several items: a list, bytes or text.
Row = Sequence[object]


class Groups(Construct):
    """An integer sent in groups of bits, one group in the low bits of each byte.

    Each chunk is the (first bit, number of bits) of one byte, in wire order; the byte's other bits are zero.
    """

    def __init__(self, *chunks: tuple[int, int], signed: bool = False) -> None:
        super().__init__()
        self.chunks = chunks
        self.bits = max(shift + bits for shift, bits in chunks)
        self.signed = signed

    def number(self, data: bytes) -> int:
        """The integer of wire bytes; bits outside of the groups are ignored."""
        pairs = zip(data, self.chunks, strict=True)
        value = sum((byte & (1 << bits) - 1) << shift for byte, (shift, bits) in pairs)
        return _signed(value, self.bits) if self.signed else value

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> int:
        data = stream_read(stream, len(self.chunks), path)
        for byte, (_, bits) in zip(data, self.chunks, strict=True):
            if byte >> bits:
                raise ValidationError(
                    f"byte {byte:#04x} has more than {bits} bits set", path=path
                )
        return self.number(data)

    def _build(
        self, obj: object, stream: BinaryIO, context: Container, path: str
    ) -> object:
        value = _unsigned(obj, self.bits, self.signed, path)
        data = bytes(value >> shift & (1 << bits) - 1 for shift, bits in self.chunks)
        stream_write(stream, data, len(data), path)
        return obj

    def _sizeof(self, context: Container, path: str) -> int:
        return len(self.chunks)


class Bits(Construct):
    """Bits first..last of the surrounding integer; 0 is the least significant one."""

    def __init__(self, first: int, last: int, *, signed: bool = False) -> None:
        super().__init__()
        self.first = first
        self.bits = last + 1 - first
        self.signed = signed

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> int:
        value = context.bits >> self.first & (1 << self.bits) - 1
        return int(_signed(value, self.bits) if self.signed else value)

    def _build(
        self, obj: object, stream: BinaryIO, context: Container, path: str
    ) -> object:
        context.bits |= _unsigned(obj, self.bits, self.signed, path) << self.first
        return obj


class BitFields(Construct):
    """An integer divided into fields; other bits are sent as zero and ignored when received."""

    def __init__(self, integer: Construct, *fields: Renamed) -> None:
        super().__init__()
        self.integer = integer
        self.fields = fields

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> Container:
        inner = Container(bits=self.integer._parsereport(stream, context, path))
        found = [
            (field, field._parsereport(stream, inner, path)) for field in self.fields
        ]
        return Container(
            {
                field.name: value
                for field, value in found
                if isinstance(field.subcon, Default)
            }
        )

    def _build(
        self, obj: Values, stream: BinaryIO, context: Container, path: str
    ) -> Values:
        inner = Container(bits=0)
        for field in self.fields:
            field._build(obj.get(field.name), stream, inner, path)
        self.integer._build(inner.bits, stream, context, path)
        return obj

    def _sizeof(self, context: Container, path: str) -> int:
        return int(self.integer.sizeof())


def _signed(value: int, bits: int) -> int:
    return value - (value >> (bits - 1) << bits)


def _unsigned(value: object, bits: int, signed: bool, path: str) -> int:
    low = -(1 << bits - 1) if signed else 0
    if not isinstance(value, int) or not low <= value < low + (1 << bits):
        raise IntegerError(f"{value!r} is not an integer of {bits} bits", path=path)
    return value & (1 << bits) - 1


class Ranged(Adapter):
    """A number from minimum to maximum."""

    def __init__(self, subcon: Construct, minimum: float, maximum: float) -> None:
        super().__init__(subcon)
        self.minimum = minimum
        self.maximum = maximum

    def _decode(self, obj: object, context: Container, path: str) -> float:
        if not isinstance(obj, int | float) or not self.minimum <= obj <= self.maximum:
            raise ValidationError(
                f"{obj!r} is not in {self.minimum}..{self.maximum}", path=path
            )
        return obj

    _encode = _decode


class Clear(Adapter):
    """An integer in which all bits of the mask must be zero."""

    def __init__(self, subcon: Construct, mask: int) -> None:
        super().__init__(subcon)
        self.mask = mask

    def _decode(self, obj: object, context: Container, path: str) -> int:
        if not isinstance(obj, int) or obj & self.mask:
            raise ValidationError(
                f"{obj!r} has illegal bits of {self.mask:#x}", path=path
            )
        return obj

    _encode = _decode


class Boolean(Adapter):
    """0 or 1 as False or True."""

    def _decode(self, obj: int, context: Container, path: str) -> bool:
        return bool(obj)

    def _encode(self, obj: object, context: Container, path: str) -> object:
        return obj


class Member(NamedTuple):
    """A name of an Enum or FlagsEnum that cannot be a keyword argument."""

    name: str
    value: int


def like(named: Construct, subcon: Construct) -> Construct:
    """A copy of an Enum or FlagsEnum with another integer."""
    other = copy.copy(named)
    other.subcon = subcon
    return other


class Flags(Container):
    """Flags by name; `int` gives the whole number, including unnamed bits."""

    def __int__(self) -> int:
        named = sum(bit for name, bit in self["_bits"].items() if self[name])
        return int(self["_rest"] | named)


class OpenFlags(Adapter):
    """A FlagsEnum that preserves unnamed bits: it is parsed to Flags."""

    def __init__(self, named: FlagsEnum) -> None:
        super().__init__(named.subcon)
        self.named = named

    def _decode(self, obj: int, context: Container, path: str) -> Flags:
        bits = self.named.flags
        hidden = {"_flagsenum": True, "_bits": bits, "_rest": obj & ~sum(bits.values())}
        return Flags({name: bool(obj & bit) for name, bit in bits.items()} | hidden)

    def _encode(self, obj: object, context: Container, path: str) -> int:
        rest = obj.get("_rest", 0) if isinstance(obj, Mapping) else 0
        return int(self.named._encode(obj, context, path)) | int(rest)


class Scaled(Adapter):
    """A value in a unit: (integer * factor + bias) / divisor.

    Building rounds exactly to the nearest step, ties to even. With ``exact`` it is parsed to a Decimal, for
    integers of more bits than a float can represent.
    """

    def __init__(
        self,
        subcon: Construct,
        *,
        factor: int = 1,
        bias: int = 0,
        divisor: int = 1,
        exact: bool = False,
    ) -> None:
        super().__init__(subcon)
        self.factor = factor
        self.bias = bias
        self.divisor = divisor
        self.exact = exact

    def _decode(self, obj: int, context: Container, path: str) -> int | float | Decimal:
        value = obj * self.factor + self.bias
        if self.exact:
            return _EXACT.divide(Decimal(value), Decimal(self.divisor))
        return value if self.divisor == 1 else value / self.divisor

    def _encode(self, obj: float | Decimal | str, context: Container, path: str) -> int:
        try:
            return round((Fraction(obj) * self.divisor - self.bias) / self.factor)
        except (TypeError, ValueError, OverflowError):
            raise ValidationError(f"{obj!r} is not a number", path=path) from None


# Arrays, bytes and text


class Count(Subconstruct):
    """The number of items of the field ``of``; ``step`` is the size of an item if bytes are counted.

    In the bytes of a ``packed`` field an item has ``step`` bits. ``more`` bytes are counted beside them.
    """

    def __init__(
        self,
        subcon: Construct,
        of: str,
        step: int = 1,
        *,
        packed: bool = False,
        more: int = 0,
    ) -> None:
        super().__init__(subcon)
        self.of = of
        self.step = step
        self.packed = packed
        self.more = more
        self.flagbuildnone = True

    def number(self, data: bytes) -> int:
        """The integer of wire bytes; unused bits are checked later."""
        return int(
            self.subcon.number(data)
            if isinstance(self.subcon, Groups)
            else self.subcon.parse(data)
        )

    def _build(
        self, obj: object, stream: BinaryIO, context: Container, path: str
    ) -> object:
        number = self.told(len(context[self.of]))
        return self.subcon._build(number, stream, context, path)

    def told(self, items: int) -> int:
        """The number for so many items."""
        number = items * self.step
        return ((number + 7) // 8 if self.packed else number) + self.more


class ArrayField(Construct):
    """A list of minimum to maximum items. It takes all bytes, which the Message limits."""

    def __init__(self, item: Construct, minimum: int, maximum: int) -> None:
        super().__init__()
        self.item = item
        self.size = int(item.sizeof())
        self.minimum = minimum
        self.maximum = maximum

    def extent(self, number: int) -> int:
        """Size of so many items."""
        return number * self.size

    def checked(self, number: int, path: str) -> int:
        """The number of items, checked against the limits."""
        if not self.minimum <= number <= self.maximum:
            raise RangeError(
                f"{number} items, expected {self.minimum}..{self.maximum}", path=path
            )
        return number

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> Row:
        data = stream_read_entire(stream, path)
        return [
            self.item.parse(data[at : at + self.size])
            for at in range(0, len(data), self.size)
        ]

    def _build(self, obj: Row, stream: BinaryIO, context: Container, path: str) -> Row:
        self.checked(len(obj), path)
        for item in obj:
            self.item._build(item, stream, context, path)
        return obj


class BytesField(ArrayField):
    """A byte string of minimum to maximum bytes; takes all bytes, like ArrayField."""

    def __init__(self, minimum: int, maximum: int) -> None:
        super().__init__(Groups((0, 8)), minimum, maximum)

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> bytes | str:
        data: bytes = stream_read_entire(stream, path)
        return data

    def _build(self, obj: Row, stream: BinaryIO, context: Container, path: str) -> Row:
        stream_write(stream, obj, self.checked(len(obj), path), path)
        return obj


class TextField(BytesField):
    """Text of minimum to maximum 7-bit characters; takes all bytes, like ArrayField."""

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> str:
        data: bytes = stream_read_entire(stream, path)
        if not data.isascii():
            raise StringError(f"{data!r} is not 7-bit text", path=path)
        return data.decode("ascii")

    def _build(self, obj: Row, stream: BinaryIO, context: Container, path: str) -> Row:
        if not isinstance(obj, str) or not obj.isascii():
            raise StringError(f"{obj!r} is not 7-bit text", path=path)
        super()._build(obj.encode("ascii"), stream, context, path)
        return obj


def bits_of(field: Renamed, whole: int) -> int:
    """The raw number of bits in an integer."""
    inner = _innermost(field)
    assert isinstance(inner, Bits)
    value = whole >> inner.first & (1 << inner.bits) - 1
    return int(_signed(value, inner.bits)) if inner.signed else value


def _innermost(subcon: Construct) -> Construct:
    """What reads the bytes of a field."""
    while hasattr(subcon, "subcon"):
        subcon = subcon.subcon
    return subcon


def _run(field: Renamed) -> ArrayField | None:
    """The array, bytes or text of a field, None for other fields."""
    inner = field.subcon.subcon if isinstance(field.subcon, Default) else field.subcon
    return inner if isinstance(inner, ArrayField) else None


class Message(Construct):
    """A message: its name, its id on the wire, and the whole payload.

    Missing fields are sent with their defaults. Values inside BitFields are on the same level as other
    values. Sizes are checked before values.
    """

    #: Values of its frame that decide which fields it has, with their raw defaults. A frame passes their raw
    #: numbers to parse and build, as ``decided``.
    decided_by: Mapping[str, int] = {}

    def __init__(
        self,
        name: str,
        message_id: int,
        *fields: Renamed,
        addresses: Sequence[tuple[int, int]] = (),
        checksum: bool = True,
        empty_is_default: bool = False,
        seeds: Sequence[tuple[str, bytes]] = (),
        settled: Sequence[tuple[str, int]] = (),
        text: bytes | None = None,
        folded: bool = False,
    ) -> None:
        super().__init__()
        self.name = name
        self.id = message_id
        #: The id that its payload begins with, None if parts of its frame hold the id.
        self.text = text
        #: Letters of either case are parsed in it.
        self.folded = folded
        #: Values of its frame that are always the same.
        self.settled = dict(settled)
        self.fields = fields
        self.addresses = addresses
        self.checksum = checksum
        self.empty_is_default = empty_is_default
        #: Bytes that check values cover although they are not sent.
        self.seeds = dict(seeds)
        self.defaults = {field.name: field.subcon.value for field in self._settable()}
        self.runs = {field.name: run for field in fields if (run := _run(field))}
        #: Constant numbers of items.
        self.known = {
            name: run.minimum
            for name, run in self.runs.items()
            if run.minimum == run.maximum
            and name not in {each.subcon.of for each in self._counts()}
        }
        self.least = self.size({name: run.minimum for name, run in self.runs.items()})
        self.most = self.size({name: run.maximum for name, run in self.runs.items()})

    def _settable(self) -> Iterator[Renamed]:
        for field in self.fields:
            inside = (
                field.subcon.fields if isinstance(field.subcon, BitFields) else (field,)
            )
            yield from (each for each in inside if isinstance(each.subcon, Default))

    def _counts(self) -> Iterator[Renamed]:
        return (field for field in self.fields if isinstance(field.subcon, Count))

    def fits(self, size: int) -> bool:
        """Whether a payload may have this size, regardless of its counts."""
        return self.least <= size <= self.most or (size == 0 and self.empty_is_default)

    def size(self, counts: Mapping[str, int]) -> int:
        """Size of the payload; runs with an unknown number of items count as empty."""
        return sum(self._size(field, counts) for field in self.fields)

    def _size(self, field: Renamed, counts: Mapping[str, int]) -> int:
        run = self.runs.get(field.name)
        return run.extent(counts.get(field.name, 0)) if run else int(field.sizeof())

    def measured(self, take: Callable[[int], bytes]) -> bytes:
        """Read a payload with ``take``; its size follows from its counts."""
        data, at, counts = b"", 0, dict(self.known)
        for field in self.fields:
            size = self._size(field, counts)
            if isinstance(field.subcon, Count) and field.subcon.of not in counts:
                data += take(at + size - len(data))
                counts[field.subcon.of] = self._learned(field, data[at:], "", counts)
            at += size
        return data + take(at - len(data))

    def _learned(
        self, field: Renamed, data: bytes, path: str, known: Mapping[str, int]
    ) -> int:
        """The number of items from a count; as many as fit packed bytes if it is not known already."""
        cell, of = data[: field.sizeof()], field.subcon.of
        if len(cell) < field.sizeof():
            raise RangeError(f"{field.name} is missing", path=path)
        if field.subcon.packed and of in known:
            number = known[of]
            told = field.subcon.number(cell) == field.subcon.told(number)
            return number if told else -1
        if field.subcon.packed:
            own = field.subcon.number(cell) - field.subcon.more
            number = 8 * own // field.subcon.step
            return self.runs[of].checked(number, path)
        own = field.subcon.number(cell) - field.subcon.more
        number, rest = divmod(own, field.subcon.step)
        if rest:
            raise RangeError(
                f"{field.name} is not a multiple of the item size of {of}", path=path
            )
        return self.runs[of].checked(number, path)

    def _cells(self, data: bytes, path: str) -> list[tuple[Renamed, bytes, int | None]]:
        """The fields with their bytes and numbers of items. Raises RangeError for wrong sizes."""
        if not self.least <= len(data) <= self.most:
            raise RangeError(
                f"{len(data)} bytes, {self.name} has {self.least}..{self.most}",
                path=path,
            )
        cells, at, counts = [], 0, dict(self.known)
        for field in self.fields:
            run = self.runs.get(field.name)
            if isinstance(field.subcon, Count):
                number = self._learned(field, data[at:], path, counts)
                if counts.setdefault(field.subcon.of, number) != number:
                    raise RangeError(
                        f"{field.name} does not agree with {field.subcon.of}", path=path
                    )
            elif run and field.name not in counts:
                number, rest = divmod(len(data) - self.size(counts), run.size)
                if rest:
                    raise RangeError(
                        f"{len(data)} bytes do not divide into items of {field.name}",
                        path=path,
                    )
                counts[field.name] = run.checked(number, path)
            size = self._size(field, counts)
            cells.append((field, data[at : at + size], counts.get(field.name)))
            at += size
        if at != len(data):
            raise RangeError(
                f"{len(data)} bytes, the counts of {self.name} require {at}", path=path
            )
        return cells

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> Container:
        data = stream_read_entire(stream, path)
        if not data and self.empty_is_default:
            data = self.build({})
        values = Container()
        for field, cell, number in self._cells(data, path):
            found = field.parse(cell, number=number)
            if isinstance(field.subcon, BitFields):
                values.update(found)
            elif isinstance(field.subcon, Default):
                values[field.name] = found
        return values

    def _build(
        self, obj: Values, stream: BinaryIO, context: Container, path: str
    ) -> Values:
        values = self._initial(obj, path)
        values.update({name: value for name, value in obj.items() if value is not None})
        for field in self.fields:
            cell = self._written(field, values.get(field.name), values, path)
            stream_write(stream, cell, len(cell), path)
        return obj

    def _initial(self, obj: Values, path: str) -> Container:
        """The values that are sent where none are given; all that are given must have a field."""
        if unknown := sorted(set(obj) - set(self.defaults)):
            raise ValidationError(
                f"{self.name} has no field {', '.join(map(str, unknown))}", path=path
            )
        return Container(self.defaults)

    def _written(
        self, field: Renamed, value: object, values: Container, path: str
    ) -> bytes:
        """The bytes of a field."""
        stream = BytesIO()
        whole = values if isinstance(field.subcon, BitFields) else value
        try:
            field._build(whole, stream, values, path)
        except TypeError as error:
            raise ValidationError(
                f"{self.name} has a value of the wrong type: {error}", path=path
            ) from None
        return stream.getvalue()
