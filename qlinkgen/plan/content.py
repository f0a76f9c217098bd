"""Interprets the steps of a payload: encodes values to bytes and decodes them.

Values are raw: the integer on the wire, bytes for bytes and text, a list of integers for an array, a mapping
of raw values for a record; None for an absent field.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias, assert_never

from qlinkgen.model.integer import Integer, pack_row, unpack_row
from qlinkgen.plan import walk
from qlinkgen.plan.expr import Condition
from qlinkgen.plan.openings import are_closed
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    Compare,
    ConstantStep,
    CountStep,
    FilledStep,
    Holder,
    Infer,
    ItemsStep,
    Learn,
    Member,
    PayloadPlan,
    RecordPlan,
    RecordsStep,
    RecordStep,
    ReservedStep,
    RunStep,
    Segment,
    Step,
    ValueStep,
    holders,
    term_of,
    value_name,
)
from qlinkgen.plan.separated import joined, visit
from qlinkgen.plan.walk import Missing, Wrong, present

_NONE: Mapping[str, object] = {}
Raw: TypeAlias = "int | bytes | list[int] | Mapping[str, Raw] | Sequence[Mapping[str, Raw]] | None"


class Unsendable(ValueError):
    """A value that cannot be sent; ``field`` names it."""

    def __init__(self, field: str, value: object) -> None:
        """Compose the error text."""
        super().__init__(f"{field}: {value!r} cannot be sent")
        self.field = field
        self.value = value


class BadContent(ValueError):
    """Bytes that are not a valid payload of the message.

    Attributes:
        kind: length or range.
        field: the wrong field, "" if the size of the payload is wrong.
        offset: its offset in the payload.
    """

    def __init__(self, kind: str, field: str = "", offset: int = 0) -> None:
        """Compose the error text."""
        super().__init__(f"{kind}: {field or 'payload'} at {offset}")
        self.kind = kind
        self.field = field
        self.offset = offset


class MoreNeeded(Exception):
    """The size of the payload does not follow from the bytes so far.

    Attributes:
        least: minimum size of the payload.
        needed: number of bytes up to the end of the next count.
    """

    def __init__(self, least: int, needed: int) -> None:
        """Note the sizes."""
        super().__init__(least, needed)
        self.least = least
        self.needed = needed


# Encoding ---------------------------------------------------------------------------------------------------


def pack(plan: PayloadPlan, values: Mapping[str, Raw]) -> bytes:
    """The payload with these values, defaults for missing ones. Raises Unsendable.

    Values of the frame are among them.
    """
    if plan.separator:
        return _pack_separated(
            plan, {each.name: values.get(each.name, default_of(each)) for each in plan.settable}
        )
    if plan.walked:
        by_case = _by_case(plan, values)
        try:
            return _pack_walked(plan, by_case, plan.decided(values))
        except Unsendable as unsendable:
            raise Unsendable(_public(plan, unsendable.field), unsendable.value) from None
    whole = {each.name: values.get(each.name, default_of(each)) for each in plan.settable}
    counts = {run.name: _count(run, whole[run.name]) for run in plan.runs}
    data = b""
    for step in plan.steps:
        data += _filled(step, data, counts) if isinstance(step, FilledStep) else _packed(step, whole, counts)
    return plan.trimmed(data)


def _pack_separated(plan: PayloadPlan, values: Mapping[str, Raw]) -> bytes:
    texts = []
    counts = {run.name: _count(run, values[run.name]) for run in plan.runs if isinstance(run, ItemsStep)}
    for step in plan.steps:
        absent = step.presence is not None and values[step.name] is None
        texts.append(b"" if absent else _packed(step, values, counts))
    return joined(plan, texts)


def _by_case(plan: PayloadPlan, values: Mapping[str, Raw]) -> dict[str, Raw]:
    """The values by field: that of a choice belongs to the case that is sent. Raises Unsendable."""
    given: Mapping[str, Raw] = {**plan.decided(values), **values}
    if any(value_name(each) not in values for each in plan.settable):
        given = {**defaults(plan), **given}
    numbers = {name: value for name, value in given.items() if isinstance(value, int)}
    found: dict[str, Raw] = {}
    left: dict[str, Raw] = {}
    for each in plan.settable:
        name, presence = value_name(each), each.presence
        if presence is None or not presence.slot:
            found[name] = given[name]
        elif present(presence, numbers, 0):
            found[each.name] = given[name]
            left[name] = None
        else:
            found[each.name] = None
            left.setdefault(name, given[name])
    for name, value in left.items():
        if value is not None:
            raise Unsendable(name, value)
    return found


def by_value(plan: PayloadPlan, found: Mapping[str, Raw]) -> dict[str, Raw]:
    """Values by field as values of the message: of each choice, that of the case which is present."""
    values: dict[str, Raw] = {}
    for each in plan.settable:
        if values.get(value_name(each)) is None:
            values[value_name(each)] = found[each.name]
    return values


def _pack_walked(plan: PayloadPlan, values: Mapping[str, Raw], decided: Mapping[str, int]) -> bytes:
    """The payload of values by field; ``decided`` are those of the frame."""
    data, left_out, counted = b"", False, _counted(plan, values)
    sizes = {each.name: {each.run: _size_of(plan, each.run, counted)} for each in plan.byte_counts}
    numbers = {name: value for name, value in values.items() if isinstance(value, int)}
    numbers |= decided
    counts = {run.name: 0 if values[run.name] is None else _count(run, values[run.name]) for run in plan.runs}
    for segment in plan.segments:
        given = [values[each.name] is not None for each in segment.settable]
        if segment.presence is not None and segment.presence.optional:
            sent = given[0]
            if sent and left_out:
                raise Unsendable(segment.presence.field, values[segment.presence.field])
            left_out = not sent
        else:
            sent = present(segment.presence, numbers, 0)
        for each in segment.settable:
            if (values[each.name] is not None) != sent:
                raise Unsendable(each.name, values[each.name])
        if sent:
            whole = counted.get(segment.steps[0].name)
            data += _segment(segment, values, counts, sizes) if whole is None else whole
    if len(data) > plan.most:
        long = [step for segment in plan.segments if (step := segment.records)]
        field = next((step for step in long if values[step.name] is not None), long[0])
        raise Unsendable(field.name, values[field.name])
    return data


def _segment(
    segment: Segment,
    values: Mapping[str, Raw],
    counts: Mapping[str, int],
    sizes: Mapping[str, Mapping[str, int]],
) -> bytes:
    data = b""
    for step in segment.steps:
        if isinstance(step, FilledStep):
            data += _filled(step, data, counts)
        else:
            data += _packed(step, values, {**counts, **sizes.get(step.name, {})})
    return data


def _filled(step: FilledStep, data: bytes, counts: Mapping[str, int]) -> bytes:
    """The bytes of a number that follows from those before it."""
    return step.integer.pack(step.value(data[step.begin.value(counts) : step.end.value(counts)]))


def _counted(plan: PayloadPlan, values: Mapping[str, Raw]) -> dict[str, bytes]:
    """The fields that are sent and whose bytes a count tells."""
    counted = (segment.steps[0] for each in plan.byte_counts for segment in plan.counted(each.run))
    return {step.name: _packed(step, values, {}) for step in counted if values[step.name] is not None}


def _size_of(plan: PayloadPlan, name: str, counted: Mapping[str, bytes]) -> int:
    """The bytes that a count tells."""
    return sum(len(counted.get(segment.steps[0].name, b"")) for segment in plan.counted(name))


def default_of(each: Holder) -> Raw:
    """The default of a field, None if a new message does not have it."""
    if each.presence is not None and not each.presence.given:
        return None
    match each:
        case ValueStep() | Member():
            return each.number.default
        case BytesStep():
            return each.default
        case ItemsStep():
            return list(each.default)
        case RecordStep():
            return defaults(each.record.payload)
        case RecordsStep():
            return [defaults(each.record.payload) for _ in range(each.length.minimum)]
        case _:
            assert_never(each)


def defaults(plan: PayloadPlan) -> dict[str, Raw]:
    """The defaults of all fields."""
    return by_value(plan, {each.name: default_of(each) for each in plan.settable})


def with_decided(plan: PayloadPlan, values: Mapping[str, Raw]) -> dict[str, Raw]:
    """These values, and the defaults of all other fields that are present with them.

    Values of the frame may be among them.
    """
    given = {**defaults(plan), **plan.decided(values), **values}
    numbers = {name: value for name, value in given.items() if isinstance(value, int)}
    found: dict[str, Raw] = {}
    for each in plan.settable:
        presence, name = each.presence, value_name(each)
        if presence is None or presence.optional:
            found[name] = default_of(each)
        elif present(presence, numbers, 0):
            found[name] = default_of(replace(each, presence=None))
        else:
            found.setdefault(name, None)
    return {**found, **values}


def _packed(step: Step, values: Mapping[str, Raw], counts: Mapping[str, int]) -> bytes:  # noqa: C901  # a case a step
    match step:
        case ValueStep():
            return step.integer.pack(_checked(step.name, step.limits, values[step.name]))
        case ConstantStep() | ReservedStep():
            return step.integer.pack(step.value)
        case CountStep():
            number = step.term.value(counts[step.run])
            if number > step.integer.maximum:
                raise Unsendable(step.run, values[step.run])
            return step.integer.pack(number)
        case FilledStep():
            raise AssertionError(f"{step.name} follows from other bytes")
        case BitsStep():
            pattern = sum(member_bits(member, values) << member.shift for member in step.members)
            return step.integer.pack(step.integer.signed_value(pattern))
        case BytesStep():
            return _octets(step, values[step.name])
        case ItemsStep():
            _count(step, values[step.name])
            items = values[step.name]
            if not isinstance(items, list):  # of another case of a choice
                raise Unsendable(step.name, items)
            return pack_items(step, [_checked(step.name, step.limits, item) for item in items])
        case RecordStep():
            return _record(step.name, step.record, values[step.name])
        case RecordsStep():
            return _packed_records(step, values[step.name])
        case _:
            assert_never(step)


def _packed_records(step: RecordsStep, value: object) -> bytes:
    _count(step, value)
    if not isinstance(value, list):  # of another case of a choice
        raise Unsendable(step.name, value)
    if step.last and not _ends(step, value):
        raise Unsendable(step.name, value)
    if not are_closed(step, value[:-1]):
        raise Unsendable(step.name, value)
    return b"".join(_record(f"{step.name}[{i}]", step.record, each) for i, each in enumerate(value))


def _ends(step: RecordsStep, records: Sequence[Mapping[str, Raw]]) -> bool:
    """Whether the last record, and no other, ends the array."""
    usual = defaults(step.record.payload)
    whole = [usual | dict(each) for each in records]
    return [step.ends(each) for each in whole] == [*[False] * (len(whole) - 1), True]


def _record(name: str, record: RecordPlan, value: object) -> bytes:
    if not isinstance(value, Mapping):
        raise Unsendable(name, value)
    try:
        return pack(record.payload, value)
    except Unsendable as unsendable:
        raise Unsendable(f"{name}.{unsendable.field}", unsendable.value) from None


def pack_items(step: ItemsStep, numbers: Sequence[int]) -> bytes:
    """The bytes of legal items."""
    if step.packed:
        return pack_row([number & step.item.mask for number in numbers], step.item.bits, step.packed)
    return step.between.join(map(step.item.pack, numbers))


def unpack_items(step: ItemsStep, data: bytes, number: int) -> list[int]:
    """The items at the beginning of ``data``, which are not checked."""
    if step.packed:
        own = data[: term_of(step).value(number)]
        bits = unpack_row(own, number, step.item.bits, step.packed)
        return list(map(step.item.signed_value, bits))
    starts = range(0, step.item_size * number, step.item_size)
    return [step.item.unpack(data[at : at + step.item_size]) for at in starts]


def member_bits(member: Member, values: Mapping[str, Raw]) -> int:
    """The bits of a value. Raises Unsendable."""
    return _checked(member.name, member.limits, values[member.name]) & member.number.integer.mask


def _checked(name: str, limits: tuple[Condition, ...], value: object) -> int:
    if not isinstance(value, int) or broken(limits, value):
        raise Unsendable(name, value)
    return value


def _octets(step: BytesStep, value: object) -> bytes:
    if not isinstance(value, bytes) or (step.text and not value.isascii()) or {*value} & {*step.excluded}:
        raise Unsendable(step.name, value)
    padded = step.padded(value)
    if step.stripped(padded) != value:
        raise Unsendable(step.name, value)
    _count(step, padded if step.pad else value)
    return padded


def _count(step: RunStep, value: object) -> int:
    if not isinstance(value, bytes | list) or not step.length.minimum <= len(value) <= step.length.maximum:
        raise Unsendable(step.name, value)
    return len(value)


def broken(rules: tuple[Condition, ...], value: int) -> bool:
    """Whether a number violates one of the conditions."""
    return not all(rule.holds(value) for rule in rules)


# Decoding ---------------------------------------------------------------------------------------------------


def unpack(plan: PayloadPlan, payload: bytes, beside: Mapping[str, object] = _NONE) -> dict[str, Raw]:
    """The values of a payload; checks sizes first, then each step in wire order. Raises BadContent.

    ``beside`` are raw values of the frame.
    """
    if not payload and plan.empty_is_default:
        return defaults(plan)
    if plan.walked:
        return _unpack_walked(plan, payload, beside)
    payload = plan.filled(payload)
    counts = count_items(plan, payload)
    values: dict[str, Raw] = {}
    for step in plan.steps:
        at = step.place.front.value(counts)
        if isinstance(step, FilledStep):
            _verify(step, payload, at, 0, counts)
        else:
            values |= _unpacked(step, payload[at:], counts, at)
    return values


def right(step: FilledStep, payload: bytes, start: int, counts: Mapping[str, int]) -> int:
    """What a filled number must be; ``start`` is the offset that its places count from."""
    return step.value(payload[start + step.begin.value(counts) : start + step.end.value(counts)])


def _verify(step: FilledStep, payload: bytes, at: int, start: int, counts: Mapping[str, int]) -> None:
    """Compare a filled number with the bytes that it follows from. Raises BadContent."""
    if step.integer.unpack(payload[at : at + step.integer.size]) != right(step, payload, start, counts):
        raise BadContent(step.fault, step.name, at)


def _unpack_walked(plan: PayloadPlan, payload: bytes, beside: Mapping[str, object]) -> dict[str, Raw]:
    values = _Values()
    try:
        for each in visit(plan, payload, beside):
            own, name = values.of(each.inside), value_name(each.step)
            if isinstance(each.step, FilledStep):
                _verify_at(each, each.step, payload)
            elif each.data is None:
                for holder in holders((each.step,)):
                    own.setdefault(value_name(holder), None)
            elif each.walked:
                own[name] = [] if own.get(name) is None else own[name]  # an array without records
            elif isinstance(each.step, ItemsStep) and each.step.between:
                own[name] = [*_listed(own.get(name)), *_listed(_unpacked_at(each, each.data)[name])]
            else:
                own |= _unpacked_at(each, each.data)
    except Wrong as wrong:
        raise BadContent("length", wrong.path, wrong.at) from None
    return values.of(())


def _listed(value: Raw | None) -> list[int]:
    """The items of a list so far."""
    return [each for each in value if isinstance(each, int)] if isinstance(value, list) else []


class _Values:
    """The values of a payload with walked records in it."""

    def __init__(self) -> None:
        self._records: dict[walk.Inside, dict[str, Raw]] = {(): {}}
        self._arrays: dict[tuple[walk.Inside, str], list[dict[str, Raw]]] = {}

    def of(self, inside: walk.Inside) -> dict[str, Raw]:
        """The values of a record, which is new if it is read for the first time."""
        if inside not in self._records:
            outer, (name, index) = self.of(inside[:-1]), inside[-1]
            self._records[inside] = {}
            if index is None:
                outer[name] = self._records[inside]
            else:
                outer[name] = array = self._arrays.setdefault((inside[:-1], name), [])
                array.append(self._records[inside])
        return self._records[inside]


def _verify_at(visit: walk.Visit, step: FilledStep, payload: bytes) -> None:
    try:
        _verify(step, payload, visit.at, visit.at - step.place.front.fixed, {})
    except BadContent as bad:
        raise BadContent(bad.kind, visit.prefix + bad.field, bad.offset) from None


def _unpacked_at(visit: walk.Visit, data: bytes) -> dict[str, Raw]:
    step = replace(visit.step, name=value_name(visit.step))
    try:
        return _unpacked(step, data, _counts_of(step, data), visit.at)
    except BadContent as bad:
        raise BadContent(bad.kind, visit.prefix + bad.field, bad.offset) from None


def _public(plan: PayloadPlan, path: str) -> str:
    """The path of a value, with the name of the choice in place of its case."""
    names = {each.name: value_name(each) for each in plan.settable}
    first = re.match(r"\w*", path)
    assert first is not None
    return names.get(first[0], first[0]) + path[first.end() :]


def _counts_of(step: Step, data: bytes) -> Mapping[str, int]:
    """The number of items of a run that has these bytes."""
    if isinstance(step, ItemsStep) and step.between:
        return {step.name: int(bool(data))}
    if not isinstance(step, RunStep) or step.fixed:
        return {}
    return {step.name: len(data) // step.item_size}


def places(
    plan: PayloadPlan, payload: bytes, beside: Mapping[str, object] = _NONE
) -> Iterator[tuple[Step, int]]:
    """The steps of a valid payload, zeros at its end included, and their offsets, without absent ones.

    ``beside`` are raw values of the frame.
    """
    if plan.walked:
        for each in visit(plan, payload, beside):
            if each.data is not None and not each.walked:
                yield replace(each.step, name=each.prefix + each.step.name), each.at
        return
    counts = count_items(plan, payload)
    yield from ((step, step.place.front.value(counts)) for step in plan.steps)


def count_items(plan: PayloadPlan, payload: bytes) -> dict[str, int]:
    """Number of items of each run of variable size. Raises BadContent of kind length."""
    if not plan.least <= len(payload) <= plan.most:
        raise BadContent("length")
    counts: dict[str, int] = {}
    for each in plan.sizing:
        match each:
            case Infer():
                left, size = len(payload) - each.others.value(counts), each.run.item_size
                if left % size or not each.run.length.minimum <= left // size <= each.run.length.maximum:
                    raise BadContent("length", each.run.name)
                counts[each.run.name] = left // size
            case Learn():
                counts[each.count.run] = _learn(each.count, payload, counts)
            case Compare():
                if _number(each.count, payload, counts) != each.count.term.value(counts[each.count.run]):
                    raise BadContent("length", each.count.name)
            case _:
                assert_never(each)
    if plan.size.value(counts) != len(payload):
        raise BadContent("length")
    return counts


def measure(plan: PayloadPlan, start: bytes) -> int:
    """The size of the payload that begins with ``start``, derived from its counts.

    Raises MoreNeeded while counts are missing, BadContent if one is out of range.
    """
    if plan.walked:
        return _measure_walked(plan, start)
    counts = {run.name: run.length.minimum for run in plan.runs}
    for each in plan.sizing:
        if isinstance(each, Learn):
            end = each.count.place.front.value(counts) + each.count.integer.size
            if len(start) < end:
                raise MoreNeeded(plan.size.value(counts), end)
            counts[each.count.run] = _learn(each.count, start, counts)
    return plan.size.value(counts)


def _measure_walked(plan: PayloadPlan, start: bytes) -> int:
    try:
        size = walk.measure(plan, start)
    except Missing as missing:
        if missing.end > plan.most:
            # A receiver has no room for the bytes that would decide.
            raise BadContent("length") from None
        raise MoreNeeded(max(plan.least, missing.end), missing.end) from None
    except Wrong as wrong:
        raise BadContent("length", wrong.path, wrong.at) from None
    if size > plan.most:
        raise BadContent("length")
    return size


def _learn(count: CountStep, payload: bytes, counts: Mapping[str, int]) -> int:
    number = _number(count, payload, counts)
    items = count.items(number)
    if items is None or not count.bounds.holds(number):
        raise BadContent("length", count.name)
    return items


def _number(count: CountStep, payload: bytes, counts: Mapping[str, int]) -> int:
    at = count.place.front.value(counts)
    data = payload[at : at + count.integer.size]
    if len(data) < count.integer.size:
        raise BadContent("length", count.name, at)
    return count.integer.unpack(data)


def _unpacked(step: Step, data: bytes, counts: Mapping[str, int], at: int) -> dict[str, Raw]:  # noqa: C901  # a case a step
    """The values of the step at the beginning of ``data``."""
    match step:
        case ValueStep():
            return {step.name: _valid(step.name, step.integer, step.conditions, data, at)}
        case ConstantStep():
            _valid(step.name, step.integer, step.conditions, data, at)
        case CountStep():
            _valid(step.name, step.integer, (), data, at)
        case BitsStep():
            return _members(step, _valid(step.name, step.integer, (), data, at), at)
        case BytesStep():
            taken = step.stripped(data[: counts.get(step.name, step.length.maximum)])
            if (step.text and not taken.isascii()) or {*taken} & {*step.excluded}:
                raise BadContent("range", step.name, at)
            return {step.name: taken}
        case ItemsStep():
            return {step.name: _valid_items(step, data, counts.get(step.name, step.length.maximum), at)}
        case RecordStep() | RecordsStep():
            return {step.name: _unpacked_records(step, data, counts, at)}
        case ReservedStep():
            pass
        case FilledStep():
            raise AssertionError(f"{step.name} follows from other bytes")
        case _:
            assert_never(step)
    return {}


def _unpacked_records(step: RecordStep | RecordsStep, data: bytes, counts: Mapping[str, int], at: int) -> Raw:
    if isinstance(step, RecordStep):
        return _unpacked_record(step.name, step.record, data, at)
    size = step.item_size
    starts = range(0, size * counts.get(step.name, step.length.maximum), size)
    return [
        _unpacked_record(f"{step.name}[{index}]", step.record, data[start:], at + start)
        for index, start in enumerate(starts)
    ]


def _unpacked_record(name: str, record: RecordPlan, data: bytes, at: int) -> dict[str, Raw]:
    """The values of the record at the beginning of ``data``."""
    try:
        return unpack(record.payload, data[: record.size])
    except BadContent as bad:
        raise BadContent(bad.kind, f"{name}.{bad.field}", at + bad.offset) from None


def _valid_items(step: ItemsStep, data: bytes, number: int, at: int) -> list[int]:
    items = unpack_items(step, data, number)
    stray = not step.packed and any(
        step.item.stray(data[start : start + step.item_size])
        for start in range(0, step.item_size * number, step.item_size)
    )
    if stray or any(broken(step.conditions, item) for item in items):
        raise BadContent("range", step.name, at)
    return items


def _valid(name: str, integer: Integer, rules: tuple[Condition, ...], data: bytes, at: int) -> int:
    """The integer at the beginning of ``data``, checked against the rules."""
    own = data[: integer.size]
    value = integer.unpack(own)
    if integer.stray(own) or broken(rules, value):
        raise BadContent("range", name, at)
    return value


def _members(step: BitsStep, whole: int, at: int) -> dict[str, Raw]:
    found: dict[str, Raw] = {}
    for member in step.members:
        value = member.of(whole)
        if broken(member.conditions, value):
            raise BadContent("range", member.name, at)
        found[member.name] = value
    return found
