"""Walks a payload in which the places of fields depend on values: segment by segment, in wire order.

A segment is read in one pass: its size is checked first, then its values in wire order, a count last of all
by what it counts; so an illegal value is found before missing bytes of a later segment. Records of variable
size are walked one after the other in the same way. Bytes after the last segment are a wrong size.
"""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterator, Mapping
from typing import TypeVar, assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.model.condition import Test
from qlinkgen.plan.expr import Size
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ConstantStep,
    CountStep,
    FilledStep,
    Holder,
    ItemsStep,
    PayloadPlan,
    Presence,
    RecordsStep,
    RecordStep,
    ReservedStep,
    Segment,
    Step,
    ValueStep,
    by_choice,
    deciding,
    full_size,
    value_name,
)

T = TypeVar("T")
_NONE: Mapping[str, int] = {}


class Wrong(ValueError):
    """A size that a walked payload cannot have.

    Attributes:
        field: the field that is missing or counted wrong, "" if bytes are left.
        at: its offset.
        steps: those of the segment that is cut short.
        inside: the record that they are inside of, as a path that ends with a dot.
    """

    def __init__(self, field: str, at: int, steps: tuple[Step, ...] = ()) -> None:
        """Set the attributes."""
        super().__init__(field, at)
        self.field = field
        self.at = at
        self.steps = steps
        self.inside = ""

    @property
    def path(self) -> str:
        """The field with the record that it is inside of."""
        return self.inside + self.field if self.field else ""


class Missing(Exception):
    """More bytes are needed; ``end`` is the offset after the field that decides how many."""

    def __init__(self, end: int) -> None:
        """Set the attribute."""
        super().__init__(end)
        self.end = end


def present(presence: Presence | None, numbers: Mapping[str, int], left: int) -> bool:
    """Whether a segment is present after these numbers, before ``left`` bytes."""
    if presence is None:
        return True
    if presence.optional:
        return left > 0
    return all(test.value in numbers and test.holds(numbers[test.value]) for test in presence.when)


def of_values(plan: PayloadPlan, values: Mapping[str, T]) -> dict[str, tuple[Holder, T]]:
    """The raw values of a payload, each with its step or member; of a choice the case that is present.

    Of a choice without a case that is present, the first one.
    """
    own = {name: value for name, value in values.items() if isinstance(value, int)}
    numbers: Mapping[str, int] = {**plan.decided(values), **own}
    found: dict[str, tuple[Holder, T]] = {}
    for each in plan.settable:
        name, presence = value_name(each), each.presence
        if name not in found or (presence and present(presence, numbers, 0)):
            found[name] = (each, values[name])
    return found


@dataclass(frozen=True, slots=True)
class Extent:
    """What is known of walked records before they are read.

    Attributes:
        number: their number, None if they fill their bytes; the maximum if the last one tells.
        limit: the offset that they may extend to.
        exact: they end there.
    """

    number: int | None
    limit: int
    exact: bool


class Walk:
    """The state of a walk: what has been learned from earlier segments.

    Attributes:
        numbers: raw values that conditions test.
        counts: numbers of items of runs, as far as they have counts.
    """

    def __init__(
        self,
        segments: Collection[Segment],
        last: Collection[Test] = (),
        *,
        known: Mapping[str, int] = _NONE,
        measuring: bool = False,
    ) -> None:
        """Begin at the first segment; ``last`` tests values of the record.

        ``known`` are raw values of the frame; ``measuring``: sizes alone matter.
        """
        tests = [test for each in segments if each.presence for test in each.presence.when]
        tests = list(deciding(segments)) if measuring else tests
        self._tested = {test.value for test in (*tests, *last)}
        self._last = tuple(last)
        self._sizes: dict[str, int] = {}
        self.numbers: dict[str, int] = dict(known)
        self.counts: dict[str, int] = {}

    def size(self, segment: Segment, at: int, left: int) -> int:
        """The size of a segment that is present at ``at`` before ``left`` bytes. Raises Wrong."""
        name = value_name(segment.steps[0])
        if segment.size is not None:
            if left < segment.size:
                raise Wrong(name, at, segment.steps)
            return segment.size
        run = segment.run
        assert run is not None
        if segment.terminator:
            raise AssertionError(f"the bytes tell the size of {run.name}")
        if segment.rest is None:
            size = self.counts[run.name] * run.item_size
            if left < size:
                raise Wrong(name, at, segment.steps)
            return size
        size = left - segment.rest.value(self.counts)
        count, odd = divmod(size, run.item_size)
        if odd or not run.length.minimum <= count <= run.length.maximum:
            raise Wrong(name, at, segment.steps)
        return size

    def end(self, slot: str, at: int, end: int) -> int:
        """The offset of the end of a choice whose bytes a count tells. Raises Wrong."""
        limit = at + self._sizes[slot]
        if limit > end:
            raise Wrong(slot, at)
        return limit

    def extent(self, segment: Segment, step: RecordStep | RecordsStep, at: int, end: int) -> Extent:
        """What is known of walked records at ``at`` before they are read. Raises Wrong."""
        if isinstance(step, RecordStep):
            return Extent(1, end, exact=False)
        if step.last or step.fixed:
            return Extent(step.length.maximum, end, exact=False)
        number, size = self.counts.get(step.name), self._sizes.get(step.name)
        if segment.rest is None and size is None:
            return Extent(number, end, exact=False)
        limit = at + size if size is not None else end - (segment.rest or Size()).value(self.counts)
        if not at <= limit <= end:
            raise Wrong(value_name(step), at)
        return Extent(number, limit, exact=True)

    @property
    def last(self) -> bool:
        """Whether the record ends its array."""
        numbers = self.numbers
        return bool(self._last) and all(
            test.value in numbers and test.holds(numbers[test.value]) for test in self._last
        )

    def learn(self, step: Step, data: bytes, at: int) -> None:
        """Note the numbers of a step at ``at`` that later segments need. Raises Wrong for a wrong count."""
        match step:
            case ValueStep():
                self._note(step.name, step.integer.unpack(data))
            case BitsStep():
                whole = step.integer.unpack(data)
                for member in step.members:
                    self._note(member.name, member.of(whole))
            case CountStep():
                self._count(step, step.integer.unpack(data), at)
            case ConstantStep() | ReservedStep() | FilledStep() | BytesStep() | ItemsStep():
                pass
            case RecordStep() | RecordsStep():
                pass
            case _:
                assert_never(step)

    def _note(self, name: str, number: int) -> None:
        if name in self._tested:
            self.numbers[name] = number

    def _count(self, step: CountStep, number: int, at: int) -> None:
        if step.sized:
            size = self._sizes.setdefault(step.run, number - step.term.more)
            if size != number - step.term.more or not step.bounds.holds(number):
                raise Wrong(step.name, at)
            return
        if step.run in self.counts:
            if number != step.term.value(self.counts[step.run]):
                raise Wrong(step.name, at)
        elif (items := step.items(number)) is None or not step.bounds.holds(number):
            raise Wrong(step.name, at)
        else:
            self.counts[step.run] = items

    def decides(self, step: Step) -> bool:
        """Whether later sizes depend on the step."""
        match step:
            case ValueStep():
                return step.name in self._tested
            case BitsStep():
                return any(member.name in self._tested for member in step.members)
            case CountStep():
                return step.run not in (self._sizes if step.sized else self.counts)
            case ConstantStep() | ReservedStep() | FilledStep() | BytesStep() | ItemsStep():
                return False
            case RecordStep() | RecordsStep():
                return False
            case _:
                assert_never(step)


#: Walked records inside each other: names, with indices in an array.
Inside = tuple[tuple[str, int | None], ...]
Walkable = RecordStep | RecordsStep


@dataclass(frozen=True, slots=True)
class Visit:
    """A step in a payload.

    Attributes:
        step: the step.
        at: its offset, or that of the next step if it is absent.
        data: its bytes, None if it is absent.
        inside: the walked records that it is inside of: names, with indices in an array.
    """

    step: Step
    at: int
    data: bytes | None
    inside: Inside = ()

    @property
    def walked(self) -> bool:
        """Whether its records have been visited before."""
        return isinstance(self.step, RecordStep | RecordsStep) and self.step.walked

    @property
    def prefix(self) -> str:
        """What it is inside of, as a path."""
        return "".join(map(inner_path, self.inside))


def inner_path(place: tuple[str, int | None]) -> str:
    """A record as the beginning of a path: ``options[2].``."""
    name, index = place
    return f"{name}." if index is None else f"{name}[{index}]."


def visit(plan: PayloadPlan, payload: bytes, beside: Mapping[str, object] = _NONE) -> Iterator[Visit]:
    """The steps of a payload, each before its value is used to find later ones. Raises Wrong.

    Walked records come after the steps in them. ``beside`` are raw values of the frame.
    """
    walk = Walk(plan.segments, known=plan.decided(beside))
    at = yield from _Visitor(payload).fields(plan.segments, walk, 0, len(payload))
    if at != len(payload):
        raise Wrong("", at)


def _terminated(segment: Segment, payload: bytes, at: int, end: int) -> int:
    """The size of a text with its terminator, which is before ``end``. Raises Wrong."""
    run = segment.run
    assert run is not None
    count = payload[at : min(end, at + run.length.maximum + 1)].find(segment.terminator)
    if count < run.length.minimum:
        raise Wrong(value_name(run), at, segment.steps)
    return count + 1


#: The steps of a part of the payload; returns the offset of its end.
_Visits = Generator[Visit, None, int]


class _Visitor:
    """Visits the steps of one payload."""

    def __init__(self, payload: bytes) -> None:
        self._payload = payload
        self._inside: Inside = ()

    def fields(self, segments: Collection[Segment], walk: Walk, at: int, end: int) -> _Visits:
        """The steps of a message or record that begins at ``at`` and ends at ``end`` at the latest."""
        for segment, cases in by_choice(segments):
            if not segment.counted:
                for each in cases or (segment,):
                    at = yield from self._segment(each, walk, at, end)
                continue
            limit = walk.end(segment.slot, at, end)
            for each in cases:
                at = yield from self._segment(each, walk, at, limit)
            if at != limit:
                raise Wrong(segment.slot, at)
        return at

    def _segment(self, segment: Segment, walk: Walk, at: int, end: int) -> _Visits:
        if not present(segment.presence, walk.numbers, end - at):
            yield from (Visit(step, at, None, self._inside) for step in segment.steps)
            return at
        if segment.records is not None:
            return (yield from self._records(segment, segment.records, walk, at, end))
        if segment.terminator:
            size = _terminated(segment, self._payload, at, end)
        else:
            size = walk.size(segment, at, end - at)
        for step in segment.steps:
            begin = at + step.place.front.fixed
            data = self._payload[begin : begin + (size if segment.size is None else full_size(step))]
            yield Visit(step, begin, data, self._inside)
            walk.learn(step, data, begin)
        return at + size

    def _records(self, segment: Segment, step: Walkable, walk: Walk, at: int, end: int) -> _Visits:
        begin, index, ended = at, 0, False
        extent = walk.extent(segment, step, at, end)
        while not ended and (at < extent.limit if extent.number is None else index < extent.number):
            if isinstance(step, RecordsStep) and index == step.length.maximum:
                raise Wrong(value_name(step), at)
            own = Walk(step.record.segments, step.last if isinstance(step, RecordsStep) else ())
            place = (value_name(step), index if isinstance(step, RecordsStep) else None)
            self._inside = (*self._inside, place)
            try:
                at = yield from self.fields(step.record.segments, own, at, extent.limit)
            except Wrong as wrong:
                wrong.inside = inner_path(place) + wrong.inside
                raise
            self._inside = self._inside[:-1]
            index, ended = index + 1, own.last
        if isinstance(step, RecordsStep) and (
            index < step.length.minimum or (extent.exact and at != extent.limit) or ended != bool(step.last)
        ):
            raise Wrong(value_name(step), at)
        yield Visit(step, begin, self._payload[begin:at], self._inside)
        return at


def measure(plan: PayloadPlan, start: bytes) -> int:
    """The size of the payload that begins with ``start``. Raises Missing, or Wrong for a wrong count."""
    return _measured(plan.segments, Walk(plan.segments, measuring=True), start, 0)


def _measured(segments: Collection[Segment], walk: Walk, start: bytes, at: int) -> int:
    """The offset of the end of a message or record that begins at ``at``."""
    for segment, cases in by_choice(segments):
        if segment.counted:
            at = walk.end(segment.slot, at, 1 << 32)
            continue
        for each in cases or (segment,):
            at = _measured_segment(each, walk, start, at)
    return at


def _measured_segment(segment: Segment, walk: Walk, start: bytes, at: int) -> int:
    if not present(segment.presence, walk.numbers, 1):
        return at
    if segment.records is not None:
        return _measured_records(segment, segment.records, walk, start, at)
    for step in segment.steps:
        if walk.decides(step):
            assert isinstance(step, ValueStep | BitsStep | CountStep)
            begin = at + step.place.front.fixed
            end = begin + step.integer.size
            if len(start) < end:
                raise Missing(end)
            walk.learn(step, start[begin:end], begin)
    if segment.terminator:
        return at + _sought(segment, start, at)
    return at + walk.size(segment, at, 1 << 32)


def _sought(segment: Segment, start: bytes, at: int) -> int:
    """The size of bytes with their terminator, which may be missing yet. Raises Missing or Wrong."""
    run = segment.run
    assert run is not None
    count = start[at : at + run.length.maximum + 1].find(segment.terminator)
    if count < 0 and len(start) <= at + run.length.maximum:
        raise Missing(max(len(start), at) + 1)
    if count < run.length.minimum:
        raise Wrong(value_name(run), at, segment.steps)
    return count + 1


def _measured_records(segment: Segment, step: Walkable, walk: Walk, start: bytes, at: int) -> int:
    extent = walk.extent(segment, step, at, 1 << 32)
    if extent.exact:
        return extent.limit
    for _ in range(extent.number or 0):
        last = step.last if isinstance(step, RecordsStep) else ()
        own = Walk(step.record.segments, last, measuring=True)
        at = _measured(step.record.segments, own, start, at)
        if own.last:
            return at
    if isinstance(step, RecordsStep) and step.last:
        raise Wrong(step.name, at)
    return at
