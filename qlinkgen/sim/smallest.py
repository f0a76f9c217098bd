"""The smallest legal values of the fields of a generated module."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from qlinkgen.link.codec import Message

#: Name of a rule class of a generated module to its smallest legal value.
_SMALLEST: Mapping[str, Callable[[Any], object]] = {  # Any: a rule of the module's own, of the class named
    "IntRule": lambda rule: rule.ranges[0][0],
    "MaskRule": lambda rule: 0,  # noqa: ARG005
    "ArrayRule": lambda rule: [rule.item.ranges[0][0]] * rule.fewest,
    "BytesRule": lambda rule: bytes(rule.fewest),
    "TextRule": lambda rule: " " * rule.fewest,
    "ScaledRule": lambda rule: min(rule.scale.value(rule.scale.low), rule.scale.value(rule.scale.high)),
    "FloatRule": lambda rule: rule.bounds[0] if rule.bounds else 0.0,
    "PaddedRule": lambda rule: _smallest(rule.rule),
    "ListRule": lambda rule: [_smallest(rule.item)] * rule.fewest,
    "RecordRule": lambda rule: _record(rule.kind),
    "RecordsRule": lambda rule: [_record(rule.kind) for _ in range(rule.fewest)],
}
#: Name of a rule class to as many smallest items as asked for.
_REPEATED: Mapping[str, Callable[[Any, int], object]] = {  # Any: as above
    "ArrayRule": lambda rule, count: [rule.item.ranges[0][0]] * count,
    "BytesRule": lambda _, count: bytes(count),
    "TextRule": lambda _, count: " " * count,
}


def items_of(message: type[Message], name: str, count: int) -> dict[str, object]:
    """Return as many items of a field as asked for; nothing for records, which have no smallest value."""
    rule = next((rule for rule in getattr(message, "RULES", ()) if rule.name == name), None)
    make = _REPEATED.get(type(rule).__name__)
    return {name: make(rule, count)} if make else {}


def required_values(message: Callable[..., object]) -> dict[str, object]:
    """Return a legal value for each field of a class of messages or records that has no default.

    An address is none of them.
    """
    rules = {rule.name: rule for rule in getattr(message, "RULES", ())}
    parameters = inspect.signature(message).parameters.values()
    return {
        each.name: _smallest(rules[each.name])
        for each in parameters
        if each.kind is each.KEYWORD_ONLY
        and each.default is each.empty
        and each.name != getattr(message, "ADDRESS", "")  # which records do not have
    }


def _smallest(rule: Any) -> object:
    return _SMALLEST[type(rule).__name__](rule)


def _record(kind: Callable[..., object]) -> object:
    return kind(**required_values(kind))
