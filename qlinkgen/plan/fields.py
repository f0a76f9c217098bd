"""Divides a payload into fields, even one that the message cannot have."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.model.integer import Integer
from qlinkgen.plan.content import BadContent, broken, count_items, right, unpack_items
from qlinkgen.plan.expr import Condition
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ConstantStep,
    CountStep,
    FilledStep,
    ItemsStep,
    Learn,
    Member,
    PayloadPlan,
    RecordPlan,
    RecordsStep,
    RecordStep,
    ReservedStep,
    Step,
    ValueStep,
    full_size,
    least_size,
    term_of,
    value_name,
)
from qlinkgen.plan.separated import visit
from qlinkgen.plan.spans import Around, Span
from qlinkgen.plan.walk import Wrong as WrongSize

_NONE: Mapping[str, int] = {}


@dataclass(frozen=True, slots=True)
class Wrong:
    """An illegal value of a field, its offset in the payload, and the record that it is inside of.

    Attributes:
        right: the only legal number, if it follows from other bytes.
    """

    of: Step | Member
    seen: int
    at: int
    inside: str = ""
    right: int | None = None

    @property
    def kind(self) -> str:
        """The kind of fault."""
        return self.of.fault if isinstance(self.of, FilledStep) else "range"


class Fields:
    """The spans of a payload; offsets count from its first byte.

    Attributes:
        bad: the sizes of its fields do not match the message.
        spans: in wire order, a member after its integer.
        wrong: illegal values; empty if sizes are bad.
    """

    def __init__(
        self,
        plan: PayloadPlan,
        payload: bytes,
        *,
        sound: bool,
        judging: bool = True,
        beside: Mapping[str, int] = _NONE,
    ) -> None:
        """Values are checked only if the payload is ``sound``: neither cut short nor wrongly stuffed.

        Without ``judging``, they are not checked at all. ``beside`` are raw values of the frame.
        """
        self._beside = beside
        self._plan, self._payload, self._sound = plan, payload, sound
        self._learned: dict[str, int] = {}
        self.bad = False
        self.spans: list[Span] = []
        self.wrong: list[Wrong] = []
        self._counts: Mapping[str, int] = {}
        counts: Mapping[str, int] = {}
        if plan.walked:
            self._judging = judging and sound
            self._walk()
            return
        try:
            counts = count_items(plan, payload)
        except BadContent:
            self.bad = sound
        self._judging = judging and sound and not self.bad
        self._counts = counts
        self._divide(counts)

    def _walk(self) -> None:
        """Divide the payload segment by segment; values are judged up to the first wrong size."""
        at = 0
        try:
            for each in visit(self._plan, self._payload, self._beside):
                if each.data is None or not each.walked:
                    self._between(at, each.at)
                    at = each.at
                if each.data is not None and not each.walked:
                    at += len(each.data)
                    self._step_in(each.prefix, each.step, range(each.at, at), len(each.data))
        except WrongSize as wrong:
            self.bad = self._sound
            for step in wrong.steps:
                begin = wrong.at + step.place.front.fixed
                at = min(max(at, begin + full_size(step)), len(self._payload))
                self._step_in(wrong.inside, step, range(min(begin, at), at), full_size(step))
        self._extra(at)

    def _between(self, at: int, begin: int) -> None:
        """Add the separator before a field."""
        if self._plan.separator and begin > at:
            places = tuple(range(at, begin))
            self.spans.append(Span(Around.SEPARATOR, places, self._payload[at:begin], len(places)))

    def _extra(self, at: int) -> None:
        """Add the bytes after the last step."""
        if self._payload[at:]:
            places = tuple(range(at, len(self._payload)))
            self.spans.append(Span(Around.EXTRA, places, self._payload[at:], len(places), None, "length"))

    def _divide(self, counts: Mapping[str, int]) -> None:
        at, rest = 0, sum(map(least_size, self._plan.steps))
        for step in self._plan.steps:
            rest -= least_size(step)
            size = self._size(step, counts, len(self._payload) - at - rest)
            places = tuple(range(at, min(at + size, len(self._payload))))
            at += len(places)
            self._step(step, places, size)
        self._extra(at)

    def _size(self, step: Step, counts: Mapping[str, int], left: int) -> int:
        """Size of a step: by its count if that is right, otherwise by the bytes left."""
        match step:
            case BytesStep() | ItemsStep() | RecordsStep() if not step.fixed:
                number = counts.get(step.name, self._learned.get(step.name))
                if step.packed:
                    return max(0, left) if number is None else term_of(step).value(number)
                return step.item_size * (max(0, left) // step.item_size if number is None else number)
            case _:
                return least_size(step)

    def _step_in(self, inside: str, step: Step, places: range, size: int) -> None:
        """Add a step inside of walked records."""
        spans, wrong = len(self.spans), len(self.wrong)
        self._step(step, tuple(places), size)
        self.spans[spans:] = [replace(each, inside=inside + each.inside) for each in self.spans[spans:]]
        self.wrong[wrong:] = [replace(each, inside=inside + each.inside) for each in self.wrong[wrong:]]

    def _step(self, step: Step, places: tuple[int, ...], size: int) -> None:  # noqa: C901  # a case a step
        raw = bytes(self._payload[at] for at in places)
        if isinstance(step, RecordStep | RecordsStep):
            self._records(step, places)
            return
        if len(raw) < size:
            if raw:
                short = "length" if self._sound else "truncated"
                self.spans.append(Span(step, places, raw, size, None, short))
            return
        match step:
            case ValueStep() | ConstantStep():
                self._integer(step, step.integer, step.conditions, places)
            case CountStep():
                self._learn(step, self._integer(step, step.integer, (), places))
            case FilledStep():
                self._filled(step, places, step.integer.unpack(raw))
            case ReservedStep():
                self._span(step, places, step.integer.unpack(raw))
            case BitsStep():
                self._members(step, self._integer(step, step.integer, (), places), places)
            case BytesStep():
                high = (at for at in places if _is_barred(step, self._payload[at]))
                self._span(step, places, None, next(high, None))
            case ItemsStep():
                self._items(step, raw, places)
            case _:
                assert_never(step)

    def _records(self, step: RecordStep | RecordsStep, places: tuple[int, ...]) -> None:
        """Divide each record, the last one as far as received."""
        size = step.record.size
        for index, at in enumerate(range(0, len(places), size)):
            name = (
                f"{value_name(step)}[{index}]." if isinstance(step, RecordsStep) else f"{value_name(step)}."
            )
            self._record(step.record, name, places[at : at + size])

    def _record(self, record: RecordPlan, name: str, places: tuple[int, ...]) -> None:
        raw = bytes(self._payload[at] for at in places)
        inner = Fields(record.payload, raw, sound=self._sound, judging=self._judging)
        for span in inner.spans:
            own = tuple(places[at] for at in span.places)
            self.spans.append(replace(span, places=own, inside=name + span.inside))
        self.wrong += (replace(each, at=places[each.at], inside=name + each.inside) for each in inner.wrong)

    def _filled(self, step: FilledStep, places: tuple[int, ...], number: int) -> None:
        """Add a number that follows from other bytes, which have been divided before."""
        start = places[0] - step.place.front.fixed if self._plan.walked else 0
        wanted = right(step, self._payload, start, self._counts) if self._judging else number
        wrong = number != wanted
        if wrong:
            self.wrong.append(Wrong(step, number, places[0], right=wanted))
        raw = bytes(self._payload[at] for at in places)
        self.spans.append(Span(step, places, raw, len(places), number, step.fault if wrong else ""))

    def _learn(self, step: CountStep, number: int) -> None:
        if any(isinstance(each, Learn) and each.count is step for each in self._plan.sizing):
            self._learned[step.run] = max(0, step.term.items_in(number))

    def _items(self, step: ItemsStep, raw: bytes, places: tuple[int, ...]) -> None:
        bad = None
        if step.packed:
            self._row(step, raw, places)
            return
        size = len(raw) or 1 if step.between else step.item_size
        for at in reversed(range(0, len(raw), size)):
            if _is_refused(step.item, step.conditions, raw[at : at + size]):
                bad = places[at]
        self._span(step, places, None, bad)

    def _row(self, step: ItemsStep, raw: bytes, places: tuple[int, ...]) -> None:
        """Add a row of bits; the number of its span is that of its items."""
        number = step.length.maximum
        if not step.fixed:
            number = self._counts.get(step.name, self._learned.get(step.name, 8 * len(raw) // step.item.bits))
        bad = [
            (at, item)
            for at, item in enumerate(unpack_items(step, raw, number))
            if broken(step.conditions, item)
        ]
        wrong = bool(bad) and self._judging
        if wrong:
            self.wrong.append(Wrong(step, bad[0][1], places[bad[0][0] * step.item.bits // 8]))
        if places:
            self.spans.append(Span(step, places, raw, len(places), number, "range" if wrong else ""))

    def _integer(
        self, step: Step, integer: Integer, rules: tuple[Condition, ...], places: tuple[int, ...]
    ) -> int:
        raw = bytes(self._payload[at] for at in places)
        number = integer.unpack(raw)
        self._span(step, places, number, places[0] if _is_refused(integer, rules, raw) else None)
        return number

    def _members(self, step: BitsStep, whole: int, places: tuple[int, ...]) -> None:
        for member in step.members:
            self._member(member, whole, places)

    def _member(self, member: Member, whole: int, places: tuple[int, ...]) -> None:
        number = member.of(whole)
        self._span(member, places, number, places[0] if broken(member.conditions, number) else None)

    def _span(
        self, of: Step | Member, places: tuple[int, ...], number: int | None, bad: int | None = None
    ) -> None:
        """Add a span; ``bad`` is the offset of an illegal value."""
        wrong = bad is not None and self._judging
        if bad is not None and wrong:
            seen = number if number is not None else self._seen(of, bad)
            self.wrong.append(Wrong(of, seen, bad))
        if places:
            raw = bytes(self._payload[at] for at in places)
            self.spans.append(Span(of, places, raw, len(places), number, "range" if wrong else ""))

    def _seen(self, of: Step | Member, at: int) -> int:
        """The wrong item, or character."""
        if isinstance(of, ItemsStep):
            data = self._payload[at : at + of.item_size]
            return of.item.unpack(data.split(of.between)[0] if of.between else data)
        return self._payload[at]


def _is_barred(step: BytesStep, octet: int) -> bool:
    """Whether a text does not have the byte."""
    return (step.text and octet >= 0x80) or octet in step.excluded


def _is_refused(integer: Integer, rules: tuple[Condition, ...], raw: bytes) -> bool:
    return integer.stray(raw) or broken(rules, integer.unpack(raw))
