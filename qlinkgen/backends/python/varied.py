"""Generates the statements of records of variable size, and of payloads with such records in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from qlinkgen.backends.python import integers
from qlinkgen.backends.python.layout import bare, indented, wrapped
from qlinkgen.backends.python.names import attribute, held, source_of
from qlinkgen.backends.python.place import Place
from qlinkgen.model.condition import Test
from qlinkgen.plan.expr import OneOf, Within
from qlinkgen.plan.openings import Inner, openings
from qlinkgen.plan.payload import CountStep, PayloadPlan, RecordsStep, RecordStep, Segment

#: Indent of the statements of a decoder.
_INDENT = 8


def condition(tests: Sequence[Test], number: str) -> str:
    """The expression of a condition; ``number`` is the format of the name of a value."""
    terms = [_test(each, number.format(each.value)) for each in tests]
    return " and ".join(terms) if len(terms) > 1 else bare(terms[0])


def any_of(conditions: Iterable[Sequence[Test]], number: str) -> str:
    """The expression of several conditions, one of which holds."""
    found = [condition(tests, number) for tests in conditions]
    return " or ".join(f"({each})" if len(found) > 1 and " and " in each else each for each in found)


def of_attribute(test: Test) -> Test:
    """The test of an attribute."""
    return Test(attribute(test.value), test.ranges, test.negated)


def _test(test: Test, number: str) -> str:
    rule = OneOf(tuple(Within(*each) for each in test.ranges))
    return integers.broken(rule, number) if test.negated else integers.holds(rule, number)


def is_last(step: RecordsStep) -> str:
    """The function that tells whether a record is the last one."""
    return f"lambda each: {ends(step)}"


def ends(step: RecordsStep) -> str:
    """Whether the record ``each`` is the last one."""
    return condition([of_attribute(test) for test in step.last], "each.{}")


def is_opened(step: RecordsStep) -> str:
    """The function that tells whether a record takes all bytes that are left."""
    return f"lambda each: {_opened(step)}"


def closed(step: RecordsStep) -> str:
    """Whether the record ``each`` leaves bytes for others; "" if all records do."""
    found = openings(step)
    if len(found) == 1 and len(found[0]) == 1:
        test = _inside(found[0][0])
        return condition([Test(test.value, test.ranges, not test.negated)], "each.{}")
    return f"not ({_opened(step)})" if found else ""


def _opened(step: RecordsStep) -> str:
    return any_of(([_inside(each) for each in tests] for tests in openings(step)), "each.{}")


def _inside(inner: Inner) -> Test:
    """The test of an attribute of a record, or of one in it."""
    path = [*map(held, inner.inside), attribute(inner.test.value)]
    return Test(".".join(path), inner.test.ranges, inner.test.negated)


def is_sized(payload: PayloadPlan, name: str) -> bool:
    """Whether a count tells the bytes of walked records."""
    return any(isinstance(each, CountStep) and each.sized and each.run == name for each in payload.steps)


def octets_of(step: RecordStep | RecordsStep, place: Place) -> str:
    """The expression for the bytes of records."""
    name, source = place.classes[step.record.name], source_of(step)
    if isinstance(step, RecordStep):
        return f"{name}.to_bytes({source})"
    return f'b"".join([{name}.to_bytes(each) for each in {source}])'


def read_lines(
    segment: Segment, payload: PayloadPlan, place: Place, offset: str, end: str = "end"
) -> list[str]:
    """The statements that read walked records at the local ``at``, before the local ``end``.

    ``offset`` is that in the payload.
    """
    step, wrong = segment.records, f"    raise {place.use('LayoutError')}"
    assert step is not None
    name, kind = held(step), place.classes[step.record.name]
    exact = isinstance(step, RecordsStep) and (segment.rest is not None or is_sized(payload, step.name))
    limit = f"{step.name}_end" if exact else end
    lines: list[str] = []
    if exact and segment.rest is not None:
        rest = integers.size_text(segment.rest)
        rest = f"({rest})" if " " in rest else rest
        lines = [f"{limit} = {end}{f' - {rest}' if rest != '0' else ''}", f"if {limit} < at:", wrong]
    elif exact:
        lines = [f"{limit} = at + {integers.bytes_of(step.name)}", f"if {limit} > {end}:", wrong]
    given = [kind, place.data, "at", limit]
    target = f"message.{name}, at"
    if isinstance(step, RecordStep):
        reader = "read_one"
    elif step.last:
        reader, given = "read_ended", [*given, f"most={step.length.maximum}", f"is_last={is_last(step)}"]
    elif step.fixed or _is_counted(payload, step.name):
        reader = "read_counted"
        given.append(str(step.length.maximum) if step.fixed else f"{step.name}_count")
    else:
        reader, target = "read_filled", f"message.{name}"
        given += [f"fewest={step.length.minimum}", f"most={step.length.maximum}"]
    seen = ["error", "cls", f'"{name}"', offset, place.payload]
    lines += [
        "try:",
        *indented(wrapped(f"{target} = {place.use(reader)}(", given, ")", _INDENT + 4)),
        f"except {place.use('DecodeError')} as error:",
        *indented(wrapped(f"raise {place.use('inside')}(", seen, ") from None", _INDENT + 4)),
    ]
    if reader == "read_filled":
        return [*lines, f"at = {limit}"]
    return [*lines, f"if at != {limit}:", wrong] if exact else lines


def _is_counted(payload: PayloadPlan, name: str) -> bool:
    """Whether a count tells the number of walked records."""
    return any(isinstance(each, CountStep) and not each.sized and each.run == name for each in payload.steps)
