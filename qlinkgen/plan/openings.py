"""Where a record takes all bytes that are left: of several records, only the last one may."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from qlinkgen._dataclass import dataclass
from qlinkgen.model.condition import Test
from qlinkgen.plan.payload import Member, RecordPlan, RecordsStep, RecordStep, ValueStep, value_name


@dataclass(frozen=True, slots=True)
class Inner:
    """A test of a value of a record.

    Attributes:
        inside: the records in it that hold the value, the outermost first.
        test: the test.
    """

    inside: tuple[RecordStep, ...]
    test: Test

    def holds(self, record: RecordPlan, values: Mapping[str, object]) -> bool:
        """Whether it is true of the raw values of a record, those that are not given at their defaults."""
        for step in self.inside:
            inner = values.get(value_name(step), {})
            if not isinstance(inner, Mapping):
                return False
            record, values = step.record, inner
        number = values[self.test.value] if self.test.value in values else _default(record, self.test.value)
        return isinstance(number, int) and self.test.holds(number)


def _default(record: RecordPlan, name: str) -> int | None:
    """The number that a new record has."""
    holder = next(each for each in record.payload.settable if each.name == name)
    assert isinstance(holder, ValueStep | Member)
    return holder.number.default if holder.presence is None or holder.presence.given else None


#: Tests that all hold; () is always true.
Opening = tuple[Inner, ...]


def openings(step: RecordsStep) -> tuple[Opening, ...]:
    """The conditions, one of which holds where a record takes all bytes that are left.

    Empty where none does, or where there is one record at most.
    """
    if not step.walked or step.length.maximum == 1:
        return ()
    return tuple(_openings(step.record, ()))


def _openings(record: RecordPlan, inside: tuple[RecordStep, ...]) -> Iterator[Opening]:
    for segment in record.payload.segments:
        if segment.counted:
            continue
        step, when = segment.records, segment.presence.when if segment.presence else ()
        tests = tuple(Inner(inside, test) for test in when)
        if isinstance(step, RecordStep):
            yield from ((*tests, *more) for more in _openings(step.record, (*inside, step)))
        elif segment.rest is not None:
            yield tests


def are_closed(step: RecordsStep, records: Iterable[Mapping[str, object]]) -> bool:
    """Whether none of the records with these raw values takes all bytes that are left."""
    found = openings(step)
    return not found or not any(
        all(each.holds(step.record, values) for each in opening) for values in records for opening in found
    )
