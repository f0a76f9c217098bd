"""The payload of a message as steps in wire order.

A step holds the layout of its bytes and their offset. Sizes come first: `Sizing` derives the number of items
of each run of variable size from the size of the payload and the counts in it. Values are decoded only if
sizes are consistent, so a decoder reports `length` before `range`, in any order of fields.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import groupby
from typing import Literal, assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.model.checksum import Checksum
from qlinkgen.model.condition import Test, turning_points
from qlinkgen.model.integer import BitOrder, Integer
from qlinkgen.model.types import (
    Characters,
    Enum,
    Flags,
    Float,
    Length,
    Scalar,
)
from qlinkgen.plan.expr import Clear, Condition, Legible, OneOf, Size, Term, Within


@dataclass(frozen=True, slots=True)
class Place:
    """The offset of a step.

    Attributes:
        front: offset from the beginning of the payload.
        back: distance from the end of the payload, None if a run of variable size follows.
    """

    front: Size
    back: int | None

    @property
    def offset(self) -> int | None:
        """The offset from the beginning if it is constant, else None."""
        return None if self.front.terms else self.front.fixed


@dataclass(frozen=True, slots=True)
class Presence:
    """What decides whether a field is present.

    Attributes:
        field: name of the field.
        when: tests of earlier values, all of which hold; () for an optional field.
        optional: it is present if bytes are left, and sent if the caller gives it.
        given: a new message has it.
        slot: the value of which the field is a case, "" for other fields.
        case: name of the case.
    """

    field: str
    when: tuple[Test, ...]
    optional: bool
    given: bool
    slot: str = ""
    case: str = ""

    @property
    def choosing(self) -> Test:
        """The test that tells the cases of a choice apart; those before it are of the tested value."""
        return self.when[-1]


# Steps ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ValueStep:
    """An integer with a value of the message."""

    name: str
    place: Place
    integer: Integer
    number: Scalar
    presence: Presence | None = None

    @cached_property
    def limits(self) -> tuple[Condition, ...]:
        """Conditions on the integer before it is sent."""
        return limits(self.number)

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """Conditions on the integer on the wire, beyond the limits of its bits."""
        return conditions(self.number)


@dataclass(frozen=True)
class ConstantStep:
    """A constant integer; receivers reject other values."""

    name: str
    place: Place
    integer: Integer
    value: int
    number: Scalar
    presence: Presence | None = None
    #: Other values that receivers accept.
    accepted: tuple[int, ...] = ()

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """Conditions on the integer on the wire."""
        if not self.accepted:
            return (Within(self.value, self.value),)
        return (OneOf(tuple(Within(each, each) for each in sorted((self.value, *self.accepted)))),)


@dataclass(frozen=True)
class ReservedStep:
    """An integer sent as ``value`` and ignored when received."""

    name: str
    place: Place
    integer: Integer
    value: int
    number: Scalar
    presence: Presence | None = None


@dataclass(frozen=True)
class CountStep:
    """The size of ``run``, in items or bytes; filled by the codec.

    Attributes:
        term: the number sent: the number of items, or the size of the run and of fields beside it.
        bounds: minimum and maximum of the number sent.
    """

    name: str
    place: Place
    integer: Integer
    run: str
    term: Term
    bounds: Within
    presence: Presence | None = None
    #: It tells the bytes of records of variable size, not their number, or those of the choice ``run``.
    sized: bool = False
    #: Bytes or items that it counts as one.
    unit: int = 1

    @property
    def scale(self) -> int:
        """Divisor from the number sent to the number of items, which a packed run does not have."""
        assert not self.term.packed
        return self.term.factor

    def items(self, number: int) -> int | None:
        """The number of items that a number within the bounds tells; None if it tells none."""
        if self.term.packed:
            return self.term.items_in(number)
        return None if (number - self.term.more) % self.scale else self.term.items_in(number)


@dataclass(frozen=True, slots=True)
class Equal:
    """The rule of a number derived from another one.

    Attributes:
        source: the layout of the other one.
    """

    source: Integer
    inverted: bool
    added: int

    def compute(self, data: bytes) -> int:
        """The number for the bytes of the other one; it may exceed its bits."""
        number = self.source.unpack(data)
        return (~number if self.inverted else number) + self.added


@dataclass(frozen=True)
class FilledStep:
    """An integer that follows from earlier bytes; filled by the codec.

    Attributes:
        begin: offset of these bytes, counted as in the place of the step.
        end: offset of their end.
        over: the fields that they are.
        rule: how it follows from them: a check value, or a number derived from another.
    """

    name: str
    place: Place
    integer: Integer
    begin: Size
    end: Size
    over: tuple[str, ...]
    rule: Checksum | Equal
    presence: Presence | None = None

    @property
    def fault(self) -> Literal["crc", "range"]:
        """The kind of fault of a wrong one."""
        return "range" if isinstance(self.rule, Equal) else "crc"

    def value(self, data: bytes) -> int:
        """The number for the bytes that it follows from."""
        return self.rule.compute(data) & self.integer.mask


@dataclass(frozen=True)
class Member:
    """Bits with a value of the message."""

    name: str
    shift: int
    bits: int
    number: Scalar
    presence: Presence | None = None

    @cached_property
    def limits(self) -> tuple[Condition, ...]:
        """Conditions on the number before it is sent."""
        return limits(self.number)

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """Conditions on the number, beyond the limits of its bits."""
        return conditions(self.number)

    def of(self, whole: int) -> int:
        """Its raw number in the integer that holds it."""
        integer = self.number.integer
        return integer.signed_value(whole >> self.shift & integer.mask)


@dataclass(frozen=True)
class BitsStep:
    """An integer divided into members; other bits are sent as 0 and ignored when received."""

    name: str
    place: Place
    integer: Integer
    members: tuple[Member, ...]
    presence: Presence | None = None


@dataclass(frozen=True)
class BytesStep:
    """A run of bytes, or of 7-bit characters."""

    name: str
    place: Place
    text: bool
    length: Length
    default: bytes
    #: The byte that fills up a shorter value, which does not end with it; b"" if there is none.
    pad: bytes
    #: Characters that a text between separators, or before a terminator or the end of a frame, does not have.
    excluded: bytes
    #: The character that follows it; b"" if there is none.
    terminator: bytes
    required: bool
    presence: Presence | None = None

    #: Bytes of one item.
    item_size = 1
    #: See ItemsStep.
    packed = None
    #: Suffix for the name of the number of bytes.
    quantity = "size"

    @property
    def fixed(self) -> bool:
        """Whether the number of bytes is constant."""
        return self.length.fixed

    @property
    def least(self) -> int:
        """Minimum number of bytes of the value."""
        return 0 if self.pad else self.length.minimum

    @property
    def barred(self) -> bytes:
        """Characters that it does not have, other than the one that ends it."""
        return bytes(each for each in self.excluded if each not in self.terminator)

    def padded(self, value: bytes) -> bytes:
        """The bytes on the wire of a value."""
        return value.ljust(self.length.maximum, self.pad) if self.pad else value + self.terminator

    def stripped(self, data: bytes) -> bytes:
        """The value of bytes on the wire."""
        return data.rstrip(self.pad) if self.pad else data.removesuffix(self.terminator)


@dataclass(frozen=True)
class ItemsStep:
    """A run of integers, of whole bytes each or, if it is ``packed``, of a few bits in a row."""

    name: str
    place: Place
    item: Integer
    number: Scalar
    length: Length
    default: tuple[int, ...]
    required: bool
    packed: BitOrder | None
    #: Only the request tells the number of items; without it there are as many as fit the bytes.
    whole: bool
    presence: Presence | None = None
    #: The byte between items, each of which is a text; b"" if there is none.
    between: bytes = b""

    #: Suffix for the name of the number of items.
    quantity = "count"

    @property
    def item_size(self) -> int:
        """Bytes of one item, which one that is packed does not have; the maximum of a text."""
        assert not self.packed
        return self.item.size

    @property
    def fixed(self) -> bool:
        """Whether the number of items is constant."""
        return self.length.fixed

    @cached_property
    def limits(self) -> tuple[Condition, ...]:
        """Conditions on each item before it is sent."""
        return limits(self.number)

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """Conditions on each item, beyond the limits of its bits."""
        return conditions(self.number)


@dataclass(frozen=True)
class RecordPlan:
    """A record: its steps, whose places count from its first byte, or from that of their segment.

    Attributes:
        name: its name, which the class or struct of the record is named after.
        payload: its layout.
    """

    name: str
    payload: PayloadPlan

    @property
    def size(self) -> int:
        """Bytes on the wire, if they are constant."""
        return self.payload.most

    @property
    def segments(self) -> tuple[Segment, ...]:
        """How it is walked; one segment if its size is constant."""
        return self.payload.segments or (Segment(self.payload.steps, None, self.payload.most),)


@dataclass(frozen=True)
class RecordStep:
    """One record: a value with the values of its steps."""

    name: str
    place: Place
    record: RecordPlan
    presence: Presence | None = None

    @property
    def required(self) -> bool:
        """Whether the caller must provide it."""
        return self.record.payload.required

    @property
    def walked(self) -> bool:
        """Whether its size varies."""
        return self.record.payload.walked


@dataclass(frozen=True)
class RecordsStep:
    """A run of records."""

    name: str
    place: Place
    record: RecordPlan
    length: Length
    required: bool
    presence: Presence | None = None
    #: The record of which this holds is the last one; () if something else tells the number.
    last: tuple[Test, ...] = ()

    #: See ItemsStep.
    packed = None
    #: Suffix for the name of the number of records.
    quantity = "count"

    @property
    def walked(self) -> bool:
        """Whether its records have to be read one by one to find its end."""
        return self.record.payload.walked or bool(self.last)

    def ends(self, values: Mapping[str, object]) -> bool:
        """Whether a record with these raw values is the last one."""
        numbers = [(test, values[test.value]) for test in self.last]
        return all(isinstance(number, int) and test.holds(number) for test, number in numbers)

    @property
    def item_size(self) -> int:
        """Bytes of one record, which one of variable size does not have."""
        assert not self.record.payload.walked
        return self.record.size

    @property
    def fixed(self) -> bool:
        """Whether the number of records is constant."""
        return self.length.fixed


#: A value that is a number, or a run of bytes or of numbers.
SimpleStep = (
    ValueStep | ConstantStep | ReservedStep | CountStep | FilledStep | BitsStep | BytesStep | ItemsStep
)
RunStep = BytesStep | ItemsStep | RecordsStep
Step = SimpleStep | RecordStep | RecordsStep
#: A step or member with a value of the message.
Holder = ValueStep | Member | RunStep | RecordStep


@dataclass(frozen=True)
class Segment:
    """A part of a walked payload whose size is known when it is reached, unless it has walked records.

    Attributes:
        steps: fields of fixed size that are always present; or one field that may be absent, or a run of
            variable size, or walked records. Their places count from the beginning of the segment.
        presence: what decides whether it is present, None if it always is.
        size: its size if it is present, None for a run of variable size and for walked records.
        rest: size of what follows a run that takes the rest of the payload, None for other segments.
        counted: it is a case of a choice whose bytes a count tells, which it fills.
    """

    steps: tuple[Step, ...]
    presence: Presence | None
    size: int | None
    rest: Size | None = None
    counted: bool = False

    @cached_property
    def settable(self) -> tuple[Holder, ...]:
        """Steps and members with a value of the message, in wire order."""
        return holders(self.steps)

    @property
    def terminator(self) -> bytes:
        """The character that ends its text, b"" for other segments."""
        run = self.run
        return run.terminator if isinstance(run, BytesStep) else b""

    @property
    def slot(self) -> str:
        """The value of which it is a case, "" for other segments."""
        return self.presence.slot if self.presence else ""

    @property
    def run(self) -> RunStep | None:
        """The run of variable size, None for other segments."""
        (step,) = self.steps if self.size is None and self.records is None else (None,)
        return step if isinstance(step, BytesStep | ItemsStep | RecordsStep) else None

    @property
    def records(self) -> RecordStep | RecordsStep | None:
        """The walked records, None for other segments."""
        step = self.steps[0] if len(self.steps) == 1 else None
        return step if isinstance(step, RecordStep | RecordsStep) and step.walked else None


def deciding(segments: Iterable[Segment]) -> tuple[Test, ...]:
    """The tests of values that the size of segments depends on; a count tells that of some choices."""
    return tuple(
        test for each in segments if each.presence and not each.counted for test in each.presence.when
    )


def by_choice(segments: Iterable[Segment]) -> tuple[tuple[Segment, tuple[Segment, ...]], ...]:
    """The segments; those of the cases of a choice once, with the first of them, () for others."""
    found: list[tuple[Segment, tuple[Segment, ...]]] = []
    for slot, group in groupby(segments, lambda each: each.slot):
        own = tuple(group)
        found += [(own[0], own)] if slot else [(each, ()) for each in own]
    return tuple(found)


# Numbers of items -------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Learn:
    """Take the number of items from a count within ``count.bounds``, as ``count.items`` says."""

    count: CountStep


@dataclass(frozen=True, slots=True)
class Compare:
    """Check that a count agrees with the known number of items."""

    count: CountStep


@dataclass(frozen=True, slots=True)
class Infer:
    """Derive the number of items from the size of the payload less ``others``, all its other bytes."""

    run: RunStep
    others: Size


Sizing = Learn | Compare | Infer


@dataclass(frozen=True)
class PayloadPlan:
    """The layout of a payload.

    Attributes:
        steps: in wire order.
        sizing: in order of execution; afterwards the number of items of every run is known, and the payload
            must have the size ``size``.
        size: size of the payload as a function of the counts.
        least: minimum size, without regard to `empty_is_default`.
        most: maximum size.
        empty_is_default: an empty payload means that every field has its default.
        segments: how a payload is walked in which fields may be absent; () for all others. ``sizing`` and
            ``size`` are then empty.
        separator: the byte between the fields, each of which is a text; b"" if there is none. ``sizing``,
            ``size`` and places mean nothing then.
        leading: the separator precedes the first field too, so an empty text comes before it.
        trim: bytes that are sent at least where zeros at the end are not; None if all are sent. ``least``
            is then the minimum size without them.
        decided_by: values of the frame that conditions test. They are legal where a payload is read.
    """

    steps: tuple[Step, ...]
    sizing: tuple[Sizing, ...]
    size: Size
    least: int
    most: int
    empty_is_default: bool
    segments: tuple[Segment, ...] = ()
    separator: bytes = b""
    leading: bool = False
    trim: int | None = None
    decided_by: tuple[Member, ...] = ()

    def trimmed(self, payload: bytes) -> bytes:
        """A payload as sent, without zeros at its end."""
        if self.trim is None:
            return payload
        return payload[: max(len(payload.rstrip(b"\0")), self.trim)]

    def filled(self, payload: bytes) -> bytes:
        """A payload with the zeros at its end that were not sent."""
        return payload if self.trim is None else payload.ljust(self.most, b"\0")

    def decided(self, values: Mapping[str, object]) -> dict[str, int]:
        """Raw values of the frame that conditions test, by name; defaults for those not among ``values``."""
        found = ((each.name, values.get(each.name, each.number.default)) for each in self.decided_by)
        return {name: raw for name, raw in found if isinstance(raw, int)}

    @property
    def filled_in(self) -> tuple[FilledStep, ...]:
        """The numbers that follow from other bytes."""
        return tuple(step for step in self.steps if isinstance(step, FilledStep))

    @property
    def walked(self) -> bool:
        """Whether places of fields depend on earlier values or texts, not on counts alone."""
        return bool(self.segments or self.separator)

    @property
    def by_choice(self) -> tuple[tuple[Segment, tuple[Segment, ...]], ...]:
        """The segments; those of the cases of a choice once, with the first of them, () for others."""
        return by_choice(self.segments)

    @property
    def fixed(self) -> bool:
        """Whether the size is constant."""
        return not self.size.terms and not self.walked

    @cached_property
    def runs(self) -> tuple[RunStep, ...]:
        """Runs of variable size, in wire order."""
        return tuple(
            step
            for step in self.steps
            if isinstance(step, BytesStep | ItemsStep | RecordsStep) and not step.fixed
        )

    def least_of(self, known: Collection[str]) -> Size:
        """Minimum size if the numbers of items of some runs are known; `size` if all are."""
        fixed = sum(least_size(run) for run in self.runs if run.name not in known)
        return Size(self.size.fixed + fixed, tuple(term for term in self.size.terms if term.run in known))

    def sendable(self, run: RunStep) -> Within:
        """Numbers of items that can be sent: at most what each of its counts can hold."""
        counts = [
            step
            for step in self.steps
            if isinstance(step, CountStep) and step.run == run.name and not step.sized
        ]
        most = min([run.length.maximum, *(_countable(each) for each in counts)])
        return Within(run.length.minimum, most)

    @cached_property
    def byte_counts(self) -> tuple[CountStep, ...]:
        """Counts of the bytes of walked records, or of the cases of a choice."""
        return tuple(step for step in self.steps if isinstance(step, CountStep) and step.sized)

    def counted(self, name: str) -> tuple[Segment, ...]:
        """The segments of what a count tells the bytes of: records, or the cases of a choice."""
        return tuple(each for each in self.segments if name in (each.slot, each.steps[0].name))

    def run(self, name: str) -> RunStep:
        """The run with a name, of fixed or variable size."""
        return next(
            step
            for step in self.steps
            if isinstance(step, BytesStep | ItemsStep | RecordsStep) and step.name == name
        )

    @property
    def required(self) -> bool:
        """Whether a value has no default."""
        return any(is_required(each) for each in self.settable)

    @property
    def records(self) -> tuple[RecordPlan, ...]:
        """The records in it, each before those that contain it."""
        found: dict[str, RecordPlan] = {}
        for step in self.steps:
            if isinstance(step, RecordStep | RecordsStep):
                inner = (*step.record.payload.records, step.record)
                found |= {each.name: each for each in inner}
        return tuple(found.values())

    @cached_property
    def settable(self) -> tuple[Holder, ...]:
        """Steps and members with a value of the message, in wire order."""
        return holders(self.steps)


def holders(steps: Iterable[Step]) -> tuple[Holder, ...]:
    """Steps and members with a value, in wire order."""
    found: list[Holder] = []
    for step in steps:
        match step:
            case ValueStep() | BytesStep() | ItemsStep() | RecordStep() | RecordsStep():
                found.append(step)
            case BitsStep():
                found += step.members
            case ConstantStep() | ReservedStep() | CountStep() | FilledStep():
                pass
            case _:
                assert_never(step)
    return tuple(found)


def complete(cases: Iterable[Segment]) -> bool:
    """Whether one of the cases of a choice applies to every number, which is always there."""
    presences = [each.presence for each in cases if each.presence]
    tests = [each.choosing for each in presences]
    always = all(len(each.when) == 1 for each in presences)
    return always and all(any(test.holds(raw) for test in tests) for raw in turning_points(tests))


def by_slot(each: Iterable[Holder]) -> tuple[tuple[Holder, ...], ...]:
    """Steps and members by their value: the cases of a choice together."""
    found: dict[str, list[Holder]] = {}
    for one in each:
        found.setdefault(value_name(one), []).append(one)
    return tuple(map(tuple, found.values()))


def first_case(slot: Sequence[Holder]) -> Holder:
    """The case that a new message has, the first one if it has none of them."""
    return next((each for each in slot if each.presence is None or each.presence.given), slot[0])


def value_name(each: Holder | Step) -> str:
    """The name of the value: of a case, that of the whole choice."""
    return (each.presence and each.presence.slot) or each.name


def full_size(step: Step) -> int:
    """Size of a step of constant size, if it is present; the maximum of walked records."""
    if isinstance(step, RecordsStep) and step.walked:
        return step.length.maximum * step.record.payload.most
    if isinstance(step, RecordStep) and step.walked:
        return step.record.payload.most
    return term_of(step).value(step.length.maximum) if isinstance(step, RunStep) else least_size(step)


def least_size(step: Step) -> int:
    """Minimum size of a step, if it is present."""
    match step:
        case ValueStep() | ConstantStep() | ReservedStep() | CountStep() | FilledStep() | BitsStep():
            return step.integer.size
        case BytesStep() | ItemsStep():
            return term_of(step).value(step.length.minimum)
        case RecordsStep():
            return step.length.minimum * step.record.payload.least
        case RecordStep():
            return step.record.payload.least
        case _:
            assert_never(step)


def is_required(each: Holder) -> bool:
    """Whether the caller must provide the value: it has no default, or only an illegal one."""
    if each.presence is not None:
        return False
    match each:
        case ValueStep() | Member():
            return each.number.required
        case BytesStep() | ItemsStep() | RecordStep() | RecordsStep():
            return each.required
        case _:
            assert_never(each)


def term_of(run: RunStep) -> Term:
    """The size of a run."""
    if run.packed:
        return Term(run.name, run.item.bits, packed=True)
    return Term(run.name, run.item_size)


def _countable(count: CountStep) -> int:
    """The maximum number of items that a count can tell."""
    term, most = count.term, count.integer.maximum
    return term.items_in(most)


def conditions(number: Scalar) -> tuple[Condition, ...]:
    """Conditions on a received number, beyond the limits of its bits."""
    known = number.full_range and not isinstance(number.meaning, Characters)
    return limits(number)[1:] if known else limits(number)


def limits(number: Scalar) -> tuple[Condition, ...]:
    """Conditions on an integer before it is sent."""
    found: list[Condition] = [Within(number.minimum, number.maximum)]
    meaning = number.meaning
    match meaning:
        case Characters():
            return (Legible(meaning),)
        case Flags() if meaning.reserved_zero and (mask := number.integer.mask & ~meaning.mask):
            found.append(Clear(mask))
        case Float() if meaning.bounds is not None:
            found.append(OneOf(tuple(Within(*each) for each in meaning.legal)))
        case Flags() | Enum() | Float() | "bool" | None:
            pass
        case _:
            assert_never(meaning)
    return tuple(found)


def all_records(payloads: Iterable[PayloadPlan]) -> tuple[RecordPlan, ...]:
    """The records in several payloads, each before those that contain it."""
    found = {each.name: each for payload in payloads for each in payload.records}
    return tuple(found.values())


def nested(depth: int) -> str:
    """The suffix of the locals of a record so deep inside of others; no name of a schema has a capital."""
    return f"_R{depth}"


def renamed(segments: Iterable[Segment], suffix: str) -> tuple[Segment, ...]:
    """Segments whose steps have a suffix, for the locals of records inside of others."""
    return tuple(
        replace(
            each,
            steps=tuple(_renamed(step, suffix) for step in each.steps),
            presence=each.presence and _renamed_presence(each.presence, suffix),
        )
        for each in segments
    )


def renamed_tests(tests: Iterable[Test], suffix: str) -> tuple[Test, ...]:
    """Tests of steps that have a suffix."""
    return tuple(replace(test, value=test.value + suffix) for test in tests)


def _renamed_presence(presence: Presence, suffix: str) -> Presence:
    slot = presence.slot and presence.slot + suffix
    return replace(presence, when=renamed_tests(presence.when, suffix), slot=slot)


def _renamed(step: Step, suffix: str) -> Step:
    if isinstance(step, CountStep):
        run = step.run + suffix
        return replace(step, name=step.name + suffix, run=run, term=replace(step.term, run=run))
    if isinstance(step, BitsStep):
        members = tuple(replace(each, name=each.name + suffix) for each in step.members)
        return replace(step, name=step.name + suffix, members=members)
    return replace(step, name=step.name + suffix)
