"""Puts the fields of cases in place of choices that a schema cannot state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from qlinkgen.importers.ksy.choices import number_of_case
from qlinkgen.importers.ksy.flat import Flat, flat
from qlinkgen.importers.ksy.scalars import scalar
from qlinkgen.importers.ksy.tree import Attribute, Refused, Type
from qlinkgen.importers.names import schema_name


def opened(found: Flat, *, every: bool = False) -> Flat:
    """The sequence with the fields of cases in place of choices.

    Args:
        found: The sequence.
        every: Whether there may be no choices; otherwise those remain that a schema can state.
    """
    result = Flat(records=dict(found.records), groups=list(found.groups))
    for each in found.attributes:
        if (
            each.switch is None
            or each.trouble
            or each.text("repeat")
            or each.text("size")
            or (not every and not each.text("if") and _is_closed(each))
        ):
            result.attributes.append(each)
            continue
        cases = _cases(each)
        first = cases[0][0] if cases else None
        if first is not None and _are_same(each, [type_ for type_, _ in cases]):
            _put(result, flat(first, (*each.within, each.id)), each.given, every=every)
            continue
        for type_, numbers in cases:
            shown = type_.name.rpartition("::")[2]
            part = flat(type_, (*each.within, f"{each.id}@{shown}"))
            _put(result, part, (*each.given, (each, numbers)), shown, every=every)
    return result


def _cases(attribute: Attribute) -> list[tuple[Type, tuple[int, ...]]]:
    """The types of a choice with the numbers of their cases; no numbers for all others. Raises Refused."""
    switch = attribute.switch
    assert switch is not None
    found: dict[str, list[int]] = {}
    for key, value in switch.mapping("cases"):
        numbers = found.setdefault(value.word, [])
        if key != "_":
            numbers.append(number_of_case(key, value, attribute.scope))
    types: list[tuple[Type, tuple[int, ...]]] = []
    for name, numbers in found.items():
        type_ = attribute.scope.find_type(name) if name else None
        if type_ is None and scalar(name, "le") is not None:
            type_ = _single(attribute, name)
        if type_ is None:
            raise Refused(switch, f"the type '{name[:60]}' of a case is not in this file")
        types.append((type_, tuple(numbers)))
    return types


def _single(attribute: Attribute, name: str) -> Type:
    """A type with a number as its only field."""
    scope = attribute.scope
    node = replace(attribute.node, value={"id": attribute.id, "type": name})
    type_ = Type(name, node, scope, scope.endian, scope.bit_endian, scope.encoding)
    type_.attributes.append(Attribute(attribute.id, node, type_))
    return type_


def _are_same(attribute: Attribute, types: Sequence[Type]) -> bool:
    """Whether all cases have the same fields, with a note; a choice inside of one case needs that, too."""
    first = [each.node.value for each in types[0].attributes]
    if any([each.node.value for each in other.attributes] != first for other in types[1:]):
        return False
    inner = flat(types[0]).attributes
    if attribute.text("if") or (len(types) == 1 and all(each.switch is None for each in inner)):
        return False
    attribute.notes.add(
        attribute.line, f"the cases of {attribute.id[:60]} have the same fields: other numbers have them, too"
    )
    return True


def _put(
    result: Flat,
    part: Flat,
    given: tuple[tuple[Attribute, tuple[int, ...]], ...],
    shown: str = "",
    *,
    every: bool,
) -> None:
    part.attributes = [
        replace(
            each, given=given, label=schema_name(f"{shown}_{each.label or each.id}") if shown else each.label
        )
        for each in part.attributes
    ]
    part = opened(part, every=every)
    result.attributes += part.attributes
    result.groups += part.groups
    result.records |= part.records


def _is_closed(attribute: Attribute) -> bool:
    assert attribute.switch is not None
    for _, value in attribute.switch.mapping("cases"):
        inner = attribute.scope.find_type(value.word) if value.word else None
        if inner is not None and any(_is_open(each) for each in flat(inner).attributes):
            return False
    return True


def _is_open(attribute: Attribute) -> bool:
    """Whether a record cannot have a field: it takes the rest, ends with a byte, or is a choice."""
    if attribute.switch is not None or attribute.text("size-eos") == "true":
        return True
    if attribute.text("repeat") in ("eos", "until"):
        return True
    return attribute.type in ("str", "strz") and not attribute.text("size")
