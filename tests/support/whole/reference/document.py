"""Fields and messages of a schema file."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Literal

import yaml

Doc = dict[str, Any]
Direction = Literal["request", "response", "message"]
Role = Literal["value", "constant", "reserved", "count"]


_REALS = {16: ">e", 32: ">f", 64: ">d"}


class Prefixed(int):
    """A number written as 0x10, not as 16: where bytes are expected, only the second is a pair of digits."""


class _Loader(yaml.CSafeLoader):
    """Loads numbers with a decimal point exactly; on, off, yes and no as text."""

    def exact(self, node: yaml.ScalarNode) -> Fraction:
        """The exact number."""
        return Fraction(node.value)

    def number(self, node: yaml.ScalarNode) -> int:
        value = int(self.construct_yaml_int(node))
        return value if node.value.isdecimal() else Prefixed(value)


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in pairs if tag != "tag:yaml.org,2002:bool"]
    for first, pairs in _Loader.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver("tag:yaml.org,2002:bool", re.compile(r"true\Z|false\Z"), list("tf"))
_Loader.add_constructor("tag:yaml.org,2002:float", _Loader.exact)
_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.number)


@dataclass(frozen=True, slots=True)
class Number:
    """An integer; `pieces` are the (lowest bit, bits) of its wire bytes in order."""

    bits: int
    signed: bool
    pieces: tuple[tuple[int, int], ...]
    low: int
    high: int
    default: int = 0
    scale: Fraction | None = None
    offset: Fraction = Fraction(0)
    truth: bool = False
    #: Bits that must be zero.
    forbidden: int = 0
    #: Each byte has two decimal digits.
    bcd: bool = False
    #: Of a number as text: base, minimum and maximum number of characters, digits after the point, whether
    #: it may have a sign.
    text: tuple[int, int, int, int, bool] | None = None
    #: The integer is the bits of a floating-point number, perhaps with bounds.
    real: bool = False
    bounds: tuple[float, float] | None = None

    def number(self, raw: int) -> float:
        """The floating-point number of bits."""
        return float(struct.unpack(_REALS[self.bits], raw.to_bytes(self.bits // 8, "big"))[0])

    def pattern(self, number: float) -> int:
        """The bits of a floating-point number; of every NaN the same."""
        return int.from_bytes(
            struct.pack(_REALS[self.bits], math.nan if math.isnan(number) else number), "big"
        )

    def told(self, raw: int) -> int:
        """A received integer without what a NaN does not preserve."""
        return self.pattern(math.nan) if self.real and math.isnan(self.number(raw)) else raw

    def native(self, raw: int) -> Fraction | int | bool | float:
        """The value in the unit, exactly."""
        if self.truth:
            return bool(raw)
        if self.real:
            return self.number(raw)
        return raw if self.scale is None else raw * self.scale + self.offset


@dataclass(frozen=True, slots=True)
class Run:
    """Bytes, text, or an array; `high` is None until the rest of the payload is known."""

    item: Number | None
    text: bool
    low: int
    high: int | None
    default: tuple[int, ...]
    #: Items of a few bits in a row, the first one in these bits.
    packed: str = ""
    #: The byte that fills up a shorter value.
    pad: bytes = b""
    #: The character after a text, which the text does not contain.
    end: bytes = b""

    @property
    def step(self) -> int:
        """Size of an item."""
        return len(self.item.pieces) if self.item else 1

    def bytes_of(self, number: int) -> int:
        """Size of so many items."""
        if self.packed and self.item:
            return -(-number * self.item.bits // 8)
        return number * self.step + len(self.end)

    def items_in(self, size: int) -> int:
        """Number of items that fit."""
        return 8 * size // self.item.bits if self.packed and self.item else size // self.step

    @property
    def most(self) -> int:
        """Maximum number of items."""
        assert self.high is not None
        return self.high


@dataclass(frozen=True, slots=True)
class Packed:
    """An integer divided into bit fields: (name, lowest bit, number)."""

    pieces: tuple[tuple[int, int], ...]
    bits: int
    members: tuple[tuple[str, int, Number], ...]


@dataclass(frozen=True, slots=True)
class Record:
    """Fields that are one value."""

    slots: tuple[Slot, ...]

    @property
    def size(self) -> int:
        """Maximum size on the wire."""
        return most_bytes(self.slots)

    @property
    def least(self) -> int:
        """Minimum size on the wire."""
        return sum(slot.least_bytes for slot in self.slots if not slot.conditional)

    @property
    def constant(self) -> bool:
        """Whether its size is constant."""
        return all(slot.fixed and not slot.conditional for slot in self.slots)

    def values(self) -> Iterator[tuple[str, Value]]:
        """Values in wire order."""
        return _values(self.slots)


@dataclass(frozen=True, slots=True)
class Records:
    """An array of records; `high` is None until the rest of the payload is known."""

    record: Record
    low: int
    high: int | None
    packed: str = ""
    #: Tests of the record that ends the array.
    last: tuple[Test, ...] = ()

    @property
    def step(self) -> int:
        """Size of an item."""
        return self.record.size

    def bytes_of(self, number: int) -> int:
        """Size of so many records."""
        return number * self.step

    def items_in(self, size: int) -> int:
        """Number of records that fit."""
        return size // self.record.least

    @property
    def most(self) -> int:
        """Maximum number of items."""
        assert self.high is not None
        return self.high


Kind = Number | Run | Packed | Record | Records
#: The kind of a value.
Value = Number | Run | Record | Records


#: A test of an earlier value: its name, ranges, whether they are excluded.
Test = tuple[str, tuple[tuple[int, int], ...], bool]


@dataclass(frozen=True, slots=True)
class Slot:
    """A field."""

    name: str
    kind: Kind
    role: Role = "value"
    counts: str = ""
    counts_in: str = "items"
    #: Bytes of other fields that it counts as well.
    more: int = 0
    #: Tests of earlier values: name, ranges, whether they are excluded.
    when: tuple[Test, ...] = ()
    optional: bool = False
    #: A new message has it.
    given: bool = True
    #: The value of which it is a case; its own name is then unknown to users.
    choice: str = ""

    @property
    def conditional(self) -> bool:
        """Whether it may be absent."""
        return self.optional or bool(self.when)

    def values(self) -> tuple[tuple[str, Value], ...]:
        """Its values."""
        return tuple(_values((self,)))

    @property
    def fixed(self) -> bool:
        """Whether its size is constant, where it is present."""
        if self.walked:
            return False
        return not isinstance(self.kind, Run | Records) or self.kind.low == self.kind.high

    @property
    def walked(self) -> bool:
        """Whether it has records that are read one by one."""
        if isinstance(self.kind, Records):
            return bool(self.kind.last) or not self.kind.record.constant
        return isinstance(self.kind, Record) and not self.kind.constant

    @property
    def least_bytes(self) -> int:
        """Minimum size on the wire."""
        kind = self.kind
        if isinstance(kind, Record):
            return kind.least
        if isinstance(kind, Records):
            return kind.low * kind.record.least
        return kind.bytes_of(kind.low) if isinstance(kind, Run | Records) else size_of(kind)

    @property
    def most_bytes(self) -> int:
        """Maximum size on the wire; 0 for a run without a bound."""
        kind = self.kind
        return kind.bytes_of(kind.high or 0) if isinstance(kind, Run | Records) else size_of(kind)


def most_bytes(slots: Iterable[Slot], along: Slot | None = None) -> int:
    """Maximum size of slots, of those that may be present `along` with another one."""
    kept = [slot for slot in slots if along is None or not _apart(slot, along)]
    if along is not None:  # records of variable size may leave more
        walked = [slot for slot in kept if slot.walked]
        kept = [slot for slot in kept if not slot.walked]
        return most_bytes(kept) + sum(slot.least_bytes for slot in walked if not slot.conditional)
    size = sum(slot.most_bytes for slot in kept if not slot.when)
    for name in {slot.when[0][0] for slot in kept if slot.when}:
        group = [slot for slot in kept if slot.when and slot.when[0][0] == name]
        ends = [
            end for slot in group for low, high in slot.when[0][1] for end in (low - 1, low, high, high + 1)
        ]
        size += max(sum(slot.most_bytes for slot in group if _met(slot.when[0], end)) for end in ends)
    return size


def _met(test: Test, number: int) -> bool:
    return any(low <= number <= high for low, high in test[1]) != test[2]


def _apart(one: Slot, other: Slot) -> bool:
    """Whether two slots are never present together."""
    for first in one.when:
        for second in other.when:
            ends = [end for low, high in (*first[1], *second[1]) for end in (low - 1, low, high, high + 1)]
            if first[0] == second[0] and not any(_met(first, end) and _met(second, end) for end in ends):
                return True
    return False


def size_of(kind: Number | Packed | Record) -> int:
    """Size of a single value."""
    return kind.size if isinstance(kind, Record) else len(kind.pieces)


def _values(slots: Iterable[Slot]) -> Iterator[tuple[str, Value]]:
    for slot in slots:
        if isinstance(slot.kind, Packed):
            yield from ((name, number) for name, _, number in slot.kind.members)
        elif slot.role == "value":
            yield slot.name, slot.kind


@dataclass(frozen=True, slots=True)
class Message:
    """A message in one direction."""

    name: str
    number: int
    direction: Direction
    slots: tuple[Slot, ...]
    addresses: tuple[tuple[int, int], ...]
    default_address: int
    empty_is_default: bool = False
    checked: bool = True
    #: Values of its frame.
    beside: tuple[tuple[str, Number], ...] = ()
    #: Zeros at the end of its payload are not sent after so many bytes; None: all are sent.
    trim: int | None = None
    #: The byte between texts, and the bytes that a text does not have.
    separator: bytes = b""
    barred: bytes = b""
    #: Kinds of frame that carry it, if there are several.
    frames: tuple[str, ...] = ()
    #: Maximum size of a payload in the frame.
    limit: int | None = None

    def values(self) -> Iterator[tuple[str, Value]]:
        """Values in wire order, those of the frame first."""
        yield from self.beside
        yield from _values(self.slots)

    def by_name(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Values as users see them: of a choice that of its case, under the name of the choice."""
        found = {name: given[name] for name, _ in self.beside}
        for slot in self.slots:
            for name, _ in slot.values():
                if not slot.choice or found.get(slot.choice) is None:
                    found[slot.choice or name] = given[name]
        return found

    @property
    def walked(self) -> bool:
        """Whether the places of fields depend on values."""
        return any(
            slot.conditional or slot.walked or (isinstance(slot.kind, Run) and slot.kind.end)
            for slot in self.slots
        )

    @property
    def sizes(self) -> tuple[int, int]:
        """Minimum and maximum size of the payload."""
        always = [slot for slot in self.slots if not slot.conditional]
        most = most_bytes(self.slots)
        if self.limit is not None and any(slot.walked for slot in self.slots):
            most = min(most, self.limit)
        return sum(slot.least_bytes for slot in always), most

    def allows(self, address: int) -> bool:
        """Whether the address is legal for the message."""
        return not self.addresses or any(low <= address <= high for low, high in self.addresses)


def _newest(node: Any) -> Any:
    """What the newest version of the protocol has."""
    if isinstance(node, list):
        return [_newest(each) for each in node]
    if not isinstance(node, dict):
        return node
    return {
        name: _newest(each) for name, each in node.items() if not (isinstance(each, dict) and "until" in each)
    }


def load(text: str) -> Doc:
    """The plain data of a schema file."""
    document: Doc = _newest(yaml.load(text, _Loader))
    parts = document.get("frame", {}).get("parts", {})
    # Silence has no bytes, and frames end without it.
    for name in [
        name for name, spec in parts.items() if isinstance(spec, dict) and spec.get("role") == "idle"
    ]:
        del parts[name]
    return document


def exact(given: object) -> Fraction:
    """A number in any of its notations."""
    text = str(given).replace(" ", "").replace("_", "")
    if text.lower().startswith("0x"):
        return Fraction(int(text, 16))
    if "^" in text:
        top, base, power = re.split(r"[/^]", text)
        return Fraction(int(top), int(base) ** int(power))
    if "/" in text:
        top, below = text.split("/")
        return Fraction(top) / int(below)
    return Fraction(text)


def span(given: object) -> tuple[Fraction, Fraction]:
    """A range, or one number."""
    first, _, last = str(given).partition("..")
    return exact(first), exact(last or first)


def whole_span(given: object) -> tuple[int, int]:
    """A range of whole numbers."""
    first, last = span(given)
    return int(first), int(last)


def octets(given: object) -> bytes:
    """Pairs of hex digits, to YAML a number if they are two decimal ones; or a number."""
    if isinstance(given, Prefixed) or (isinstance(given, int) and not 10 <= given <= 99):
        return bytes([given])
    return bytes.fromhex(str(given))


def _doc(given: Any) -> Doc:
    return given if isinstance(given, dict) else {"at": given}


def part_doc(given: object) -> Doc:
    """A part of a frame with its role; a short form becomes a mapping."""
    if not isinstance(given, dict):
        pairs = isinstance(given, int) or re.fullmatch("([0-9A-F]{2} ?)+", str(given))
        given = {"value" if pairs else "type": given}
    told = {
        "bits": "bits",
        "equals": "derived",
        "const": "constant",
        "value": "constant",
        "text": "constant",
        "counts": "length",
        "algorithm": "checksum",
    }
    return {"role": next((role for key, role in told.items() if key in given), "value"), **given}


def _as_text(number: Number, spec: Doc) -> Number:
    """A number that is sent as text; a shorter text than the type needs limits it."""
    name, _, span = spec["as"].rstrip("]").partition("[")
    point = 0
    while name == "decimal" and Fraction(str(spec.get("scale", 1))) * 10**point < 1:
        point += 1
    base = 10 if name == "decimal" else 16
    longest = max(len(f"{abs(each):d}" if base == 10 else f"{each:x}") for each in (number.low, number.high))
    longest = max(longest, point + 1) + (point > 0) + (number.low < 0)
    least, most = whole_span(span) if span else (1, longest)
    assert most is not None
    digits = most - (point > 0)
    low = -(10 ** (digits - 1)) + 1 if digits - 1 > point else 0
    high = min(number.high, base**digits - 1)
    text = (base, least, most, point, max(number.low, low) < 0)
    return replace(number, low=max(number.low, low), high=high, text=text, pieces=((0, 8),) * most)


def byte_pieces(size: int, order: str) -> tuple[tuple[int, int], ...]:
    """An integer of whole bytes."""
    pieces = tuple((8 * index, 8) for index in range(size))
    return pieces if order == "little" else pieces[::-1]


def _counting(fields: Mapping[str, Any]) -> Doc:
    """The fields, with sizes that name an earlier field as counts of it."""
    found = dict(fields)
    for name, spec in fields.items():
        written = spec if isinstance(spec, dict) else {"type": spec}
        if "switch" in written:
            continue
        base, _, size = str(written["type"]).partition("[")
        count = found.get(size.rstrip("]"))
        if count is not None:
            counter = dict(count) if isinstance(count, dict) else {"type": count}
            bounds = str(counter.pop("range", ""))
            bare = base in ("bytes", "text") and not bounds
            found[size.rstrip("]")] = {**counter, "counts": name}
            found[name] = {**written, "type": base if bare else f"{base}[{bounds}]"}
    return found


class Fields:
    """Builds fields from their mappings."""

    def __init__(self, document: Doc, payload_most: int) -> None:
        """`payload_most` limits fields without a bound, and all fields together."""
        self._document = document
        self.most = payload_most
        self._order = document.get("byteorder", "big")

    def build(self, fields: Mapping[str, Any]) -> tuple[Slot, ...]:
        """The fields of one message."""
        slots = self._slots(fields)
        counts = {slot.counts: slot for slot in slots[::-1] if slot.counts}
        bounded = [
            slot for slot in slots if not isinstance(slot.kind, Run | Records) or slot.kind.high is not None
        ]
        return tuple(
            _bounded(slot, self.most - most_bytes(bounded, along=slot), counts.get(slot.name))
            for slot in slots
        )

    def _slots(self, fields: Mapping[str, Any]) -> tuple[Slot, ...]:
        slots: list[Slot] = []
        for name, spec in _counting(fields).items():
            if isinstance(spec, dict) and "switch" in spec:
                slots += self._cases(name, spec, slots)
                continue
            resolved = self._resolved(spec)
            slots.append(self._conditional(self._slot(name, resolved), resolved, slots))
        return tuple(self._counting_several(slot, fields.get(slot.name), slots) for slot in slots)

    @staticmethod
    def _counting_several(slot: Slot, spec: Any, slots: Sequence[Slot]) -> Slot:
        """A count of the bytes of several fields, one of them of variable size."""
        counted = spec.get("counts") if isinstance(spec, dict) else None
        if not isinstance(counted, list):
            return slot
        (run,) = (each.name for each in slots if each.name in counted and not each.fixed)
        more = sum(each.most_bytes for each in slots if each.name in counted and each.name != run)
        unit = slot.counts_in if len(counted) == 1 else "bytes"
        return replace(slot, counts=run, counts_in=unit, more=more)

    def _cases(self, name: str, spec: Doc, before: list[Slot]) -> list[Slot]:
        """The cases of a choice as fields that exclude each other."""
        tag = spec["switch"].split(".")[-1]
        number = dict(_values(before))[tag]
        assert isinstance(number, Number)
        keys = [self._wanted(key) for key in spec["cases"]]
        tests: list[Test] = [(tag, (key,), False) for key in keys]
        kinds = list(spec["cases"].values())
        if "default" in spec:
            tests.append((tag, tuple(keys), True))
            kinds.append(spec["default"])
        found = []
        for index, (test, kind) in enumerate(zip(tests, kinds, strict=True)):
            if isinstance(kind, dict) and "type" not in kind:
                slot = Slot(f"{name}@{index}", Record(self._slots(kind)))
            else:
                slot = self._slot(f"{name}@{index}", self._resolved(kind))
            if kind:
                given = _met(test, number.default)
                found.append(replace(slot, when=(test,), given=given, choice=name))
        return found

    def _conditional(self, slot: Slot, spec: Doc, before: list[Slot]) -> Slot:
        """The slot with what decides whether it is present."""
        given = spec.get("if", {})
        wanted = {given: True} if isinstance(given, str) else given
        values = dict(_values(before))
        tests, holds = [], True
        for ref, value in wanted.items():
            name = ref.split(".")[-1]
            number = values[name]
            assert isinstance(number, Number)
            excluded = str(value).startswith("not ")
            items = value if isinstance(value, list) else [str(value).removeprefix("not ")]
            ranges = tuple(self._wanted(each) for each in items)
            tests.append((name, ranges, excluded))
            holds = holds and any(low <= number.default <= high for low, high in ranges) != excluded
        optional = spec.get("optional", False)
        return replace(slot, when=tuple(tests), optional=optional, given=holds and not optional)

    def _wanted(self, item: object) -> tuple[int, int]:
        text = str(item)
        if text.lower() in ("true", "false"):
            return (int(text.lower() == "true"),) * 2
        for enum in self._document.get("enums", {}).values():
            if text in enum["values"]:
                member = enum["values"][text]
                number = member["value"] if isinstance(member, dict) else member
                return number, number
        return whole_or_negative(text)

    def beside(self, name: str, given: Any) -> tuple[Slot, tuple[tuple[str, int, Number], ...]]:
        """A part of a frame with values: its integer, and the name, lowest bit and number of each."""
        if "groups" in self._document:
            # Groups of the file are those of fields.
            document = {key: each for key, each in self._document.items() if key != "groups"}
            return Fields(document, self.most).beside(name, given)
        spec = part_doc(given)
        if "bits" in spec:
            members = tuple(
                self._member(key, spec["bits"][key]) for key, role, *_ in bits_of(spec) if role == "value"
            )
            return Slot(name, self._number(spec["type"], spec)), members
        slot = self._slot(
            name,
            self._resolved({key: each for key, each in spec.items() if key not in ("role", "per", "echo")}),
        )
        if isinstance(slot.kind, Packed):
            return slot, slot.kind.members
        assert isinstance(slot.kind, Number)
        return slot, ((name, 0, slot.kind),)

    def _resolved(self, spec: Any) -> Doc:
        """A field merged with its named types."""
        written: Doc = {"type": spec} if isinstance(spec, str) else dict(spec)
        base, brackets, count = written["type"].partition("[")
        named = self._document.get("types", {}).get(base.strip())
        if named is None or "fields" in named:
            return written
        below = self._resolved(named)
        return {**below, **written, "type": below["type"] + brackets + count}

    def _slot(self, name: str, spec: Doc) -> Slot:
        base, bracket, count = spec["type"].replace(" ", "").partition("[")
        if base in self._document.get("types", {}):
            record = Record(self.build(self._document["types"][base]["fields"]))
            if not bracket:
                return Slot(name, record)
            low, high = whole_span(count.rstrip("]")) if count.rstrip("]") else (0, None)
            last = self._conditional(
                Slot(name, record), {"if": spec.get("last", {})}, list(record.slots)
            ).when
            return Slot(name, Records(record, low, high, last=last))
        if base in ("bytes", "text") or bracket:
            return Slot(name, self._run(base, count.rstrip("]"), spec))
        number = self._number(base, spec)
        if "bits" in spec:
            members = tuple(self._member(*each) for each in spec["bits"].items())
            return Slot(name, Packed(number.pieces, number.bits, members))
        if "counts" in spec:
            return Slot(name, number, "count", str(spec["counts"]), spec.get("counts_in", "items"))
        number = _quantified(number, spec)
        if spec.get("reserved"):
            return Slot(name, self._with_default(number, base, spec, "const"), "reserved")
        key = "const" if "const" in spec else "default"
        role: Role = "constant" if "const" in spec else "value"
        return Slot(name, self._with_default(number, base, spec, key), role)

    def _run(self, base: str, count: str, spec: Doc) -> Run:
        item = None if base in ("bytes", "text") else _quantified(self._number(base, spec), spec)
        listed = isinstance(spec.get("default"), list)
        if item is not None:
            item = self._with_default(item, base, {} if listed else spec, "default")
        low, high = whole_span(count) if count else (0, None)
        default: tuple[int, ...] = ()
        if listed and item is not None:
            default = tuple(
                self._with_default(item, base, {"default": each}, "default").default
                for each in spec["default"]
            )
        elif "default" in spec and item is None:
            text = str(spec["default"])
            default = tuple(text.encode("ascii") if base == "text" else bytes.fromhex(text))
        fill = item.default if item else ord(" ") if base == "text" else 0
        if "pad" in spec:
            return Run(item, base == "text", low, high, default, pad=octets(spec["pad"]))
        if "terminator" in spec:
            end = octets(spec["terminator"])
            fill = ord("_") if end == b" " else fill
            return Run(item, base == "text", low, high, default + (fill,) * (low - len(default)), end=end)
        filled = default + (fill,) * (low - len(default))
        return Run(item, base == "text", low, high, filled, spec.get("packed", ""))

    def _number(self, base: str, spec: Doc) -> Number:
        bits, signed, scale, truth, forbidden = self._carrier(base)
        bits = 1 if truth and "packed" in spec else bits
        pieces = () if "packed" in spec else self._pieces(bits, spec)
        low = 0 if not signed else -(1 << bits - 1)
        high = 1 if truth else (1 << bits - signed) - 1
        real, bcd = base in ("f16", "f32", "f64"), spec.get("as") == "bcd"
        high = 10 ** (bits // 4) - 1 if bcd else high
        number = Number(
            bits, signed, pieces, low, high, 0, scale, Fraction(0), truth, forbidden, bcd=bcd, real=real
        )
        return _as_text(number, spec) if str(spec.get("as", "bcd")) != "bcd" else number

    def _carrier(self, base: str) -> tuple[int, bool, Fraction | None, bool, int]:
        if base == "bool":
            return self._document.get("groups", {}).get("bits", 8), False, None, True, 0
        if enum := self._document.get("enums", {}).get(base):
            return int(enum["type"][1:]), enum["type"][0] == "i", None, False, 0
        if flags := self._document.get("flags", {}).get(base):
            bits = int(flags["type"][1:])
            free = flags.get("reserved") != "zero"
            return bits, False, None, False, 0 if free else (1 << bits) - 1 & ~_named_bits(flags)
        if "fixed" in base:
            whole, fraction = base.lstrip("u").removeprefix("fixed").split(".")
            return int(whole) + int(fraction), base[0] != "u", Fraction(1, 1 << int(fraction)), False, 0
        return int(base[1:]), base[0] == "i", None, False, 0

    def _pieces(self, bits: int, spec: Doc) -> tuple[tuple[int, int], ...]:
        groups = spec.get("groups") or self._document.get("groups")
        if groups is None:
            return byte_pieces(bits // 8, spec.get("byteorder") or self._order)
        pieces: list[tuple[int, int]] = []
        for first, last in map(whole_span, spec.get("parts", [f"0..{bits - 1}"])):
            starts = range(first, last + 1, groups["bits"])
            inside = [(at, min(groups["bits"], last + 1 - at)) for at in starts]
            pieces += inside if groups["first"] == "least" else inside[::-1]
        return tuple(pieces)

    def _member(self, name: str, spec: Any) -> tuple[str, int, Number]:
        written: Doc = spec if isinstance(spec, dict) else {"at": spec}
        first, last = whole_span(written["at"])
        bits, signed = last + 1 - first, written.get("signed", False)
        base = written.get("type", "")
        numeric = signed or "scale" in written or "offset" in written or "role" in written
        truth = base == "bool" or (not base and bits == 1 and not numeric)
        flags = self._document.get("flags", {}).get(base, {})
        forbidden = (1 << bits) - 1 & ~_named_bits(flags) if flags.get("reserved") == "zero" else 0
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
        number = Number(bits, signed, (), low, high, truth=truth, forbidden=forbidden)
        number = _quantified(number, written)
        return name, first, self._with_default(number, base, written, "default")

    def _with_default(self, number: Number, base: str, spec: Doc, key: str) -> Number:
        """Without a default, the number nearest to 0."""
        given = spec.get(key)
        if number.real:
            low, high = number.bounds or (-math.inf, math.inf)
            nearest = min(max(0.0, low), high) if given is None else _real(given)
            return replace(number, default=number.pattern(nearest))
        if given is None:
            return replace(number, default=min(max(0, number.low), number.high))
        if isinstance(given, bool):
            return replace(number, default=int(given))
        names = self._document.get("enums", {}).get(base, {}).get("values", {})
        if given in names:
            member = names[given]
            return replace(number, default=member["value"] if isinstance(member, dict) else member)
        return replace(number, default=int((exact(given) - number.offset) / (number.scale or 1)))


def _real(given: object) -> float:
    text = str(given)
    return float(text) if text in ("nan", "inf", "-inf") else float(exact(given))


def _named_bits(flags: Doc) -> int:
    members = flags["values"].values()
    return sum(1 << (each["bit"] if isinstance(each, dict) else each) for each in members)


def _quantified(number: Number, spec: Doc) -> Number:
    """The number with its scale and range."""
    if "scale" in spec or "offset" in spec:
        scale = exact(spec["scale"]) if "scale" in spec else number.scale or Fraction(1)
        number = replace(number, scale=scale, offset=exact(spec.get("offset", 0)))
    if "range" in spec and number.real:
        low_end, high_end = (number.number(number.pattern(float(end))) for end in span(spec["range"]))
        return replace(number, bounds=(low_end, high_end))
    if "range" in spec:
        ends = [(end - number.offset) / (number.scale or 1) for end in span(spec["range"])]
        number = replace(number, low=int(min(ends)), high=int(max(ends)))
    if "raw_range" in spec:
        low, high = whole_or_negative(spec["raw_range"])
        number = replace(number, low=low, high=high)
    return number


def whole_or_negative(given: object) -> tuple[int, int]:
    """A range of integers."""
    first, last = span(given)
    return int(first), int(last)


def _bounded(slot: Slot, room: int, counter: Slot | None) -> Slot:
    kind = slot.kind
    if not isinstance(kind, Run | Records) or kind.high is not None:
        return slot
    most = kind.items_in(max(0, room))
    if counter is not None:
        assert isinstance(counter.kind, Number)
        limit = counter.kind.high - counter.more
        most = min(most, kind.items_in(limit) if counter.counts_in == "bytes" else limit)
    return replace(slot, kind=replace(kind, high=max(1, most)))


def bits_of_type(written: str) -> int:
    """Number of bits of ``u16`` or ``text[2]``."""
    return 8 * int(written[5:-1]) if written.startswith("text") else int(written[1:])


def bits_of(spec: Doc) -> Iterator[tuple[str, str, int, int, Doc]]:
    """What the bits of a part hold: name ("" for all bits), role, lowest bit, number of bits, mapping."""
    spec = part_doc(spec)
    if spec["role"] in ("message", "address", "direction", "constant") and "type" in spec:
        yield "", spec["role"], 0, bits_of_type(spec["type"]), spec
    for name, given in spec.get("bits", {}).items():
        inner = _doc(given)
        first, last = whole_span(inner["at"])
        role = inner.get("role", "constant" if "const" in inner else "value").replace("counter", "value")
        yield name, role, first, last + 1 - first, inner


def numbered(document: Doc, given: Any, direction: str) -> int:
    """The number of a message: the direction or another value of its part, then the pieces of its id."""
    number = 0
    parts = document["frame"].get("parts", {})
    if not parts:
        return int(given)
    pieces = [(name, each) for name, spec in parts.items() for each in bits_of(spec)]
    for wanted in ("direction", "message"):
        for part, (inner, role, _, bits, spec) in pieces:
            if role == wanted:
                name = inner or part
                values = spec.get("values", {}).get(direction) if role == "direction" else given
                value = values[name] if isinstance(values, dict) else values
                value = int.from_bytes(value.encode("ascii"), "big") if isinstance(value, str) else value
                number = number << bits | value
    return number


def seeds(document: Doc, message: str) -> Mapping[str, bytes]:
    """The bytes of the numeric attributes of a message."""
    name = message.partition(".")[0]
    given = dict(document.get("defaults", {}).get("attributes", {}))
    given |= document.get("commands", {}).get(name, {}).get("attributes", {})
    if name in document.get("messages", {}):
        given = document["messages"][name].get("attributes", {})
    found = {}
    for each, spec in document.get("attributes", {}).items():
        if "type" in spec and each in given:
            order = document.get("byteorder", "big")
            found[f"attribute.{each}"] = given[each].to_bytes(int(spec["type"][1:]) // 8, order)
    return found


def messages(document: Doc, fields: Fields, addressed: bool) -> tuple[Message, ...]:
    """All messages of a file, in order."""
    return tuple(with_separator(each, document) for each in _messages(document, fields, addressed))


def with_separator(message: Message, document: Doc) -> Message:
    """A message with the text that its schema puts between its values."""
    name, _, reply = message.name.partition(".")
    usual = document.get("defaults", {}).get("separator")
    places = [document.get("messages", {}).get(name), document.get("commands", {}).get(name)]
    if reply not in ("", "request", "response"):
        own = document["commands"][name].get("replies", {})
        found = own.get(reply) or document.get("replies", {}).get(reply)
        places = [found or document["commands"][name]]  # a step has the separator of its command
    elif not any(places):
        places = [document["replies"][name]]
    spec = next(each for each in places if each)
    chosen = spec.get("separator", usual)
    if chosen in (None, "none") or not message.slots:
        return message
    ends = [each for each in document["frame"]["parts"].values() if isinstance(each, dict)]
    ends = [each for each in ends if each.get("role") == "terminator"]
    end = b"".join(each["text"].encode() if "text" in each else octets(each["value"]) for each in ends)
    barred = chosen.encode() + end
    slots = tuple(_filled(slot, barred) for slot in message.slots)
    return replace(message, slots=slots, separator=chosen.encode(), barred=barred)


def _filled(slot: Slot, barred: bytes) -> Slot:
    """A text that needs a value, which is made up of a legal character."""
    kind = slot.kind
    if not isinstance(kind, Run) or kind.default != (ord(" "),) * kind.low:
        return slot
    fill = next(each for each in b" 0x_" if each not in barred)
    return replace(slot, kind=replace(kind, default=(fill,) * kind.low))


def _messages(document: Doc, fields: Fields, addressed: bool) -> tuple[Message, ...]:
    found: list[Message] = []
    for name, spec in document.get("commands", {}).items():
        defaults = document.get("defaults", {})
        merged = {**defaults, **spec, "response": answer(spec.get("response"), defaults.get("response"))}
        found += of_command(name, merged, document, fields, addressed)
        found += steps(name, merged, lambda _kind: (document, fields, addressed))
        found += _replies(name, merged, document, fields, {each.name for each in found}, addressed=addressed)
    for name, spec in document.get("messages", {}).items():
        found.append(single(name, spec, document, fields, addressed))
    return tuple(replace(each, limit=fields.most) for each in found)


def single(name: str, spec: Doc, document: Doc, fields: Fields, addressed: bool) -> Message:
    """A message that is not part of a command."""
    nodes = _nodes(document) if addressed else None
    direction = _sent(document, spec)
    return Message(
        name,
        numbered(document, spec.get("id"), direction),
        direction,
        fields.build(spec["fields"]),
        (nodes,) if nodes else (),
        nodes[0] if nodes else 0,
        checked=_checked(document, name),
    )


def _sent(document: Doc, spec: Doc) -> Direction:
    """The direction of a message outside of commands."""
    direction: Direction = spec.get("direction", "message")
    if "from" in spec:
        direction = "response" if document["bus"]["sides"].index(spec["from"]) else "request"
    return direction


def of_command(  # noqa: PLR0917  # what the reference reads
    name: str,
    spec: Doc,
    document: Doc,
    fields: Fields,
    addressed: bool,
    directions: tuple[Direction, ...] = ("request", "response"),
) -> Iterator[Message]:
    """The messages of a command in some directions."""
    for direction in directions:
        if isinstance(spec[direction], str):  # none, or the name of a message
            continue
        if direction == "response" and not _responds(spec):
            continue
        ranges, default = (
            _addresses(spec.get("addressing", "node"), direction, document) if addressed else ((), 0)
        )
        empty = direction == "request" and spec.get("empty_request") == "defaults"
        number, written = spec.get("id"), spec[direction]
        if direction == "response":
            number, written = _number(document, written.get("id"), number), written["fields"]
        else:
            number = numbered(document, number, direction)
        asked = {value: number for slot in fields.build(spec["request"]) for value, number in _numbers(slot)}
        slots = fields.build({key: _from_request(each, asked) for key, each in written.items()})
        slots = tuple(_whole(slot, slots) for slot in slots)
        yield Message(
            f"{name}.{direction}",
            number,
            direction,
            slots,
            ranges,
            default,
            empty,
            _checked(document, name),
        )


def _responds(spec: Doc) -> bool:
    """Whether a command has a response of its own; a dialogue has one if a step names it."""
    return "steps" not in spec or any(step.get("receive") == "response" for step in spec["steps"])


def steps(name: str, spec: Doc, place: Callable[[str | None], tuple[Doc, Fields, bool]]) -> Iterator[Message]:
    """The messages of a dialogue that steps describe; `place` tells where those of a kind are built."""
    listed = spec.get("steps", [])
    last = max((index for index, step in enumerate(listed) if "receive" in step), default=None)
    for index, step in enumerate(listed):
        key = "send" if "send" in step else "receive"
        if isinstance(step[key], str):
            continue
        direction: Direction = "request" if key == "send" else "response"
        written = long_form(step[key])
        document, fields, addressed = place(written.get("frame"))
        nodes = (_nodes(document),) if addressed else ()
        number = _number(document, written.get("id"), spec.get("id"), direction)
        given = written["fields"]
        if index == last:
            asked = {value: each for slot in fields.build(spec["request"]) for value, each in _numbers(slot)}
            given = {each: _from_request(kind, asked) for each, kind in given.items()}
        slots = fields.build(given)
        slots = tuple(_whole(slot, slots) for slot in slots) if index == last else slots
        full = f"{name}.{step.get('name', f'step_{index + 1}')}"
        default = nodes[0][0] if nodes else 0
        yield Message(full, number, direction, slots, nodes, default, checked=_checked(document, name))


def _numbers(slot: Slot) -> Iterator[tuple[str, Number]]:
    if isinstance(slot.kind, Number):
        yield slot.name, slot.kind


def _from_request(spec: Any, asked: Mapping[str, Number]) -> Any:
    """A field with the range of the field of the request that has its number of items."""
    text = spec.get("type", "") if isinstance(spec, dict) else spec
    if not (match := re.search(r"\[request\.(\w+)\]", text)):
        return spec
    number = asked[match[1]]
    text = text.replace(match[0], f"[{number.low}..{number.high}]")
    return {**spec, "type": text} if isinstance(spec, dict) else text


def _whole(slot: Slot, slots: Sequence[Slot]) -> Slot:
    """A row of bits whose bytes alone are counted has as many items as fit them."""
    kind = slot.kind
    counted = any(each.counts == slot.name and each.counts_in == "items" for each in slots)
    if not isinstance(kind, Run) or not kind.packed or kind.low == kind.most or counted:
        return slot
    return replace(slot, kind=replace(kind, high=kind.items_in(kind.bytes_of(kind.most))))


def answer(own: Any, common: Any) -> Any:
    """A response in its long form, or "none"."""
    given = common if own is None else own
    if isinstance(given, str):
        return given
    return {**long_form(common or {}), **({} if own is None else long_form(own))}


def long_form(given: Any) -> Doc:
    """A response in its long form, without any fields for a word."""
    if isinstance(given, str):
        return {}
    is_long = given.keys() <= {"id", "fields", "means", "frame"} and (
        isinstance(given.get("fields"), dict)
        or ("fields" not in given and re.match(r"\d|request|{'\w+': \d", str(given.get("id", ""))))
    )
    return dict(given) if is_long else {"fields": given}


def _number(document: Doc, given: Any, asked: Any, direction: str = "response") -> int:
    """The number of an answer or a step; `given` is None if it is that of the request."""
    if given is not None and not str(given).startswith("request"):
        return numbered(document, given, direction)
    offset = str(given or "").replace(" ", "").removeprefix("request.id")
    return numbered(document, asked, direction) + int(offset or "0", 0)


def _relative(number: Any) -> bool:
    """Whether the id of an answer depends on that of the request."""
    return number is None or (isinstance(number, str) and number.startswith("request.id"))


def _replies(
    name: str, spec: Doc, document: Doc, fields: Fields, known: set[str], *, addressed: bool
) -> Iterator[Message]:
    """Answers other than the response; one with a number for all commands is one message."""
    own = spec.get("replies", {})
    common = {key: each for key, each in document.get("replies", {}).items() if key not in own}
    if spec["response"] == "none" and "steps" not in spec:
        return
    for key, reply in (*common.items(), *own.items()):
        shared = key in common and not _relative(reply.get("id"))
        full = key if shared else f"{name}.{key}"
        if full in known:
            continue
        nodes = (_nodes(document),) if addressed else ()
        way = next(iter(reply.get("if", {"": "response"}).values()))
        number = _number(document, reply.get("id"), spec.get("id"), way)
        slots = fields.build(reply["fields"])
        checked = _checked(document, key if shared else name)
        default = nodes[0][0] if nodes else 0
        yield Message(full, number, "response", slots, nodes, default, checked=checked)


def _checked(document: Doc, name: str) -> bool:
    only = (document["frame"].get("marked") or {}).get("checksum", {}).get("only")
    return only is None or name in only


def _nodes(document: Doc) -> tuple[int, int]:
    return whole_span(document["bus"]["nodes"])


def _addresses(
    addressing: str, direction: Direction, document: Doc
) -> tuple[tuple[tuple[int, int], ...], int]:
    nodes, everybody = _nodes(document), document["bus"].get("broadcast")
    if direction == "response" or addressing == "node":
        return (nodes,), nodes[0]
    if addressing == "broadcast":
        return ((everybody, everybody),), everybody
    return (nodes, (everybody, everybody)), nodes[0]
