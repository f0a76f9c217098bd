"""Plans the payload of a message, and records, from their fields."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import assert_never

from qlinkgen.model.checksum import Checksum
from qlinkgen.model.fields import Field, FieldType, Layout, Record, Records, greatest_size
from qlinkgen.model.message import Message
from qlinkgen.model.types import (
    Array,
    BitField,
    Bits,
    Blob,
    Checked,
    Constant,
    Count,
    Derived,
    Length,
    Reserved,
    Scalar,
    Settable,
)
from qlinkgen.plan.expr import Size, Term, Within
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    Compare,
    ConstantStep,
    CountStep,
    Equal,
    FilledStep,
    Infer,
    ItemsStep,
    Learn,
    Member,
    PayloadPlan,
    Place,
    Presence,
    RecordPlan,
    RecordsStep,
    RecordStep,
    ReservedStep,
    Segment,
    Sizing,
    Step,
    ValueStep,
)


def payload_plan(message: Message, trim: int | None = None, beside: Iterable[Member] = ()) -> PayloadPlan:
    """Plan the payload of a message; see `PayloadPlan` for ``trim``. ``beside`` are values of its frame."""
    if message.separator:
        return _Planner(message.fields).separated(message)
    plan = _Planner(message.fields, message.limit).plan(empty_is_default=message.empty_is_default)
    if message.decided_by:
        names = {value.name for value in message.decided_by}
        plan = replace(plan, decided_by=tuple(each for each in beside if each.name in names))
    return plan if trim is None else replace(plan, trim=trim, least=min(trim, plan.most))


def record_plan(layout: Layout) -> RecordPlan:
    """Plan a record."""
    planner = _Planner(layout.fields)
    return RecordPlan(layout.name, planner.plan() if layout.fixed else planner.walked())


class _Planner:
    """Walks the fields of one message or record."""

    def __init__(self, fields: tuple[Field, ...], limit: int | None = None) -> None:
        """``limit`` is the maximum size of all fields together, if it is less than their sizes allow."""
        self._all = fields
        self._limit = limit
        self._fields = {field.name: field for field in fields}
        #: Offsets of the fields so far and of their ends; those of a segment in a walked payload.
        self._spans: dict[str, tuple[Size, Size]] = {}

    def plan(self, *, empty_is_default: bool = False) -> PayloadPlan:
        """The plan of the fields."""
        if any(field.conditional or field.terminated or field.walked for field in self._all):
            return self.walked()
        front, steps = Size(), []
        for field, back in zip(self._all, self._backs(), strict=True):
            steps.append(self._step(field, Place(front, back)))
            end = front + field.max_size if field.fixed else front.plus(_term(field.name, field.type))
            self._spans[field.name] = (front, end)
            front = end
        return PayloadPlan(
            steps=tuple(steps),
            sizing=tuple(self._sizing(steps, front)),
            size=front,
            least=sum(field.min_size for field in self._all),
            most=sum(field.max_size for field in self._all),
            empty_is_default=empty_is_default,
        )

    def _backs(self) -> list[int | None]:
        """The distance of each field from the end, None where the size of what follows varies."""
        found: list[int | None] = []
        left: int | None = 0
        for field in reversed(self._all):
            left = left + field.max_size if left is not None and field.fixed else None
            found.append(left)
        return found[::-1]

    def separated(self, message: Message) -> PayloadPlan:
        """Texts between separators."""
        steps = [_present(self._step(field, Place(Size(), None)), _presence(field)) for field in self._all]
        return PayloadPlan(
            steps=tuple(steps),
            sizing=(),
            size=Size(),
            least=message.min_size,
            most=message.max_size,
            empty_is_default=False,
            separator=message.separator,
            leading=message.leading,
        )

    def walked(self) -> PayloadPlan:
        """The plan of fields whose places vary."""
        segments = tuple(self._segments())
        most = greatest_size(self._all)
        return PayloadPlan(
            steps=tuple(step for segment in segments for step in segment.steps),
            sizing=(),
            size=Size(),
            least=sum(field.min_size for field in self._all),
            most=most if self._limit is None else min(most, self._limit),
            empty_is_default=False,
            segments=segments,
        )

    def _segments(self) -> Iterator[Segment]:
        """Consecutive fields of fixed size that are always present share a segment."""
        steps: list[Step] = []
        size = 0
        for index, field in enumerate(self._all):
            if field.fixed:
                steps.append(self._step(field, Place(Size(size), None)))
                self._spans[field.name] = (Size(size), Size(size + field.max_size))
                size += field.max_size
                continue
            if steps:
                yield Segment(tuple(steps), None, size)
                steps, size = [], 0
            yield self._own_segment(field, self._all[index + 1 :])
        if steps:
            yield Segment(tuple(steps), None, size)

    def _own_segment(self, field: Field, after: tuple[Field, ...]) -> Segment:
        presence = _presence(field)
        step = _present(self._step(field, Place(Size(), None)), presence)
        kind = field.type
        counted = bool(field.slot) and any(_counts(each) == field.slot for each in self._all)
        if isinstance(kind, Record) and field.walked:
            return Segment((step,), presence, None, counted=counted)
        if not isinstance(kind, Blob | Array | Records) or (kind.length.fixed and not field.walked):
            return Segment((step,), presence, field.max_size, counted=counted)
        if field.terminated:
            return Segment((step,), presence, None, counted=counted)
        if counted and not (isinstance(kind, Records) and (kind.last or kind.length.fixed)):
            return Segment((step,), presence, None, Size(), counted=True)
        # A field after the rest that may be absent is absent where the rest is present.
        always = tuple(each for each in after if not each.conditional)
        ends = kind.length.counted_by or kind.length.fixed or (isinstance(kind, Records) and kind.last)
        return Segment((step,), presence, None, None if ends else _size_of(always), counted=counted)

    def _step(self, field: Field, place: Place) -> Step:
        kind = field.type
        match kind:
            case Scalar():
                return self._integer(field.name, kind, place)
            case Bits():
                return BitsStep(field.name, place, kind.container.integer, tuple(map(_member, kind.members)))
            case Blob():
                return BytesStep(
                    field.name,
                    place,
                    kind.text,
                    kind.length,
                    kind.default,
                    kind.pad,
                    kind.excluded,
                    kind.terminator,
                    kind.required,
                )
            case Array():
                return ItemsStep(
                    field.name, place, kind.item.integer, kind.item, kind.length, kind.default, kind.required,
                    kind.packed, kind.whole, between=kind.between,
                )  # fmt: skip
            case Record():
                return RecordStep(field.name, place, record_plan(kind.layout))
            case Records():
                return RecordsStep(
                    field.name, place, record_plan(kind.layout), kind.length, kind.required, last=kind.last
                )
            case _:
                assert_never(kind)

    def _integer(self, name: str, scalar: Scalar, place: Place) -> Step:
        match scalar.role:
            case Settable():
                return ValueStep(name, place, scalar.integer, scalar)
            case Constant(accepted):
                return ConstantStep(name, place, scalar.integer, scalar.default, scalar, accepted=accepted)
            case Reserved():
                return ReservedStep(name, place, scalar.integer, scalar.default, scalar)
            case Count(run, _, beside) if run not in self._fields:
                return self._choice_count(name, scalar, place, run, beside)
            case Count(run, unit, beside, scale, offset):
                counted = self._fields[run].type
                assert isinstance(counted, Blob | Array | Records)
                term = _term(run, counted) if unit == "bytes" else Term(run, 1)
                more = sum(self._fields[each].max_size for each in beside)
                # Lint has checked that all of them are multiples of the scale.
                term = replace(term, factor=term.factor // scale, more=(more - offset) // scale)
                bounds = Within(term.value(counted.length.minimum), term.value(counted.length.maximum))
                sized = unit == "bytes" and self._fields[run].walked
                if sized:
                    least, most = self._fields[run].full_min_size, self._fields[run].max_size
                    most = most if self._limit is None else min(most, self._limit)
                    bounds = Within(more + least, min(scalar.integer.maximum, more + most))
                return CountStep(name, place, scalar.integer, run, term, bounds, sized=sized, unit=scale)
            case Checked(algorithm, first, last):
                return self._filled(name, scalar, place, (first, last), algorithm)
            case Derived(of, inverted, added):
                kind = self._fields[of].type
                assert isinstance(kind, Scalar | Bits)
                source = (kind.container if isinstance(kind, Bits) else kind).integer
                return self._filled(name, scalar, place, (of, of), Equal(source, inverted, added))
            case _:
                assert_never(scalar.role)

    def _filled(
        self, name: str, scalar: Scalar, place: Place, over: tuple[str, str], rule: Checksum | Equal
    ) -> FilledStep:
        names, first, last = list(self._fields), *over
        covered = tuple(names[names.index(first) : names.index(last) + 1])
        begin, end = self._spans[first][0], self._spans[last][1]
        return FilledStep(name, place, scalar.integer, begin, end, covered, rule)

    def _choice_count(
        self, name: str, scalar: Scalar, place: Place, slot: str, beside: tuple[str, ...]
    ) -> CountStep:
        """A count of the bytes of a choice."""
        more = sum(self._fields[each].max_size for each in beside)
        most = greatest_size(each for each in self._all if each.slot == slot)
        most = most if self._limit is None else min(most, self._limit)
        bounds = Within(more, min(scalar.integer.maximum, more + most))
        return CountStep(name, place, scalar.integer, slot, Term(slot, 1, more=more), bounds, sized=True)

    def _sizing(self, steps: list[Step], size: Size) -> Iterator[Sizing]:
        """In wire order: the count of a run precedes it, and lint rejects a count after an uncounted run."""
        for step in steps:
            match step:
                case CountStep():
                    length = self._length(step.run)
                    learns = not length.fixed and length.counted_by == step.name
                    yield Learn(step) if learns else Compare(step)
                case BytesStep() | ItemsStep() | RecordsStep():
                    if not step.fixed and not step.length.counted_by:
                        others = Size(size.fixed, tuple(term for term in size.terms if term.run != step.name))
                        yield Infer(step, others)
                case ValueStep() | ConstantStep() | ReservedStep() | FilledStep() | BitsStep() | RecordStep():
                    pass
                case _:
                    assert_never(step)

    def _length(self, run: str) -> Length:
        kind = self._fields[run].type
        assert isinstance(kind, Blob | Array | Records)
        return kind.length


def _counts(field: Field) -> str:
    """What a field counts, "" if it is not a count."""
    kind = field.type
    return kind.role.run if isinstance(kind, Scalar) and isinstance(kind.role, Count) else ""


def _size_of(fields: Iterable[Field]) -> Size:
    """The size of fields that are always present."""
    size = Size()
    for field in fields:
        size = size + field.max_size if field.fixed else size.plus(_term(field.name, field.type))
    return size


def _presence(field: Field) -> Presence | None:
    """What decides whether a field is present, None if it always is."""
    if not field.conditional:
        return None
    return Presence(field.name, field.when, field.optional, field.given, field.slot, field.case)


def _present(step: Step, presence: Presence | None) -> Step:
    """The step of a field that may be absent."""
    if isinstance(step, BitsStep):
        members = tuple(replace(each, presence=presence) for each in step.members)
        step = replace(step, members=members)
    return replace(step, presence=presence)


def _member(member: BitField) -> Member:
    return Member(member.name, member.shift, member.type.bits, member.type)


def _term(name: str, kind: FieldType) -> Term:
    """The size of a field of variable size."""
    match kind:
        case Array(packed=None):
            return Term(name, kind.item.size)
        case Array():
            return Term(name, kind.item.bits, packed=True)
        case Records():
            return Term(name, kind.layout.size if kind.layout.fixed else 1)
        case Blob():
            return Term(name, 1)
        case Scalar() | Bits() | Record():
            raise AssertionError(f"{name} has a constant size")
        case _:
            assert_never(kind)
