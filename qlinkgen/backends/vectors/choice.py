"""Selects the raw values of vectors by one rule for each kind of vector."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Mapping
from typing import assert_never

from qlinkgen.model.integer import Integer, unpack_chunks
from qlinkgen.model.types import Characters, Float, Length, Scalar
from qlinkgen.plan.content import Raw, Unsendable, broken, by_value, default_of, pack
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.expr import Clear
from qlinkgen.plan.openings import are_closed
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ConstantStep,
    CountStep,
    FilledStep,
    Holder,
    ItemsStep,
    Member,
    PayloadPlan,
    Presence,
    RecordsStep,
    RecordStep,
    ReservedStep,
    Step,
    ValueStep,
    conditions,
    holders,
    term_of,
)
from qlinkgen.plan.walk import present


class Chance:
    """Reproducible pseudo-random numbers: xorshift64*, seeded with a text (FNV-1a)."""

    def __init__(self, seed: str) -> None:
        """Different texts give different sequences."""
        self._state = 0xCBF29CE484222325
        for byte in seed.encode():
            self._state = (self._state ^ byte) * 0x100000001B3 & _MASK
        self._state |= 1

    def between(self, first: int, last: int) -> int:
        """A number from first to last."""
        self._state ^= self._state >> 12
        self._state ^= self._state << 25 & _MASK
        self._state ^= self._state >> 27
        wide = self._state * 0x2545F4914F6CDD1D & _MASK
        # The high bits are of better quality.
        return first + (wide * (last - first + 1) >> 64)


_MASK = (1 << 64) - 1
_NONE: Mapping[str, Raw] = {}


def _without(barred: bytes) -> bytes | None:
    """The table that replaces each byte that a text does not have by one near it."""
    if not barred:
        return None
    near = next(each for each in (barred[0] ^ flip for flip in range(1, 0x80)) if each not in barred)
    return bytes.maketrans(barred, bytes((near,)) * len(barred))


class Rule:
    """The rule for the values of one kind of vector."""

    def __init__(
        self,
        number: Callable[[Scalar, int], int],
        count: Callable[[Length], int],
        octet: Callable[[int], int],
        pattern: bytes = b"\0",
    ) -> None:
        """``octet`` gets the index of the byte; ``number`` the integer and its bits of the pattern."""
        self._number = number
        self._count = count
        self._octet = octet
        self._pattern = pattern

    def values(self, plan: PayloadPlan, beside: Mapping[str, Raw] = _NONE) -> dict[str, Raw]:
        """The raw values of a payload in a frame with the values ``beside``."""
        found: dict[str, Raw] = {**plan.decided(beside)}
        sent = True
        for step in plan.steps:
            if step.presence is not None:
                sent = self._sends(step.presence, found, sent=sent)
                if not sent:
                    found |= {each.name: None for each in holders((step,))}
                    continue
            found |= self._of(step)
        return by_value(plan, _fitting_frame(plan, found))

    def beside(self, envelope: Envelope) -> dict[str, Raw]:
        """The raw values of a frame; those that it does not have are their defaults."""
        found = {
            member.name: self._chosen(member.number, self._bits(part.integer) >> member.shift)
            for part, member in envelope.values
        }
        for each in envelope.conditional:
            if each.values and not all(test.holds(found[test.value]) for test in each.tests):
                found |= {member.name: member.number.default for member in each.values}
        return {**found}

    def _sends(self, presence: Presence, found: Mapping[str, Raw], *, sent: bool) -> bool:
        """Whether a field that may be absent is sent; an optional one is not if the one before it was not."""
        if presence.optional:
            return sent and self._count(Length(0, 1)) == 1
        return present(presence, {name: raw for name, raw in found.items() if isinstance(raw, int)}, 0)

    def _of(self, step: Step) -> dict[str, Raw]:
        """The raw values of a step."""
        match step:
            case ValueStep():
                return {step.name: self._chosen(step.number, self._bits(step.integer))}
            case BitsStep():
                bits = self._bits(step.integer)
                return {each.name: self._chosen(each.number, bits >> each.shift) for each in step.members}
            case BytesStep():
                mask = 0x7F if step.text else 0xFF
                octets = bytes(self._octet(i) & mask for i in range(self._count(step.length)))
                octets = octets.translate(_without(step.terminator + step.excluded))
                return {step.name: step.stripped(octets)}
            case ItemsStep():
                bits, count = self._bits(step.item), whole(step, self._count(step.length))
                return {step.name: [self._chosen(step.number, bits) for _ in range(count)]}
            case RecordStep():
                return {step.name: self.values(step.record.payload)}
            case RecordsStep():
                count = self._count(step.length)
                records = [self.values(step.record.payload) for _ in range(count)]
                return {step.name: _closed(step, _ended(step, records) if step.last else records)}
            case ConstantStep() | ReservedStep() | CountStep() | FilledStep():
                return {}
            case _:
                assert_never(step)

    def _bits(self, integer: Integer) -> int:
        if not integer.chunks:  # in a row of bits
            return int.from_bytes((self._pattern * 8)[:8], "little")
        return unpack_chunks((self._pattern * integer.size)[: integer.size], integer.chunks)

    def _chosen(self, scalar: Scalar, bits: int) -> int:
        number = self._number(scalar, bits & scalar.integer.mask)
        if isinstance(scalar.meaning, Characters):
            return scalar.meaning.nearest(number)
        for each in conditions(scalar):
            number &= ~each.mask if isinstance(each, Clear) else -1
        return number


def _ended(step: RecordsStep, records: list[dict[str, Raw]]) -> list[dict[str, Raw]]:
    """The records of which only the last one ends an array, as a default one does."""
    usual = defaults(step.record.payload)
    others = [each for each in records[:-1] if not step.ends(each)]
    return [*others, records[-1] if step.ends(records[-1]) else usual]


def _closed(step: RecordsStep, records: list[dict[str, Raw]]) -> list[dict[str, Raw]]:
    """The records with defaults, or without those before the last one that take all bytes which are left."""
    usual = defaults(step.record.payload)
    replaced = [usual] if not step.last and are_closed(step, [usual]) else []
    others = [[each] if are_closed(step, [each]) else replaced for each in records[:-1]]
    return [each for several in others for each in several] + records[-1:]


def _fitting_frame(plan: PayloadPlan, values: dict[str, Raw]) -> dict[str, Raw]:
    """The values by field with fewer or default records, and shorter runs, until a frame can hold them."""
    if not _is_too_long(plan, values):
        return values
    for step in reversed([segment.records for segment in plan.segments if segment.records]):
        records = values[step.name]
        if isinstance(step, RecordsStep) and isinstance(records, list):
            records = _fewer(plan, step, records, values)
            values = {**values, step.name: records}
            if _is_too_long(plan, values):
                values = {**values, step.name: [defaults(step.record.payload) for _ in records]}
        elif isinstance(step, RecordStep) and records is not None and _is_too_long(plan, values):
            values = {**values, step.name: defaults(step.record.payload)}
    walked = [segment.records for segment in plan.segments]
    for run in plan.runs:
        given = values[run.name]
        if run not in walked and isinstance(given, bytes | list) and _is_too_long(plan, values):
            values = {**values, run.name: given[: run.length.minimum]}
    return values


#: The records of an array; a case of a choice may be one of numbers.
_Several = list[int] | list[Mapping[str, Raw]]


def _fewer(plan: PayloadPlan, step: RecordsStep, records: _Several, values: Mapping[str, Raw]) -> _Several:
    """As many of the records as a frame with these values can hold, at least their minimum."""

    def some(count: int) -> _Several:
        return records[-count:] if step.last and count else records[:count]

    # Each trial packs the whole payload, so the number is found by halves.
    counts = range(min(step.length.minimum, len(records)), len(records) + 1)
    fitting = bisect_left(
        counts, 1, key=lambda count: int(_is_too_long(plan, {**values, step.name: some(count)}))
    )
    return some(counts[max(0, fitting - 1)])


def _is_too_long(plan: PayloadPlan, values: Mapping[str, Raw]) -> bool:
    """Whether records of variable size are too many for a frame."""
    if not any(segment.records for segment in plan.segments):
        return False
    try:
        pack(plan, {**plan.decided(values), **by_value(plan, values)})
    except Unsendable:
        return True
    return False


def whole(step: ItemsStep, count: int) -> int:
    """The number of items that a receiver sees of so many."""
    term = term_of(step)
    return term.items_in(term.value(count)) if step.whole else count


def _end(scalar: Scalar, which: int) -> int:
    """The raw minimum or maximum."""
    if not isinstance(scalar.meaning, Float):
        return (scalar.minimum, scalar.maximum)[which]
    return scalar.meaning.raw(float(scalar.span[which]))


def _fitting(scalar: Scalar, pattern: int) -> int:
    """The pattern in as many low bytes as the range allows; the default if it does not fit at all."""
    if isinstance(scalar.meaning, Float):
        return pattern if _is_legal(scalar.meaning, pattern) else scalar.default
    for bits in range(scalar.bits, 0, -8):
        number = scalar.integer.signed_value(pattern & (1 << bits) - 1)
        if scalar.minimum <= number <= scalar.maximum:
            return number
    return scalar.default


def filled(pattern: bytes) -> Rule:
    """The repeated pattern where ranges allow it."""
    return Rule(_fitting, lambda length: length.maximum, lambda index: pattern[index % len(pattern)], pattern)


MINIMUM = Rule(lambda scalar, _: _end(scalar, 0), lambda length: length.minimum, lambda _: 0x00)
MAXIMUM = Rule(lambda scalar, _: _end(scalar, 1), lambda length: length.maximum, lambda _: 0xFF)
A5 = filled(b"\xa5")


def _random(scalar: Scalar, chance: Chance) -> int:
    if not isinstance(scalar.meaning, Float):
        return chance.between(scalar.minimum, scalar.maximum)
    ranges = scalar.meaning.legal
    pattern = chance.between(*ranges[chance.between(0, len(ranges) - 1)])
    return pattern if _is_legal(scalar.meaning, pattern) else scalar.default


def _is_legal(kind: Float, pattern: int) -> bool:
    """Whether a pattern is legal and every target preserves its bits, which it does not for a NaN."""
    number = kind.value(pattern)
    return kind.allows(number) and not math.isnan(number)


def random(chance: Chance) -> Rule:
    """Random legal values."""
    return Rule(
        lambda scalar, _: _random(scalar, chance),
        lambda length: chance.between(length.minimum, length.maximum),
        lambda _: chance.between(0, 0xFF),
    )


def defaults(plan: PayloadPlan) -> dict[str, Raw]:
    """Default values; required items have the default of an item."""
    return by_value(plan, {each.name: _default(each) for each in plan.settable})


def _default(each: Holder) -> Raw:
    match each:
        case _ if each.presence is not None and not each.presence.given:
            return None
        case ItemsStep():
            rules = each.conditions
            items = [each.number.default if broken(rules, item) else item for item in each.default]
            return items + [0] * (whole(each, len(items)) - len(items))
        case RecordStep():
            return defaults(each.record.payload)
        case RecordsStep():
            return [defaults(each.record.payload) for _ in range(each.length.minimum)]
        case ValueStep() | Member() | BytesStep():
            return default_of(each)
        case _:
            assert_never(each)
