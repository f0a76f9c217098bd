"""Native values as generated Python takes them: its own objects for records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from qlinkgen.model.fields import Record, Records, Value, chosen
from qlinkgen.model.naming import attribute
from qlinkgen.model.values import Json, Native, check_items, default_of, natives_of

#: Classes of a generated module by the name of their record.
RecordClasses = Mapping[str, Callable[..., object]]


def attributes_of(
    records: RecordClasses, values: Sequence[Value], given: Mapping[str, Json]
) -> dict[str, object]:
    """Return arguments for the constructor of a message, from values of JSON or a command line.

    Raises:
        BadValue: a value is illegal; the constructor checks what depends on others.
    """
    natives = natives_of(values, given)
    numbers = {value.name: default_of(value) for value in values if not value.field.slot}
    own = {value.name: value for value in chosen(values, {**numbers, **natives}.get)}
    for name, native in natives.items():
        check_items(own[name], native)
    return {attribute(name): object_of(records, own[name], native) for name, native in natives.items()}


def object_of(records: RecordClasses, value: Value, native: Native) -> object:
    """Return the value for the constructor of a message: an object of its class for each record."""
    kind = value.type
    if isinstance(kind, Records) and isinstance(native, list):
        one = replace(value, type=Record(kind.layout))
        return [object_of(records, one, each) for each in native]
    if not isinstance(kind, Record) or not isinstance(native, Mapping):
        return native
    own = chosen(kind.layout.values, native.get)
    values = {attribute(each.name): object_of(records, each, native[each.name]) for each in own}
    return records[kind.layout.name](**values)
