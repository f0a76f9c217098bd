"""The payload of a message as steps in wire order.

A step says what its bytes are and where they begin. Sizes come first: `Sizing` tells how many items each run
of variable size has, from the payload's size and from the counts in it. Only a payload whose sizes are
consistent has values, so a decoder reports `length` before `range`, whatever the order of the fields.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import assert_never

from qlinkgen.model.integer import Integer
from qlinkgen.model.message import Field, Message
from qlinkgen.model.types import (
    Array,
    BitField,
    Bits,
    Blob,
    Constant,
    Count,
    Enum,
    Flags,
    Length,
    Reserved,
    Scalar,
    Settable,
)
from qlinkgen.plan.expr import Clear, Limit, Size, Within


@dataclass(frozen=True, slots=True)
class Place:
    """Where the bytes of a step begin.

    Attributes:
        front: bytes of payload before it.
        back: bytes of payload from its first byte to the end, None where a run of variable size follows.
    """

    front: Size
    back: int | None

    @property
    def offset(self) -> int | None:
        """Bytes before it where their number is always the same, else None."""
        return None if self.front.terms else self.front.fixed


# Steps ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ValueStep:
    """An integer that the caller chooses and reads."""

    name: str
    place: Place
    integer: Integer
    number: Scalar

    @property
    def conditions(self) -> tuple[Limit, ...]:
        """What must hold of the integer on the wire, beyond what its bits can hold."""
        return conditions(self.number)


@dataclass(frozen=True)
class ConstantStep:
    """An integer that is always the same, and must be received as it is."""

    name: str
    place: Place
    integer: Integer
    value: int
    number: Scalar

    @property
    def conditions(self) -> tuple[Limit, ...]:
        """What must hold of the integer on the wire."""
        return (Within(self.value, self.value),)


@dataclass(frozen=True)
class ReservedStep:
    """An integer that is sent as ``value`` and ignored when received."""

    name: str
    place: Place
    integer: Integer
    value: int
    number: Scalar


@dataclass(frozen=True)
class CountStep:
    """An integer that the codec fills: how many units of ``run`` there are.

    Attributes:
        scale: the number is the run's items times this: 1 where items are counted, an item's bytes where
            bytes are.
        bounds: the least and most that the run allows, as this number.
    """

    name: str
    place: Place
    integer: Integer
    run: str
    scale: int
    bounds: Within


@dataclass(frozen=True)
class Member:
    """Bits that the caller chooses and reads."""

    name: str
    shift: int
    bits: int
    number: Scalar

    @property
    def conditions(self) -> tuple[Limit, ...]:
        """What must hold of the number, beyond what its bits can hold."""
        return conditions(self.number)


@dataclass(frozen=True)
class BitsStep:
    """An integer divided into members; bits of no member are sent as 0 and ignored when received."""

    name: str
    place: Place
    integer: Integer
    members: tuple[Member, ...]


@dataclass(frozen=True)
class BytesStep:
    """A run of bytes, or of 7-bit characters."""

    name: str
    place: Place
    text: bool
    length: Length
    default: bytes
    required: bool

    #: Bytes of one item.
    item_size = 1
    #: What the number of items is called.
    quantity = "size"

    @property
    def fixed(self) -> bool:
        """The number of bytes is always the same."""
        return self.length.fixed


@dataclass(frozen=True)
class ItemsStep:
    """A run of integers."""

    name: str
    place: Place
    item: Integer
    number: Scalar
    length: Length
    default: tuple[int, ...]
    required: bool

    #: What the number of items is called.
    quantity = "count"

    @property
    def item_size(self) -> int:
        """Bytes of one item."""
        return self.item.size

    @property
    def fixed(self) -> bool:
        """The number of items is always the same."""
        return self.length.fixed

    @property
    def conditions(self) -> tuple[Limit, ...]:
        """What must hold of each item, beyond what its bits can hold."""
        return conditions(self.number)


RunStep = BytesStep | ItemsStep
Step = ValueStep | ConstantStep | ReservedStep | CountStep | BitsStep | BytesStep | ItemsStep


# How many items there are -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Learn:
    """A count says how many items its run has; a multiple of ``count.scale``, and within the run's bounds."""

    count: CountStep


@dataclass(frozen=True, slots=True)
class Compare:
    """A count must agree with what is already known of its run."""

    count: CountStep


@dataclass(frozen=True, slots=True)
class Infer:
    """An uncounted run takes what ``others``, all other bytes of the payload, leave of its size."""

    run: RunStep
    others: Size


Sizing = Learn | Compare | Infer


@dataclass(frozen=True)
class PayloadPlan:
    """Everything that code needs to know of a payload.

    Attributes:
        steps: in wire order.
        sizing: in the order in which they can be carried out; afterwards every run's count is known and the
            size of the payload must equal ``size``.
        size: bytes of payload, given the counts.
        least: fewest bytes, `empty_is_default` not considered.
        most: most bytes.
        empty_is_default: a payload of no bytes stands for every default.
    """

    steps: tuple[Step, ...]
    sizing: tuple[Sizing, ...]
    size: Size
    least: int
    most: int
    empty_is_default: bool

    @property
    def fixed(self) -> bool:
        """The size is always the same."""
        return not self.size.terms

    @property
    def runs(self) -> tuple[RunStep, ...]:
        """Runs of variable size, in wire order."""
        return tuple(
            step for step in self.steps if isinstance(step, BytesStep | ItemsStep) and not step.fixed
        )

    def least_of(self, known: Collection[str]) -> Size:
        """Fewest bytes where only some runs have a known number of items; `size` where all have."""
        fixed = sum(run.length.minimum * run.item_size for run in self.runs if run.name not in known)
        return Size(self.size.fixed + fixed, tuple(term for term in self.size.terms if term.run in known))

    def sendable(self, run: RunStep) -> Within:
        """How many items may be sent: no more than each count of them can tell."""
        counts = [step for step in self.steps if isinstance(step, CountStep) and step.run == run.name]
        most = min([run.length.maximum, *(each.integer.maximum // each.scale for each in counts)])
        return Within(run.length.minimum, most)

    def run(self, name: str) -> RunStep:
        """A run by its name, of fixed or variable size."""
        return next(
            step for step in self.steps if isinstance(step, BytesStep | ItemsStep) and step.name == name
        )

    @property
    def settable(self) -> tuple[ValueStep | Member | BytesStep | ItemsStep, ...]:
        """What a caller sets and reads, in wire order."""
        found: list[ValueStep | Member | BytesStep | ItemsStep] = []
        for step in self.steps:
            match step:
                case ValueStep() | BytesStep() | ItemsStep():
                    found.append(step)
                case BitsStep():
                    found += step.members
                case ConstantStep() | ReservedStep() | CountStep():
                    pass
                case _:
                    assert_never(step)
        return tuple(found)


def least_size(step: Step) -> int:
    """Fewest bytes of a step."""
    match step:
        case ValueStep() | ConstantStep() | ReservedStep() | CountStep() | BitsStep():
            return step.integer.size
        case BytesStep() | ItemsStep():
            return step.length.minimum * step.item_size
        case _:
            assert_never(step)


def conditions(number: Scalar) -> tuple[Limit, ...]:
    """What must hold of a number on the wire, beyond what its bits can hold."""
    return limits(number)[1:] if number.full_range else limits(number)


def limits(number: Scalar) -> tuple[Limit, ...]:
    """What must hold of any integer that is to be sent as a number."""
    found: list[Limit] = [Within(number.minimum, number.maximum)]
    meaning = number.meaning
    match meaning:
        case Flags() if meaning.reserved_zero and (mask := number.integer.mask & ~meaning.mask):
            found.append(Clear(mask))
        case Flags() | Enum() | "bool" | None:
            pass
        case _:
            assert_never(meaning)
    return tuple(found)


# From the model ---------------------------------------------------------------------------------------------


def payload_plan(message: Message) -> PayloadPlan:
    """Plan the payload of a message."""
    return _Planner(message).plan()


class _Planner:
    """Walks the fields of one message."""

    def __init__(self, message: Message) -> None:
        self._message = message
        self._fields = {field.name: field for field in message.fields}

    def plan(self) -> PayloadPlan:
        front, steps = Size(), []
        for index, field in enumerate(self._message.fields):
            rest = self._message.fields[index:]
            back = sum(each.max_size for each in rest) if all(each.fixed for each in rest) else None
            steps.append(self._step(field, Place(front, back)))
            front = front + field.max_size if field.fixed else front.plus(field.name, _item_size(field))
        return PayloadPlan(
            steps=tuple(steps),
            sizing=tuple(self._sizing(steps, front)),
            size=front,
            least=self._message.min_size,
            most=self._message.max_size,
            empty_is_default=self._message.empty_is_default,
        )

    def _step(self, field: Field, place: Place) -> Step:
        kind = field.type
        match kind:
            case Scalar():
                return self._integer(field.name, kind, place)
            case Bits():
                return BitsStep(field.name, place, kind.container.integer, tuple(map(_member, kind.members)))
            case Blob():
                return BytesStep(field.name, place, kind.text, kind.length, kind.default, kind.required)
            case Array():
                return ItemsStep(
                    field.name, place, kind.item.integer, kind.item, kind.length, kind.default, kind.required
                )
            case _:
                assert_never(kind)

    def _integer(self, name: str, scalar: Scalar, place: Place) -> Step:
        match scalar.role:
            case Settable():
                return ValueStep(name, place, scalar.integer, scalar)
            case Constant():
                return ConstantStep(name, place, scalar.integer, scalar.default, scalar)
            case Reserved():
                return ReservedStep(name, place, scalar.integer, scalar.default, scalar)
            case Count(run, unit):
                counted = self._fields[run].type
                assert isinstance(counted, Blob | Array)
                scale = counted.item_size if unit == "bytes" else 1
                bounds = Within(counted.length.minimum * scale, counted.length.maximum * scale)
                return CountStep(name, place, scalar.integer, run, scale, bounds)
            case _:
                assert_never(scalar.role)

    def _sizing(self, steps: list[Step], size: Size) -> Iterator[Sizing]:
        """Wire order: the count that a run names precedes it; lint refuses a count after an open run."""
        for step in steps:
            match step:
                case CountStep():
                    length = self._length(step.run)
                    learns = not length.fixed and length.counted_by == step.name
                    yield Learn(step) if learns else Compare(step)
                case BytesStep() | ItemsStep():
                    if not step.fixed and not step.length.counted_by:
                        others = Size(size.fixed, tuple(term for term in size.terms if term.run != step.name))
                        yield Infer(step, others)
                case ValueStep() | ConstantStep() | ReservedStep() | BitsStep():
                    pass
                case _:
                    assert_never(step)

    def _length(self, run: str) -> Length:
        kind = self._fields[run].type
        assert isinstance(kind, Blob | Array)
        return kind.length


def _member(member: BitField) -> Member:
    return Member(member.name, member.shift, member.type.bits, member.type)


def _item_size(field: Field) -> int:
    assert isinstance(field.type, Blob | Array)
    return field.type.item_size
