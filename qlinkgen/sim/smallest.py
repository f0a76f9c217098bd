"""The smallest legal values of the fields of a generated module."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias, TypeVar

from qlinkgen.link.codec import Message

#: A rule of a generated module, of the class named beside it, which the module has of its own.
Rule: TypeAlias = Any
Made = TypeVar("Made")

#: Characters of text, most usual first.
_CHARACTERS = " " + "".join(map(chr, (*range(0x30, 0x7F), *range(0x21, 0x30), *range(0x20), 0x7F)))


def _bytes(rule: Rule, count: int) -> bytes:
    """So many bytes of the lowest value that the rule allows."""
    return next(byte for each in range(256) if rule.allows((byte := bytes([each])) * rule.most)) * count


def _text(rule: Rule, count: int) -> str:
    """So many spaces, or other characters if the rule excludes spaces."""
    return next(each for each in _CHARACTERS if rule.allows(each * rule.most)) * count


def _maybe(rule: Rule) -> object:
    """The smallest value of a field that is present."""
    return _smallest(rule.rule)


#: Name of a rule class, or of one that it inherits from, to its smallest legal value.
_SMALLEST: Mapping[str, Callable[[Rule], object]] = {
    "IntRule": lambda rule: rule.ranges[0][0],
    "MaskRule": lambda rule: 0,  # noqa: ARG005
    "ArrayRule": lambda rule: [rule.item.ranges[0][0]] * rule.fewest,
    "BytesRule": lambda rule: _bytes(rule, rule.fewest),
    "TextRule": lambda rule: _text(rule, rule.fewest),
    "ScaledRule": lambda rule: min(rule.scale.value(rule.scale.low), rule.scale.value(rule.scale.high)),
    "FloatRule": lambda rule: rule.bounds[0] if rule.bounds else 0.0,
    "PaddedRule": lambda rule: _smallest(rule.rule),
    "MaybeRule": _maybe,
    "OpenRule": lambda rule: _smallest(rule.rule),
    "ListRule": lambda rule: [_smallest(rule.item)] * rule.fewest,
    "RecordRule": lambda rule: _record(rule.kind),
    "RecordsRule": lambda rule: [_record(rule.kind) for _ in range(rule.fewest)],
}
#: Name of a rule class, or of one that it inherits from, to as many smallest items as asked for.
_REPEATED: Mapping[str, Callable[[Rule, int], object]] = {
    "ArrayRule": lambda rule, count: [rule.item.ranges[0][0]] * count,
    "BytesRule": _bytes,
    "TextRule": _text,
}


def items_of(message: type[Message], name: str, count: int) -> dict[str, object]:
    """Return as many items of a field as asked for; nothing for records, which have no smallest value."""
    rule = next((rule for rule in getattr(message, "RULES", ()) if rule.name == name), None)
    make = _nearest(_REPEATED, rule)
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


def with_smallest(message: Made) -> Made:
    """Give a new message legal values for the fields whose defaults are none; return it."""
    for rule in getattr(message, "RULES", ()):
        if _nearest(_SMALLEST, rule) is _maybe and not rule.allows(getattr(message, rule.name)):
            setattr(message, rule.name, _maybe(rule))
    return message


def _smallest(rule: Rule) -> object:
    make = _nearest(_SMALLEST, rule)
    assert make is not None, type(rule)
    return make(rule)


def _nearest(by_class: Mapping[str, Made], rule: Rule) -> Made | None:
    """The function for the class of a rule, or for the nearest one that it inherits from."""
    names = (each.__name__ for each in type(rule).__mro__)
    return next((by_class[name] for name in names if name in by_class), None)


def _record(kind: Callable[..., object]) -> object:
    return kind(**required_values(kind))
