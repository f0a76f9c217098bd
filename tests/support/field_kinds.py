"""Every kind of field with a reference encoder, and schemas of messages that combine them.

The reference shares no code with qlinkgen: a kind has its schema notation, and draws values with their bytes.
`schema` writes a YAML file of many messages, `draw` returns values and payload of a message.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from typing import Literal, Protocol

Native = int | bool | float | Decimal | bytes | str | list[int]
#: The values to draw: minimum, maximum, or any.
Edge = Literal["least", "most", "any"]
Order = Literal["big", "little"]
#: Name and definition of a field.
Spec = tuple[str, str]


@dataclass(frozen=True)
class Drawn:
    """Values of the fields of a kind by name, the bytes of its counts, and those of the rest."""

    values: Mapping[str, Native]
    counts: bytes
    data: bytes


class Kind(Protocol):
    """A kind of field."""

    @property
    def name(self) -> str:
        """The name, for test reports."""

    def counts(self, field: str) -> list[Spec]:
        """The counts of the field."""

    def fields(self, field: str) -> list[Spec]:
        """The other fields."""

    def draw(self, field: str, rng: random.Random, edge: Edge) -> Drawn:
        """Legal values and their bytes."""


# Integers


@dataclass(frozen=True)
class Item:
    """An integer on the wire.

    Attributes:
        type: its type in the schema.
        keys: other keys of its layout.
        low: minimum value.
        high: maximum value.
        size: bytes on the wire.
        put: encodes a value.
    """

    type: str
    keys: str
    low: int
    high: int
    size: int
    put: Callable[[int], bytes]

    @property
    def name(self) -> str:
        """The type, with keys of its layout."""
        return self.type + {"byteorder: little": "le", "byteorder: big": "", "": ""}.get(self.keys, "g")

    def draw(self, rng: random.Random, edge: Edge) -> int:
        """A legal value."""
        # Arrays have up to 250 items, so unused values are not drawn.
        choice = {"least": 0, "most": 1, "any": int(3 * rng.random())}[edge]
        return (self.low, self.high)[choice] if choice < 2 else rng.randint(self.low, self.high)


def plain(type_: str, order: Order = "big") -> Item:
    """An integer of whole bytes, like u24."""
    signed, bits = type_[0] == "i", int(type_[1:])
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    keys = f"byteorder: {order}" if bits > 8 else ""
    return Item(type_, keys, low, high, bits // 8, lambda raw: raw.to_bytes(bits // 8, order, signed=signed))


def grouped(type_: str, width: int, first: Literal["least", "most"]) -> Item:
    """An integer in groups of fewer than eight bits."""
    bits = int(type_[1:])
    whole = plain(f"{type_[0]}{-(-bits // 8) * 8}")
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if type_[0] == "i" else (0, (1 << bits) - 1)
    size = -(-bits // width)

    def put(raw: int) -> bytes:
        left = int.from_bytes(whole.put(raw)) & (1 << bits) - 1
        groups = [left >> width * index & (1 << width) - 1 for index in range(size)]
        return bytes(groups if first == "least" else groups[::-1])

    return Item(type_, f"groups: {{bits: {width}, first: {first}}}", low, high, size, put)


def _spec(*parts: str) -> str:
    return f"{{{', '.join(part for part in parts if part)}}}"


@dataclass(frozen=True)
class Number:
    """A field of one integer; `value` converts it to its meaning."""

    name: str
    item: Item
    keys: str = ""
    type: str = ""
    legal: tuple[int, ...] = ()
    value: Callable[[int], Native] = lambda raw: raw

    def counts(self, field: str) -> list[Spec]:
        """None."""
        return []

    def fields(self, field: str) -> list[Spec]:
        """The field."""
        return [(field, _spec(f"type: {self.type or self.item.type}", self.item.keys, self.keys))]

    def draw(self, field: str, rng: random.Random, edge: Edge) -> Drawn:
        """A legal value."""
        raw = self.item.draw(rng, edge)
        if self.legal:
            raw = {"least": self.legal[0], "most": self.legal[-1], "any": rng.choice(self.legal)}[edge]
        return Drawn({field: self.value(raw)}, b"", self.item.put(raw))


def scaled(scale: Fraction, offset: int = 0) -> Callable[[int], Native]:
    """Value of a scaled integer that a float can represent."""
    return lambda raw: float(raw * scale + offset)


def wide(scale: Fraction) -> Callable[[int], Native]:
    """Value of a scaled integer that a float cannot represent; the scale is a power of two."""
    digits = scale.denominator.bit_length() - 1
    return lambda raw: Decimal(raw * scale.numerator * 5**digits).scaleb(-digits, Context(prec=100))


@dataclass(frozen=True)
class Fixed:
    """Constant bytes."""

    name: str
    type: str
    keys: str
    data: bytes

    def counts(self, field: str) -> list[Spec]:
        """None."""
        return []

    def fields(self, field: str) -> list[Spec]:
        """The field."""
        return [(field, _spec(f"type: {self.type}", self.keys))]

    def draw(self, field: str, rng: random.Random, edge: Edge) -> Drawn:  # nothing to choose
        """No value, constant bytes."""
        return Drawn({}, b"", self.data)


@dataclass(frozen=True)
class BitFields:
    """An integer of bit fields: lowest bit, width and sign of each, by name."""

    name: str
    item: Item
    members: Mapping[str, tuple[int, int, bool]]

    def counts(self, field: str) -> list[Spec]:
        """None."""
        return []

    def fields(self, field: str) -> list[Spec]:
        """The integer with its bits."""
        bits = ", ".join(
            f"{field}_{letter}: {{at: {at}..{at + width - 1}, signed: {str(signed).lower()}}}"
            for letter, (at, width, signed) in self.members.items()
        )
        return [(field, _spec(f"type: {self.item.type}", self.item.keys, f"bits: {{{bits}}}"))]

    def draw(self, field: str, rng: random.Random, edge: Edge) -> Drawn:
        """A legal value for each bit field."""
        values: dict[str, Native] = {}
        whole = 0
        for letter, (at, width, signed) in self.members.items():
            low, high = (-(1 << width - 1), (1 << width - 1) - 1) if signed else (0, (1 << width) - 1)
            raw = {"least": low, "most": high, "any": rng.randint(low, high)}[edge]
            # A single unsigned bit is a truth value.
            values[f"{field}_{letter}"] = bool(raw) if width == 1 and not signed else raw
            whole |= (raw & (1 << width) - 1) << at
        if whole > self.item.high:
            whole -= 1 << 8 * self.item.size
        return Drawn(values, b"", self.item.put(whole))


# Arrays, bytes and text


@dataclass(frozen=True)
class Row:
    """An array, bytes or text; its counts have different integers.

    Attributes:
        least: minimum number of items.
        most: maximum number of items.
        item: the items, "bytes" or "text".
        counters: integer and unit of each count. Without counts, the field takes the rest of the payload.
    """

    name: str
    item: Item | Literal["bytes", "text"]
    least: int
    most: int
    counters: tuple[tuple[Item, Literal["items", "bytes"]], ...] = ()

    @property
    def open(self) -> bool:
        """Whether it takes the rest of the payload."""
        return self.least != self.most and not self.counters

    @property
    def counted(self) -> bool:
        """Whether an earlier field counts it."""
        return bool(self.counters)

    @property
    def _size(self) -> int:
        return self.item.size if isinstance(self.item, Item) else 1

    def counts(self, field: str) -> list[Spec]:
        """Its counts."""
        return [
            (
                f"{field}_n{index}",
                _spec(f"type: {item.type}", item.keys, f"counts: {field}, counts_in: {unit}"),
            )
            for index, (item, unit) in enumerate(self.counters)
        ]

    def fields(self, field: str) -> list[Spec]:
        """The field itself."""
        base = self.item.type if isinstance(self.item, Item) else self.item
        span = f"{self.least}..{self.most}" if self.least != self.most else f"{self.least}"
        keys = self.item.keys if isinstance(self.item, Item) else ""
        return [(field, _spec(f'type: "{base}[{span}]"', keys))]

    def draw(self, field: str, rng: random.Random, edge: Edge) -> Drawn:
        """A legal number of items."""
        middle = rng.choice((rng.randint(self.least, self.most), min(self.most, self.least + 1)))
        number = {"least": self.least, "most": self.most, "any": middle}[edge]
        value: Native
        if isinstance(self.item, Item):
            value = [self.item.draw(rng, "any") for _ in range(number)]
            data = b"".join(map(self.item.put, value))
        else:
            data = rng.randbytes(number)
            if self.item == "text":
                data = bytes(byte & 0x7F for byte in data)
            value = data.decode("ascii") if self.item == "text" else data
        counts = [item.put(number * (self._size if unit == "bytes" else 1)) for item, unit in self.counters]
        return Drawn({field: value}, b"".join(counts), data)


# The kinds

U8, I8, U16, I16, U32, U64 = (plain(each) for each in ("u8", "i8", "u16", "i16", "u32", "u64"))
U16_LE, I16_LE, U32_LE, I32_LE = (plain(each, "little") for each in ("u16", "i16", "u32", "i32"))
U24, U40, I40, U56 = (plain(each) for each in ("u24", "u40", "i40", "u56"))
U24_LE, I24_LE, U40_LE, I48_LE, U64_LE, I64_LE = (
    plain(each, "little") for each in ("u24", "i24", "u40", "i48", "u64", "i64")
)
G14, G11, G64 = grouped("u14", 7, "least"), grouped("i11", 7, "most"), grouped("u64", 7, "most")
G6 = grouped("u6", 7, "least")

INTEGERS: tuple[Kind, ...] = tuple(
    Number(item.name, item)
    for item in (
        *(U8, I8, U16, I16_LE, U32_LE, U64, I64_LE),
        *(U24, I24_LE, U40_LE, I40, U56, I48_LE),
        *(G14, G11, G64),
    )
)
MEANINGS: tuple[Kind, ...] = (
    Number("bool", U8, type="bool", legal=(0, 1), value=bool),
    Number("enum", U8, type="colour"),
    Number("wide enum", I24_LE, type="depth"),
    Number("strict flags", U8, type="strict", legal=(0, 1, 8, 0x80, 0x89)),
    Number("loose flags", U24_LE, type="loose"),
    Number("ranged u8", U8, "range: 10..20", legal=(10, 13, 20)),
    Number("ranged i40", I40, "range: -5..5", legal=(-5, 0, 5)),
    Number("ranged u14g", G14, "range: 128..9000", legal=(128, 8191, 9000)),
    Number("scaled u8", U8, "scale: 1/2, offset: -40", value=scaled(Fraction(1, 2), -40)),
    Number("scaled u16", U16_LE, "scale: 5, offset: 100", value=lambda raw: raw * 5 + 100),
    Number(
        "scaled i24",
        I24_LE,
        "scale: -1/4, range: -100..200",
        legal=(-800, 7, 400),
        value=scaled(Fraction(-1, 4)),
    ),
    Number("scaled g11", G11, "scale: 1/10", value=scaled(Fraction(1, 10))),
    Number("fixed16.16", plain("i32"), type="fixed16.16", value=scaled(Fraction(1, 1 << 16))),
    Number("fixed32.32", plain("i64"), type="fixed32.32", value=wide(Fraction(1, 1 << 32))),
)
BITS: tuple[Kind, ...] = (
    BitFields("bits u8", U8, {"a": (0, 3, False), "b": (3, 1, False), "c": (4, 4, True)}),
    BitFields("bits u16le", U16_LE, {"a": (2, 9, True), "b": (15, 1, False)}),
    BitFields("bits i32", plain("i32"), {"a": (0, 20, False), "b": (20, 12, True)}),
    BitFields("bits u40", U40, {"a": (0, 32, True), "b": (33, 7, False)}),
    BitFields("bits u64", U64_LE, {"a": (0, 32, False), "b": (32, 32, False)}),
    BitFields("bits u14g", G14, {"a": (3, 5, True), "b": (8, 6, False)}),
)
FIXED: tuple[Kind, ...] = (
    Fixed("const u16", "u16", "byteorder: big, const: 0xCAFE", b"\xca\xfe"),
    Fixed("const u24le", "u24", "byteorder: little, const: 0x010203", b"\3\2\1"),
    Fixed("const u14g", "u14", "groups: {bits: 7, first: most}, const: 0x81", b"\1\1"),
    Fixed("const i8", "i8", "const: -1", b"\xff"),
    Fixed("reserved u8", "u8", "reserved: true", b"\0"),
    Fixed("reserved u24", "u24", "byteorder: big, reserved: true, const: 0x112233", b"\x11\x22\x33"),
    Fixed("reserved u14g", "u14", "groups: {bits: 7, first: most}, reserved: true", b"\0\0"),
)
RUNS: tuple[Kind, ...] = (
    Row("bytes[3]", "bytes", 3, 3),
    Row("text[4]", "text", 4, 4),
    *(
        Row(f"{item.name}[{number}]", item, number, number)
        for item, number in (
            *((U8, 2), (I8, 1), (U16, 2), (I16_LE, 3), (I32_LE, 2), (U32, 3), (U64, 2), (I64_LE, 1)),
            *((U24, 2), (I24_LE, 3), (U40_LE, 2), (U56, 1), (G14, 2), (G11, 3)),
        )
    ),
)


def _row(
    how: str,
    item: Item | Literal["bytes", "text"],
    least: int,
    most: int,
    *counters: tuple[Item, Literal["items", "bytes"]],
) -> Kind:
    base = item.name if isinstance(item, Item) else item
    return Row(f"{base}[{least}..{most}] {how}", item, least, most, counters)


_SPANS: tuple[tuple[Item | Literal["bytes", "text"], int, int], ...] = (
    *(("bytes", 0, 5), ("text", 1, 4), ("bytes", 2, 200), (U8, 0, 3), (I16_LE, 1, 5), (U8, 1, 250)),
    *((U16, 0, 4), (U64, 0, 3), (I64_LE, 1, 130), (U24, 0, 3), (I40, 1, 4), (I24_LE, 0, 150)),
    *((G14, 0, 3), (G11, 1, 2)),
)
OPEN = tuple(_row("rest", *span) for span in _SPANS)
COUNTED = (
    *(_row("by u8", *span, (U8, "items")) for span in _SPANS),
    *(_row("by bytes", *span, (U16_LE, "bytes")) for span in _SPANS[::2]),
    *(_row("by both", *span, (G14, "items"), (U24, "bytes")) for span in _SPANS[1::2]),
)
KINDS: tuple[Kind, ...] = (*INTEGERS, *MEANINGS, *BITS, *FIXED, *RUNS, *OPEN, *COUNTED)

# Messages


@dataclass(frozen=True)
class Layout:
    """A message: its kinds in order. With `counts_first`, the counts of all of them come first."""

    kinds: tuple[Kind, ...]
    counts_first: bool = False

    def __str__(self) -> str:
        return ", ".join(kind.name for kind in self.kinds) + (", counts first" if self.counts_first else "")

    def specs(self) -> list[Spec]:
        """The fields in wire order."""
        named = [(kind, f"f{index}") for index, kind in enumerate(self.kinds)]
        if self.counts_first:
            counts = [spec for kind, field in named for spec in kind.counts(field)]
            return counts + [spec for kind, field in named for spec in kind.fields(field)]
        return [spec for kind, field in named for spec in (*kind.counts(field), *kind.fields(field))]

    def draw(self, rng: random.Random, edge: Edge) -> tuple[dict[str, Native], bytes]:
        """Values of all fields and the payload."""
        drawn = [kind.draw(f"f{index}", rng, edge) for index, kind in enumerate(self.kinds)]
        values = {name: value for each in drawn for name, value in each.values.items()}
        if self.counts_first:
            return values, b"".join(e.counts for e in drawn) + b"".join(e.data for e in drawn)
        return values, b"".join(each.counts + each.data for each in drawn)

    def line(self, name: str, number: int) -> str:
        """The message in a schema file, as one line."""
        fields = ", ".join(f"{field}: {spec}" for field, spec in self.specs())
        return f"  {name}: {{id: {number}, direction: request, fields: {{{fields}}}}}"


HEAD = """\
qlinkgen: 1
protocol: {{name: pairs, revision: "1", source: Made up}}
byteorder: {order}
enums:
  colour: {{type: u8, values: {{red: 1, green: 2, blue: 200}}}}
  depth: {{type: i24, values: {{deep: -100000, flat: 0}}}}
flags:
  strict: {{type: u8, reserved: zero, values: {{ready: 0, warm: 3, fault: 7}}}}
  loose: {{type: u24, values: {{near: 0, far: 23}}}}
frame:
{frame}
commands:
  ask: {{id: 255, request: {{}}, response: {{}}, repeat: safe, addressing: {addressing}}}
messages:
"""

#: A frame with a length, without stuffing.
LENGTH = """\
  parts:
    start: {role: constant, value: 0x7E}
    size: {role: length, type: u16, counts: [payload]}
    number: {role: message, type: u16}
    payload: {role: payload, size: 0..5000}
    check: {role: checksum, type: u16, algorithm: crc-16/modbus, over: [number, payload]}
bus: {kind: master_slave}"""
#: The preamble does not occur inside a frame, so Python decodes frames without it.
STUFFED = """\
  parts:
    start: {role: constant, value: A5 A5}
    size: {role: length, type: u16, counts: [number, node, payload, check]}
    number: {role: message, type: u16}
    node: {role: address, type: u8}
    payload: {role: payload, size: 0..5000}
    check: {role: checksum, type: u16, algorithm: crc-16/modbus, over: [size, number, node, payload]}
  stuffing: {after: 0xA5, insert: 0, exempt: [start]}
bus: {kind: master_slave, nodes: 1..9}"""
#: The end of a message follows only from its counts.
COUNTS = """\
  parts:
    number: {role: message, type: u16}
    payload: {role: payload, size: 0..5000}
    check: {role: checksum, type: u16, algorithm: crc-16/modbus, over: [number, payload]}
bus: {kind: master_slave}"""
#: Packets: fields of fixed size, or one that takes the rest.
PACKET = """\
  packet:
    number: {role: message, type: u8}
    payload: {role: payload, size: 0..5000}
    check: {role: checksum, type: u8, algorithm: sum8, words: 1}
bus: {kind: host}"""


def schema(layouts: Sequence[Layout], frame: str, order: Order = "big") -> str:
    """A schema file with a message m0, m1, ... for each layout, one per line at the end."""
    numbers = (number for number in itertools.count() if number != 255)
    lines = [layout.line(f"m{index}", next(numbers)) for index, layout in enumerate(layouts)]
    addressing = "node" if frame == STUFFED else "none"
    return HEAD.format(frame=frame, order=order, addressing=addressing) + "\n".join(lines) + "\n"
