"""Where a record takes all bytes that are left: of several records, only the last one may."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from qlinkgen.model.condition import Test
from qlinkgen.plan.payload import RecordPlan, RecordsStep, RecordStep, value_name


@dataclass(frozen=True, slots=True)
class Inner:
    """A test of a value of a record.

    Attributes:
        inside: the records in it that hold the value, the outermost first.
        test: the test.
    """

    inside: tuple[RecordStep, ...]
    test: Test

    def holds(self, values: Mapping[str, object]) -> bool:
        """Whether it is true of the raw values of the record."""
        for step in self.inside:
            inner = values[value_name(step)]
            if not isinstance(inner, Mapping):
                return False
            values = inner
        number = values[self.test.value]
        return isinstance(number, int) and self.test.holds(number)


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


def is_open(step: RecordsStep, values: Mapping[str, object]) -> bool:
    """Whether a record with these raw values takes all bytes that are left."""
    return any(all(each.holds(values) for each in opening) for opening in openings(step))
