"""Walks a payload in which fields may be absent: segment by segment, in wire order.

A segment is read in one pass: its size is checked first, then its values in wire order, a count last of all
by what it counts; so an illegal value is found before missing bytes of a later segment. Bytes after the last
segment are a wrong size.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import assert_never

from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ConstantStep,
    CountStep,
    ItemsStep,
    PayloadPlan,
    Presence,
    RecordsStep,
    RecordStep,
    ReservedStep,
    Segment,
    Step,
    ValueStep,
    full_size,
)


class Wrong(ValueError):
    """A size that a walked payload cannot have.

    Attributes:
        field: the field that is missing or counted wrong, "" if bytes are left.
        at: its offset.
        steps: those of the segment that is cut short.
    """

    def __init__(self, field: str, at: int, steps: tuple[Step, ...] = ()) -> None:
        """Set the attributes."""
        super().__init__(field, at)
        self.field = field
        self.at = at
        self.steps = steps


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
    return all(test.holds(numbers[test.value]) for test in presence.when)


class Walk:
    """The state of a walk: what has been learned from earlier segments.

    Attributes:
        numbers: raw values that conditions test.
        counts: numbers of items of runs, as far as they have counts.
    """

    def __init__(self, plan: PayloadPlan) -> None:
        """Begin at the first segment."""
        self._tested = {test.value for each in plan.segments if each.presence for test in each.presence.when}
        self.numbers: dict[str, int] = {}
        self.counts: dict[str, int] = {}

    def size(self, segment: Segment, at: int, left: int) -> int:
        """The size of a segment that is present at ``at`` before ``left`` bytes. Raises Wrong."""
        if segment.size is not None:
            if left < segment.size:
                raise Wrong(segment.steps[0].name, at, segment.steps)
            return segment.size
        run = segment.run
        assert run is not None
        if segment.terminator:
            raise AssertionError(f"the bytes tell the size of {run.name}")
        if segment.rest is None:
            size = self.counts[run.name] * run.item_size
            if left < size:
                raise Wrong(run.name, at, segment.steps)
            return size
        size = left - segment.rest.value(self.counts)
        count, odd = divmod(size, run.item_size)
        if odd or not run.length.minimum <= count <= run.length.maximum:
            raise Wrong(run.name, at, segment.steps)
        return size

    def learn(self, step: Step, data: bytes, at: int) -> None:
        """Note the numbers of a step at ``at`` that later segments need. Raises Wrong for a wrong count."""
        match step:
            case ValueStep():
                self._note(step.name, step.integer.unpack(data))
            case BitsStep():
                whole = step.integer.unpack(data)
                for member in step.members:
                    integer = member.number.integer
                    self._note(member.name, integer.signed_value(whole >> member.shift & integer.mask))
            case CountStep():
                self._count(step, step.integer.unpack(data), at)
            case ConstantStep() | ReservedStep() | BytesStep() | ItemsStep() | RecordStep() | RecordsStep():
                pass
            case _:
                assert_never(step)

    def _note(self, name: str, number: int) -> None:
        if name in self._tested:
            self.numbers[name] = number

    def _count(self, step: CountStep, number: int, at: int) -> None:
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
                return step.run not in self.counts
            case ConstantStep() | ReservedStep() | BytesStep() | ItemsStep() | RecordStep() | RecordsStep():
                return False
            case _:
                assert_never(step)


@dataclass(frozen=True, slots=True)
class Visit:
    """A step in a payload.

    Attributes:
        step: the step.
        at: its offset, or that of the next step if it is absent.
        data: its bytes, None if it is absent.
    """

    step: Step
    at: int
    data: bytes | None


def visit(plan: PayloadPlan, payload: bytes) -> Iterator[Visit]:
    """The steps of a payload, each before its value is used to find later ones. Raises Wrong."""
    walk, at = Walk(plan), 0
    for segment in plan.segments:
        if not present(segment.presence, walk.numbers, len(payload) - at):
            yield from (Visit(step, at, None) for step in segment.steps)
            continue
        if segment.terminator:
            size = _terminated(segment, payload, at)
        else:
            size = walk.size(segment, at, len(payload) - at)
        for step in segment.steps:
            begin = at + step.place.front.fixed
            data = payload[begin : begin + (size if segment.size is None else full_size(step))]
            yield Visit(step, begin, data)
            walk.learn(step, data, begin)
        at += size
    if at != len(payload):
        raise Wrong("", at)


def _terminated(segment: Segment, payload: bytes, at: int) -> int:
    """The size of a text with its terminator. Raises Wrong."""
    run = segment.run
    assert run is not None
    count = payload[at : at + run.length.maximum + 1].find(segment.terminator)
    if count < run.length.minimum:
        raise Wrong(run.name, at, segment.steps)
    return count + 1


def measure(plan: PayloadPlan, start: bytes) -> int:
    """The size of the payload that begins with ``start``. Raises Missing, or Wrong for a wrong count."""
    walk, at = Walk(plan), 0
    for segment in plan.segments:
        if not present(segment.presence, walk.numbers, 1):
            continue
        for step in segment.steps:
            if walk.decides(step):
                assert isinstance(step, ValueStep | BitsStep | CountStep)
                begin = at + step.place.front.fixed
                end = begin + step.integer.size
                if len(start) < end:
                    raise Missing(end)
                walk.learn(step, start[begin:end], begin)
        at += walk.size(segment, at, 1 << 32)
    return at
