"""Payloads: what a described protocol needs beside construct's own classes.

A Message is made of integers, which are construct's own or Groups, dressed in Ranged, Flagged, Boolean and
Scaled; of BitFields, whose fields are Bits; of Items, Octets and Characters, whose number a Count may carry.
Construct's Default, Const and Rebuild say what is sent when nothing is given. All errors are ConstructErrors.
"""

# ruff: noqa: ARG002, SLF001  # construct gives every method the same arguments, and calls its parts by _name

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Mapping, Sequence
from decimal import Context, Decimal
from fractions import Fraction
from typing import Any

from construct import (
    Adapter,
    Const,
    Construct,
    Container,
    Default,
    IntegerError,
    RangeError,
    Rebuild,
    StreamError,
    StringError,
    Struct,
    Terminated,
    ValidationError,
    stream_read,
    stream_read_entire,
    stream_write,
)

_EXACT = Context(prec=100)


class Groups(Construct):
    """An integer sent in groups of bits, one group in the low bits of each byte.

    Each chunk is the (first bit, number of bits) of one byte, in wire order; the byte's other bits are zero.
    """

    def __init__(self, *chunks: tuple[int, int], signed: bool = False) -> None:
        super().__init__()
        self.chunks = chunks
        self.bits = max(shift + bits for shift, bits in chunks)
        self.signed = signed

    def _parse(self, stream: Any, context: Any, path: Any) -> int:
        value = 0
        for byte, (shift, bits) in zip(stream_read(stream, len(self.chunks), path), self.chunks, strict=True):
            if byte >> bits:
                raise ValidationError(f"byte {byte:#04x} has more than {bits} bits set", path=path)
            value |= byte << shift
        return _signed(value, self.bits) if self.signed else value

    def _build(self, obj: Any, stream: Any, context: Any, path: Any) -> Any:
        value = _unsigned(obj, self.bits, self.signed, path)
        data = bytes(value >> shift & (1 << bits) - 1 for shift, bits in self.chunks)
        stream_write(stream, data, len(data), path)
        return obj

    def _sizeof(self, context: Any, path: Any) -> int:
        return len(self.chunks)


class Bits(Construct):
    """Bits first..last of the integer around it; 0 is the least significant one."""

    def __init__(self, first: int, last: int, *, signed: bool = False) -> None:
        super().__init__()
        self.first = first
        self.bits = last + 1 - first
        self.signed = signed

    def _parse(self, stream: Any, context: Any, path: Any) -> int:
        value = context.bits >> self.first & (1 << self.bits) - 1
        return _signed(value, self.bits) if self.signed else int(value)

    def _build(self, obj: Any, stream: Any, context: Any, path: Any) -> Any:
        context.bits |= _unsigned(obj, self.bits, self.signed, path) << self.first
        return obj


class BitFields(Construct):
    """An integer divided into fields; bits of no field are sent as zero and ignored when received."""

    def __init__(self, integer: Any, *fields: Any) -> None:
        super().__init__()
        self.integer = integer
        self.fields = fields

    def _parse(self, stream: Any, context: Any, path: Any) -> Any:
        inner = Container(bits=self.integer._parsereport(stream, context, path))
        return Container({field.name: field._parsereport(stream, inner, path) for field in self.fields})

    def _build(self, obj: Any, stream: Any, context: Any, path: Any) -> Any:
        inner = Container(bits=0)
        for field in self.fields:
            field._build(obj[field.name], stream, inner, path)
        self.integer._build(inner.bits, stream, context, path)
        return obj

    def _sizeof(self, context: Any, path: Any) -> int:
        return int(self.integer.sizeof())


def _signed(value: int, bits: int) -> int:
    return value - (value >> (bits - 1) << bits)


def _unsigned(value: Any, bits: int, signed: bool, path: Any) -> int:
    low = -(1 << bits - 1) if signed else 0
    if not isinstance(value, int) or not low <= value < low + (1 << bits):
        raise IntegerError(f"{value!r} is no integer of {bits} bits", path=path)
    return value & (1 << bits) - 1


class Ranged(Adapter):
    """An integer from minimum to maximum."""

    def __init__(self, subcon: Any, minimum: int, maximum: int) -> None:
        super().__init__(subcon)
        self.minimum = minimum
        self.maximum = maximum

    def _decode(self, obj: Any, context: Any, path: Any) -> Any:
        if not isinstance(obj, int) or not self.minimum <= obj <= self.maximum:
            raise ValidationError(f"{obj!r} is not in {self.minimum}..{self.maximum}", path=path)
        return obj

    _encode = _decode


class Flagged(Adapter):
    """Bits of which only those of the mask may be set."""

    def __init__(self, subcon: Any, mask: int) -> None:
        super().__init__(subcon)
        self.mask = mask

    def _decode(self, obj: Any, context: Any, path: Any) -> Any:
        if not isinstance(obj, int) or obj & ~self.mask:
            raise ValidationError(f"{obj!r} has bits outside of {self.mask:#x}", path=path)
        return obj

    _encode = _decode


class Boolean(Adapter):
    """0 or 1 as False or True."""

    def _decode(self, obj: Any, context: Any, path: Any) -> bool:
        return bool(obj)

    def _encode(self, obj: Any, context: Any, path: Any) -> int:
        return int(obj)


class Scaled(Adapter):
    """A value in a unit: (integer * factor + bias) / divisor.

    It is built to the nearest step, a tie to the even one, exactly. With ``exact`` it is parsed to a Decimal,
    for integers of more bits than a float can carry.
    """

    def __init__(
        self, subcon: Any, *, factor: int = 1, bias: int = 0, divisor: int = 1, exact: bool = False
    ) -> None:
        super().__init__(subcon)
        self.factor = factor
        self.bias = bias
        self.divisor = divisor
        self.exact = exact

    def _decode(self, obj: int, context: Any, path: Any) -> int | float | Decimal:
        value = obj * self.factor + self.bias
        if self.exact:
            return _EXACT.divide(Decimal(value), Decimal(self.divisor))
        return value if self.divisor == 1 else value / self.divisor

    def _encode(self, obj: Any, context: Any, path: Any) -> int:
        try:
            return round((Fraction(obj) * self.divisor - self.bias) / self.factor)
        except (TypeError, ValueError, OverflowError):
            raise ValidationError(f"{obj!r} is not a number", path=path) from None


# Items in a row


class Count(Adapter):
    """How many items the field ``of`` has; ``step`` is the size of an item where bytes are counted."""

    def __init__(self, subcon: Any, of: str, step: int = 1) -> None:
        super().__init__(subcon)
        self.of = of
        self.step = step
        self.flagbuildnone = True

    def _decode(self, obj: int, context: Any, path: Any) -> int:
        items, rest = divmod(obj, self.step)
        if rest:
            raise RangeError(f"{obj} bytes are no whole number of {self.of}", path=path)
        return items

    def _encode(self, obj: Any, context: Any, path: Any) -> int:
        return len(context[self.of]) * self.step


class Items(Construct):
    """A list of minimum to maximum items.

    ``count`` names the field that says how many. A list of no fixed size without it takes the payload's rest,
    all but the ``tail`` bytes of fixed size after it, and the fields after it that ``counted`` tells of: the
    size of an item by the name of each count.
    """

    def __init__(
        self,
        item: Any,
        minimum: int,
        maximum: int,
        *,
        count: str = "",
        tail: int = 0,
        counted: Mapping[str, int] | None = None,
    ) -> None:
        super().__init__()
        self.item = item
        self.minimum = minimum
        self.maximum = maximum
        self.count = count
        self.tail = tail
        self.counted = counted or {}

    def _number(self, stream: Any, context: Any, path: Any) -> int:
        if self.count:
            number = int(context[self.count])
        elif self.minimum == self.maximum:
            number = self.minimum
        else:
            behind = self.tail + sum(context[name] * size for name, size in self.counted.items())
            number = (len(stream.getbuffer()) - stream.tell() - behind) // int(self.item.sizeof())
        return self._checked(number, path)

    def _checked(self, number: int, path: Any) -> int:
        if not self.minimum <= number <= self.maximum:
            raise RangeError(f"{number} items are not {self.minimum}..{self.maximum}", path=path)
        return number

    def _parse(self, stream: Any, context: Any, path: Any) -> Any:
        return [
            self.item._parsereport(stream, context, path) for _ in range(self._number(stream, context, path))
        ]

    def _build(self, obj: Any, stream: Any, context: Any, path: Any) -> Any:
        self._checked(len(obj), path)
        for item in obj:
            self.item._build(item, stream, context, path)
        return obj


class Octets(Items):
    """A byte string of minimum to maximum bytes, otherwise like Items."""

    def __init__(
        self,
        minimum: int,
        maximum: int,
        *,
        count: str = "",
        tail: int = 0,
        counted: Mapping[str, int] | None = None,
    ) -> None:
        super().__init__(_OCTET, minimum, maximum, count=count, tail=tail, counted=counted)

    def _parse(self, stream: Any, context: Any, path: Any) -> Any:
        return stream_read(stream, self._number(stream, context, path), path)

    def _build(self, obj: Any, stream: Any, context: Any, path: Any) -> Any:
        stream_write(stream, obj, self._checked(len(obj), path), path)
        return obj


class Characters(Octets):
    """Text of minimum to maximum 7-bit characters, otherwise like Items."""

    def _parse(self, stream: Any, context: Any, path: Any) -> str:
        data: bytes = super()._parse(stream, context, path)
        if not data.isascii():
            raise StringError(f"{data!r} is not of 7-bit characters", path=path)
        return data.decode("ascii")

    def _build(self, obj: Any, stream: Any, context: Any, path: Any) -> Any:
        if not isinstance(obj, str) or not obj.isascii():
            raise StringError(f"{obj!r} is not text of 7-bit characters", path=path)
        super()._build(obj.encode("ascii"), stream, context, path)
        return obj


_OCTET = Groups((0, 8))
#: What a payload carries beside the values: the codec sends and checks it itself.
_HIDDEN = (Const, Count, Rebuild)


def _inside(field: Any) -> Any:
    """What a default is the default of."""
    return field.subcon.subcon if isinstance(field.subcon, Default) else field.subcon


class Message(Construct):
    """One message: its name, its id on the wire, and the payload, which it takes whole.

    Fields that are not given are sent with their defaults; those inside a BitFields stand beside the others.
    """

    def __init__(
        self,
        name: str,
        message_id: int,
        *fields: Any,
        addresses: Sequence[tuple[int, int]] = (),
        checksum: bool = True,
        empty_is_default: bool = False,
    ) -> None:
        super().__init__()
        self.name = name
        self.id = message_id
        self.fields = fields
        self.addresses = addresses
        self.checksum = checksum
        self.empty_is_default = empty_is_default
        self.struct = Struct(*fields, Terminated)
        self.defaults = {field.name: field.subcon.value for field in self._settable()}
        self._lists = [field.subcon.subcon for field in fields if isinstance(_inside(field), Items)]
        self._fixed_size = sum(field.sizeof() for field in fields if not isinstance(_inside(field), Items))

    def _settable(self) -> Iterable[Any]:
        for field in self.fields:
            if isinstance(field.subcon, BitFields):
                yield from field.subcon.fields
            elif isinstance(field.subcon, Default):
                yield field

    def _parse(self, stream: Any, context: Any, path: Any) -> Any:
        data = stream_read_entire(stream, path)
        if not data and self.empty_is_default:
            return Container(self.defaults)
        self._check_size(len(data), path)
        parsed = self.struct.parse_stream(io.BytesIO(data))
        values = Container()
        for field in self.fields:
            if isinstance(field.subcon, BitFields):
                values.update(parsed[field.name])
            elif not isinstance(field.subcon, _HIDDEN):
                values[field.name] = parsed[field.name]
        self._check_counts(parsed, path)
        return values

    def _check_size(self, size: int, path: Any) -> None:
        """Some numbers of bytes are wrong whatever the bytes are; that shows before any value does."""
        least = self._fixed_size + sum(each.minimum * each.item.sizeof() for each in self._lists)
        most = self._fixed_size + sum(each.maximum * each.item.sizeof() for each in self._lists)
        step = math.gcd(*(each.item.sizeof() for each in self._lists)) or 1
        if size < least:
            raise StreamError(f"{size} bytes, {self.name} has {least} at least", path=path)
        if size > most or (size - least) % step:
            raise RangeError(f"{size} bytes, {self.name} has {least}..{most} in steps of {step}", path=path)

    def _check_counts(self, parsed: Any, path: Any) -> None:
        """A field may have several counts, of which only one was needed to read it."""
        for field in self.fields:
            if isinstance(field.subcon, Count) and parsed[field.name] != len(parsed[field.subcon.of]):
                raise ValidationError(f"{field.name} does not agree with {field.subcon.of}", path=path)

    def _build(self, obj: Any, stream: Any, context: Any, path: Any) -> Any:
        if unknown := sorted(set(obj) - set(self.defaults)):
            raise ValidationError(f"{self.name} has no field {', '.join(map(str, unknown))}", path=path)
        values = {**self.defaults, **obj}
        grouped = {}
        for field in self.fields:
            if isinstance(field.subcon, BitFields):
                grouped[field.name] = {member.name: values[member.name] for member in field.subcon.fields}
            elif field.name in values:
                grouped[field.name] = values[field.name]
        data = self.struct.build(grouped)
        stream_write(stream, data, len(data), path)
        return obj
