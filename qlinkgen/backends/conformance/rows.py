"""Vectors of the kit: the values of the C struct as bytes, and the frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from decimal import Decimal
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.conformance.sources import Header, JsonObject, Sources
from qlinkgen.model.fields import Record, Records, Value, chosen
from qlinkgen.model.message import Message
from qlinkgen.model.naming import record_key
from qlinkgen.model.values import Native, default_of, from_json, raw_number
from qlinkgen.plan import MessagePlan, Plan
from qlinkgen.plan.payload import (
    BytesStep,
    Holder,
    ItemsStep,
    Member,
    PayloadPlan,
    Presence,
    RecordsStep,
    RecordStep,
    RunStep,
    ValueStep,
)
from qlinkgen.plan.walk import present


@dataclass(frozen=True, slots=True)
class Right:
    """A valid frame. ``values`` are the values of the struct, numbers big-endian."""

    message: Message
    kinds: tuple[str, ...]
    address: int
    values: bytes
    payload: bytes
    wire: bytes
    request: bytes = b""
    #: Values of the frame, raw, by name.
    beside: Mapping[str, int] = field(default_factory=dict)
    #: It is decoded but never sent.
    decode_only: bool = False
    #: Source of a vector worked out by hand.
    source: str = ""

    @property
    def by_hand(self) -> bool:
        """Whether it was worked out by hand; generated vectors have kinds."""
        return not self.kinds


@dataclass(frozen=True, slots=True)
class Wrong:
    """A frame that must be rejected, and the reason."""

    message: Message
    kind: str
    what: str
    wire: bytes
    request: bytes = b""
    #: Where it comes from, for a vector that was worked out by hand.
    source: str = ""

    @property
    def by_hand(self) -> bool:
        """Whether it was worked out by hand; generated faults have a description."""
        return not self.what


Row = Right | Wrong
_NONE: Mapping[str, int] = {}


def rows_of(plan: Plan, sources: Sources) -> dict[str, list[Row]]:
    """Vectors by the full name of their message, wrong ones among valid ones.

    The last vector of a message is valid, so that the receiver is empty after it.
    """
    right: dict[str, list[Right]] = {message.name: [] for message in plan.messages}
    wrong: dict[str, list[Wrong]] = {message.name: [] for message in plan.messages}
    for document in (sources.generated, sources.by_hand):
        for entry in document.get("vectors", ()):
            if entry["message"] in right:
                right[entry["message"]].append(_right(plan, sources.header, entry))
        for entry in document.get("faults", ()):
            if entry["message"] in wrong:
                wrong[entry["message"]].append(_wrong(plan, entry))
    return {name: _mixed(right[name], wrong[name]) for name in right}


def _mixed(right: Sequence[Right], wrong: Sequence[Wrong]) -> list[Row]:
    mixed: list[Row] = []
    for index, row in enumerate(right):
        mixed += wrong[index * len(wrong) // len(right) : (index + 1) * len(wrong) // len(right)]
        mixed.append(row)
    return mixed


def _right(plan: Plan, header: Header, entry: JsonObject) -> Right:
    planned = plan.by_name[entry["message"]]
    message = planned.message
    kinds = tuple(kind for kind in entry.get("kinds", ()) if kind != "example")
    beside = _beside(plan, message, entry)
    return Right(
        message=message,
        kinds=kinds,
        address=entry.get(record_key(plan.frame.address), message.default_address),
        values=_numbers(plan, header, beside)
        + _values(
            header, message.values, planned.payload, entry["fields"], entry.get("raw", {}), beside=beside
        ),
        payload=bytes.fromhex(entry["payload"]),
        wire=bytes.fromhex(entry["wire"]),
        request=bytes.fromhex(entry.get("request", "")),
        beside=beside,
        decode_only=entry.get("decode_only", False),
        source="" if kinds else _source(entry) or "an example of the document",
    )


def _wrong(plan: Plan, entry: JsonObject) -> Wrong:
    return Wrong(
        message=plan.by_name[entry["message"]].message,
        kind=entry["kind"],
        what=f"{entry['part']}: {entry['what']}" if "what" in entry else "",
        wire=bytes.fromhex(entry["wire"]),
        request=bytes.fromhex(entry.get("request", "")),
        source="" if "what" in entry else _source(entry),
    )


def _source(entry: JsonObject) -> str:
    return ": ".join(str(entry[key]) for key in ("source", "work") if entry.get(key))


# Values


def held(message: MessagePlan) -> Sequence[Holder]:
    """What a vector has values of: the frame, then the message."""
    return (*(member for _, member in message.envelope.values), *message.payload.settable)


def presences(held: Sequence[Holder]) -> dict[str, Presence]:
    """What decides about fields that may be absent, by the first value of each."""
    found: dict[str, Presence] = {}
    last = None
    for step in held:
        if step.presence is not None and step.presence != last:
            found[step.name] = step.presence
        last = step.presence
    return found


def _beside(plan: Plan, message: Message, entry: JsonObject) -> dict[str, int]:
    """The values of the frame by name, raw."""
    found: dict[str, int] = {}
    for value in plan.protocol.beside(message):
        key = record_key(value.name)
        native = from_json(value, entry[key]) if key in entry else default_of(value)
        found[value.name] = (
            int.from_bytes(native.encode("ascii"), "big")
            if isinstance(native, str)
            else raw_number(value.name, plan.beside[value.name].number, native)
        )
    return found


def _numbers(plan: Plan, header: Header, beside: Mapping[str, int]) -> bytes:
    """The values of the frame as a vector has them."""
    return b"".join(number_bytes(raw, header.width(plan.beside[name].number)) for name, raw in beside.items())


def most_values(header: Header, holders: Sequence[Holder]) -> int:
    """Maximum size of these values in a vector."""
    return sum(_most(header, step) for step in holders) + len(presences(holders))


def value_sizes(header: Header, holders: Sequence[Holder], values: bytes) -> list[int]:
    """Size of each value in a vector."""
    sizes: list[int] = []
    before = presences(holders)
    numbers: dict[str, int] = {}
    for step in holders:
        told = int(step.name in before)
        if step.presence is not None and step.presence.slot:
            told = 0
            if not present(step.presence, numbers, 0):
                sizes.append(0)
                continue
        if isinstance(step, ValueStep | Member):
            at = sum(sizes) + told
            raw = values[at : at + header.width(step.number)]
            numbers[step.name] = int.from_bytes(raw, "big", signed=step.number.signed)
        sizes.append(told + _value_size(header, step, values[sum(sizes) + told :]))
    return sizes


def _value_size(header: Header, step: Holder, values: bytes) -> int:
    """Size of the value that a vector begins with."""
    match step:
        case ValueStep() | Member():
            return header.width(step.number)
        case RecordStep():
            return sum(value_sizes(header, step.record.payload.settable, values))
        case BytesStep() | ItemsStep() | RecordsStep():
            size = _counted(header, step)
            count = int.from_bytes(values[:size], "big") if size else step.length.maximum
            if not isinstance(step, RecordsStep):
                return size + _item(header, step) * count
            for _ in range(count):
                size += sum(value_sizes(header, step.record.payload.settable, values[size:]))
            return size
        case _:
            assert_never(step)


def _most(header: Header, step: Holder) -> int:
    match step:
        case ValueStep() | Member():
            return header.width(step.number)
        case RecordStep():
            return most_values(header, step.record.payload.settable)
        case BytesStep() | ItemsStep() | RecordsStep():
            return _counted(header, step) + _item(header, step) * step.length.maximum
        case _:
            assert_never(step)


def _counted(header: Header, run: RunStep) -> int:
    """Size of the struct member that counts a run, 0 if its size is constant."""
    return 0 if run.fixed else header.count_width(run.length.maximum)


def _item(header: Header, run: RunStep) -> int:
    """Size of an item of a run in the struct."""
    match run:
        case BytesStep():
            return 1
        case ItemsStep():
            return header.width(run.number)
        case RecordsStep():
            return most_values(header, run.record.payload.settable)
        case _:
            assert_never(run)


def _values(
    header: Header,
    stated: Sequence[Value],
    payload: PayloadPlan,
    fields: JsonObject,
    raw: JsonObject,
    *,
    beside: Mapping[str, int] = _NONE,
) -> bytes:
    """The values of a message in a frame with the values ``beside``, or of a record."""
    before, data = presences(payload.settable), b""
    decided = payload.decided(beside)
    own = chosen(
        stated,
        lambda name: decided[name] if name in decided else _number(stated, payload, name, fields, raw),
    )
    for value, step in zip(stated, payload.settable, strict=True):
        if value.field.slot:
            sent = value in own and _native(value, fields) is not None
            data += _value(header, value, step, fields, raw.get(value.name)) if sent else b""
            continue
        absent = step.presence is not None and _native(value, fields) is None
        data += bytes((not absent,)) if value.name in before else b""
        if absent:
            data += _value(header, _always(value), step, {}, None)
        else:
            data += _value(header, value, step, fields, raw.get(value.name))
    return data


def _number(
    stated: Sequence[Value], payload: PayloadPlan, name: str, fields: JsonObject, raw: JsonObject
) -> int | None:
    """A raw number, None if it is absent."""
    pairs = zip(stated, payload.settable, strict=True)
    value, step = next((value, step) for value, step in pairs if value.name == name)
    assert isinstance(step, ValueStep | Member)
    given, native = raw.get(name), _native(value, fields)
    if isinstance(given, int) or native is None:
        return given if isinstance(given, int) else None
    return raw_number(name, step.number, native)


def _always(value: Value) -> Value:
    """The value with its default, which the struct holds where its field is absent."""
    return replace(value, field=replace(value.field, given=True))


def _value(header: Header, value: Value, step: Holder, fields: JsonObject, raw: object) -> bytes:
    """One value: a number, or the items of a run with their count if it varies."""
    if isinstance(step, RecordStep | RecordsStep):
        return _records(header, value, step, fields, raw)
    native = _native(value, fields)
    match step:
        case ValueStep() | Member():
            number = raw if isinstance(raw, int) else raw_number(value.name, step.number, native)
            return number_bytes(number, header.width(step.number))
        case BytesStep():
            assert isinstance(native, bytes | str)
            items = native.encode("ascii") if isinstance(native, str) else native
            items = step.padded(items) if step.pad else items
        case ItemsStep():
            assert isinstance(native, list)
            raws = raw if isinstance(raw, list) else None
            raws = [raw_number(value.name, step.number, item) for item in native] if raws is None else raws
            items = b"".join(number_bytes(item, _item(header, step)) for item in raws)
        case _:
            assert_never(step)
    counted = _counted(header, step)
    return (number_bytes(len(native), counted) if counted else b"") + items


def _records(
    header: Header, value: Value, step: RecordStep | RecordsStep, fields: JsonObject, raw: object
) -> bytes:
    assert isinstance(value.type, Record | Records)
    found = fields.get(value.name, {} if isinstance(step, RecordStep) else [{}] * step.length.minimum)
    records: Sequence[JsonObject] = [found] if isinstance(step, RecordStep) else found
    raws = raw if isinstance(raw, list) else [raw or {}] * len(records)
    stated, payload = value.type.layout.values, step.record.payload
    values = [_values(header, stated, payload, *pair) for pair in zip(records, raws, strict=True)]
    counted = _counted(header, step) if isinstance(step, RecordsStep) else 0
    return (number_bytes(len(records), counted) if counted else b"") + b"".join(values)


def _native(value: Value, fields: JsonObject) -> Native:
    """The value of an entry, or the default."""
    if value.name not in fields:
        return default_of(value)
    given = fields[value.name]
    return from_json(value, Decimal(str(given)) if isinstance(given, float) else given)


def number_bytes(raw: int, width: int) -> bytes:
    """A big-endian number of a vector."""
    return (raw & (1 << 8 * width) - 1).to_bytes(width, "big")


def kinds_in(rows: Mapping[str, Sequence[Row]]) -> Iterator[str]:
    """Names of the kinds of generated vectors, in order of first use."""
    yield from dict.fromkeys(
        kind for each in rows.values() for row in each if isinstance(row, Right) for kind in row.kinds
    )
