"""Native values of raw ones, as callers of generated Python see them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import assert_never

from qlinkgen.model.types import Characters
from qlinkgen.model.values import Native, native_from_raw
from qlinkgen.plan.content import Raw
from qlinkgen.plan.payload import (
    BytesStep,
    Holder,
    ItemsStep,
    Member,
    PayloadPlan,
    RecordsStep,
    RecordStep,
    ValueStep,
)
from qlinkgen.plan.walk import of_values


def native_of(step: Holder, raw: Raw) -> Native:
    """The native Python value of a raw value, None for an absent one."""
    if raw is None:
        return None
    match step:
        case ValueStep() | Member():
            assert isinstance(raw, int)
            kind = step.number.meaning
            return kind.text(raw) if isinstance(kind, Characters) else native_from_raw(step.number, raw)
        case BytesStep(text=True):
            assert isinstance(raw, bytes)
            return raw.decode("ascii")
        case BytesStep():
            assert isinstance(raw, bytes)
            return raw
        case ItemsStep():
            assert isinstance(raw, list)
            return [native_from_raw(step.number, item) for item in raw]
        case RecordStep():
            return _record(step.record.payload, raw)
        case RecordsStep():
            assert isinstance(raw, list)
            return [_record(step.record.payload, each) for each in raw]
        case _:
            assert_never(step)


def _record(plan: PayloadPlan, raw: Raw) -> Mapping[str, Native]:
    assert isinstance(raw, Mapping)
    return {name: native_of(each, value) for name, (each, value) in of_values(plan, raw).items()}
