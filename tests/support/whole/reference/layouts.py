"""The types of fields, and messages, as bytes and values."""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from tests.support.whole.reference.notation import Direction, Role

_REALS = {16: ">e", 32: ">f", 64: ">d"}


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
    #: Spaces fill up its text.
    spaced: bool = False
    #: Of an enum that is sent as text: its words, whose places are the numbers.
    words: tuple[bytes, ...] = ()
    #: They are received in any case.
    any_case: bool = False
    #: The integer is the bits of a floating-point number, perhaps with bounds.
    real: bool = False
    bounds: tuple[float, float] | None = None
    #: A floating-point number is sent as text with a decimal exponent.
    scientific: bool = False
    #: It is a text of a header, without these characters.
    without: bytes | None = None

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

    def native(self, raw: int) -> Fraction | int | bool | float | str:
        """The value in the unit, exactly; that of a text."""
        if self.without is not None:
            return raw.to_bytes(self.bits // 8, "big").decode("ascii")
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
        return values_of(self.slots)


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
    #: Of a number that follows from other fields: how, and their names.
    rule: Mapping[str, Any] | None = None
    over: tuple[str, ...] = ()
    #: Constants that are legal besides the one that is sent.
    accepted: tuple[int, ...] = ()
    #: Bytes of other fields that it counts as well, less its offset, and bytes or items of one step.
    more: int = 0
    scale: int = 1
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
        return tuple(values_of((self,)))

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
    def texts(self) -> tuple[int, int]:
        """Minimum and maximum number of texts between separators."""
        listed = isinstance(self.kind, Run) and self.kind.item
        return (self.kind.low, self.kind.most) if listed and isinstance(self.kind, Run) else (1, 1)

    @property
    def text_sizes(self) -> tuple[int, int]:
        """Minimum and maximum number of characters of a text between separators."""
        kind: Kind | None = self.kind
        if isinstance(kind, Run) and kind.item is None:
            return kind.low, kind.most
        kind = kind.item if isinstance(kind, Run) else kind
        assert isinstance(kind, Number)
        if kind.words:
            sizes = [len(word) for word in kind.words]
            return min(sizes), max(sizes)
        if kind.scientific:
            return 1, 24
        assert kind.text
        _, least, most, _, _ = kind.text
        return least if least == most else 1, most

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
    left = [(slot.when, slot.most_bytes) for slot in kept if slot.when]
    while left:
        names, group = {test[0] for test in left[0][0]}, []
        while more := [each for each in left if names & {test[0] for test in each[0]}]:
            group += more
            left = [each for each in left if each not in more]
            names |= {test[0] for when, _ in more for test in when}
        size += _most_of(group)
    return size


def _most_of(group: list[tuple[tuple[Test, ...], int]]) -> int:
    """The maximum size of what is present at once; of many values only the first tests count."""
    names = sorted({test[0] for when, _ in group for test in when})
    if len(names) > 4:
        firsts = {when[0][0] for when, _ in group}
        return sum(
            _most_of([(when[:1], size) for when, size in group if when[0][0] == name]) for name in firsts
        )
    ends = [
        sorted({end for when, _ in group for test in when if test[0] == name for low, high in test[1]
                for end in (low - 1, low, high, high + 1)})
        for name in names
    ]  # fmt: skip
    most = 0
    for numbers in itertools.product(*ends):
        given = dict(zip(names, numbers, strict=True))
        present = (size for when, size in group if all(is_met(test, given[test[0]]) for test in when))
        most = max(most, sum(present))
    return most


def is_met(test: Test, number: int) -> bool:
    return any(low <= number <= high for low, high in test[1]) != test[2]


def _apart(one: Slot, other: Slot) -> bool:
    """Whether two slots are never present together."""
    for first in one.when:
        for second in other.when:
            ends = [end for low, high in (*first[1], *second[1]) for end in (low - 1, low, high, high + 1)]
            if first[0] == second[0] and not any(is_met(first, end) and is_met(second, end) for end in ends):
                return True
    return False


def size_of(kind: Number | Packed | Record) -> int:
    """Size of a single value."""
    return kind.size if isinstance(kind, Record) else len(kind.pieces)


def values_of(slots: Iterable[Slot]) -> Iterator[tuple[str, Value]]:
    for slot in slots:
        if isinstance(slot.kind, Packed):
            yield from ((name, number) for name, _, number in slot.kind.members)
        elif slot.role == "value":
            yield slot.name, slot.kind


def by_choice(slots: Iterable[Slot], given: Mapping[str, Any]) -> dict[str, Any]:
    """Values as users see them: of a choice that of its case, under the name of the choice."""
    found: dict[str, Any] = {}
    for slot in slots:
        for name, _ in slot.values():
            if not slot.choice or found.get(slot.choice) is None:
                found[slot.choice or name] = given[name]
    return found


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
    #: Of those that some frames do not have: tests of others, which hold where it is there.
    depending: tuple[tuple[str, tuple[Test, ...]], ...] = ()
    #: Zeros at the end of its payload are not sent after so many bytes; None: all are sent.
    trim: int | None = None
    #: The byte between texts, and the bytes that a text does not have.
    separator: bytes = b""
    #: It precedes the first text too.
    leading: bool = False
    barred: bytes = b""
    #: Only its turn tells it: its frame is its payload.
    turned: bool = False
    #: Kinds of frame that carry it, if there are several.
    frames: tuple[str, ...] = ()
    #: Maximum size of a payload in the frame.
    limit: int | None = None

    def values(self) -> Iterator[tuple[str, Value]]:
        """Values in wire order, those of the frame first."""
        yield from self.beside
        yield from values_of(self.slots)

    def by_name(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Values as users see them: of a choice that of its case, under the name of the choice."""
        return {name: given[name] for name, _ in self.beside} | by_choice(self.slots, given)

    @property
    def decided_by(self) -> frozenset[str]:
        """Values of its frame that conditions test."""
        return frozenset(test[0] for slot in self.slots for test in slot.when) & {
            name for name, _ in self.beside
        }

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
        if self.separator:  # absent texts at the end are left out with the separators before them
            first = 0 if self.leading else 1  # of the texts after a separator
            needed = [at for at, slot in enumerate(self.slots) if not slot.optional and slot.texts[0]]
            kept = self.slots[: max(needed, default=-1) + 1]
            separators = sum(slot.texts[0] for slot in kept) - first if kept else 0
            least = sum(slot.texts[0] * slot.text_sizes[0] for slot in kept if not slot.optional)
            most = sum(slot.texts[1] * (slot.text_sizes[1] + 1) for slot in self.slots) - first
            return least + separators, most
        always = [slot for slot in self.slots if not slot.conditional]
        most = most_bytes(self.slots)
        if self.limit is not None and any(slot.walked for slot in self.slots):
            most = min(most, self.limit)
        return sum(slot.least_bytes for slot in always), most

    def allows(self, address: int) -> bool:
        """Whether the address is legal for the message."""
        return not self.addresses or any(low <= address <= high for low, high in self.addresses)
