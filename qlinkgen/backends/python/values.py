"""Values in Python: type, default, rule and description."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal
from itertools import groupby
from operator import itemgetter
from typing import assert_never

from qlinkgen.backends import python_text
from qlinkgen.backends.python.layout import Call, indented, literal
from qlinkgen.backends.python.names import attribute, held
from qlinkgen.backends.python.place import Place
from qlinkgen.backends.python.varied import any_of, is_last, is_opened, of_attribute
from qlinkgen.model.condition import Test
from qlinkgen.model.frame import PartBits
from qlinkgen.model.message import Value
from qlinkgen.model.types import Characters, Enum, Flags, Float, Scalar
from qlinkgen.model.values import Native, native_from_raw
from qlinkgen.plan.openings import openings
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ConstantStep,
    CountStep,
    FilledStep,
    Holder,
    ItemsStep,
    Member,
    PayloadPlan,
    Presence,
    RecordPlan,
    RecordsStep,
    RecordStep,
    ReservedStep,
    Step,
    ValueStep,
    first_case,
    holders,
    is_required,
)
from qlinkgen.plan.tree import MessagePlan

#: The steps with one value: the cases of a choice, or a single one.
Slot = Sequence[Holder]


def annotation(slot: Slot, place: Place) -> str:
    """Type of the attribute."""
    kinds = dict.fromkeys(part for each in slot for part in _annotation(each, place).split(" | "))
    if "float" in kinds:
        kinds.pop("int", None)  # type checkers take an int for a float
    return " | ".join((*kinds, "None") if slot[0].presence is not None else kinds)


def _annotation(each: Holder, place: Place) -> str:
    match each:
        case ItemsStep():
            return f"list[{_number_type(each.number, place)}]"
        case BytesStep():
            return "str" if each.text else "bytes"
        case ValueStep() | Member():
            return _number_type(each.number, place)
        case RecordStep():
            return place.classes[each.record.name]
        case RecordsStep():
            return f"list[{place.classes[each.record.name]}]"
        case _:
            assert_never(each)


def _number_type(number: Scalar, place: Place) -> str:
    match number.meaning:
        case Enum() as enum:
            return f"{place.classes[enum.name]} | int"
        case "bool":
            return "bool"
        case Characters():
            return "str"
        case Flags() | Float() | None:
            return place.use("Decimal") if number.number == "decimal" else number.number
        case _:
            assert_never(number.meaning)


def argument(slot: Slot, place: Place) -> str:
    """Parameter of a function for the value, with its default if it has one."""
    each = first_case(slot)
    kind, name = annotation(slot, place), held(each)
    if is_required(each):
        return f"{name}: {kind}"
    if each.presence is not None:
        return f"{name}: {kind} = {place.use('NEW') if _decided(slot) else 'None'}"
    if isinstance(each, ItemsStep | RecordStep | RecordsStep):
        return f"{name}: {kind} | None = None"
    return f"{name}: {kind} = {default(each, place)}"


def assignment(slot: Slot, place: Place) -> list[str]:
    """The statements that store an argument; each message gets a new list or record as a default."""
    each = first_case(slot)
    name = held(each)
    if cases := _decided(slot):
        return [f"if {name} is NEW:", *indented(_usual(name, cases, place)), *_otherwise(name)]
    if each.presence is None and isinstance(each, ItemsStep | RecordStep | RecordsStep) and not each.required:
        return [f"self.{name} = {default(each, place)} if {name} is None else {name}"]
    return [f"self.{name} = {name}"]


def _decided(slot: Slot) -> list[tuple[Holder, Presence]]:
    """The cases of a value that earlier values decide, each with its condition."""
    return [(each, each.presence) for each in slot if each.presence is not None and each.presence.when]


def _usual(name: str, cases: Sequence[tuple[Holder, Presence]], place: Place) -> list[str]:
    """The statements that store the default of the case that earlier values decide on, None if of none."""
    lines, word = list[str](), "if"
    usual = [(default(each, place), [*map(of_attribute, presence.when)]) for each, presence in cases]
    for value, alike in groupby(usual, itemgetter(0)):
        lines += [f"{word} {any_of((tests for _, tests in alike), 'self.{}')}:", f"    self.{name} = {value}"]
        word = "elif"
    return [*lines, "else:", f"    self.{name} = None"]


def _otherwise(name: str) -> list[str]:
    return ["else:", f"    self.{name} = {name}"]


def required_defaults(payload: PayloadPlan, place: Place) -> list[str]:
    """Arguments for values without a default in the class."""
    return [f"{attribute(e.name)}={default(e, place)}" for e in payload.settable if is_required(e)]


def default(each: Holder, place: Place) -> str:
    """Expression for the default."""
    match each:
        case ItemsStep():
            return f"[{', '.join(_number(each.number, raw, place) for raw in each.default)}]"
        case BytesStep() if each.text and place.texts:
            return python_text.literal(each.default.decode("ascii"))
        case BytesStep() if each.text:
            return f'bytes({list(each.default)}).decode("ascii")' if each.default else '""'
        case BytesStep():
            return literal(each.default)
        case ValueStep() | Member():
            return _number(each.number, each.number.default, place)
        case RecordStep():
            return _default_record(each.record, place)
        case RecordsStep():
            return f"[{', '.join([_default_record(each.record, place)] * each.length.minimum)}]"
        case _:
            assert_never(each)


def _default_record(record: RecordPlan, place: Place) -> str:
    return f"{place.classes[record.name]}({', '.join(required_defaults(record.payload, place))})"


def _number(number: Scalar, raw: int, place: Place) -> str:
    """Expression for the native value of a raw number."""
    match number.meaning:
        case Enum() as enum:
            member = enum.name_of(raw)
            return f"{place.classes[enum.name]}.{member.upper()}" if member else str(raw)
        case Flags():
            return f"0x{raw:X}" if raw else "0"
        case Characters() as text:
            return python_text.literal(text.text(raw))
        case Float() | "bool" | None:
            return _native(native_from_raw(number, raw))
        case _:
            assert_never(number.meaning)


def _native(value: Native) -> str:
    if isinstance(value, Decimal):
        whole = value == value.to_integral_value()
        return f"Decimal({value})" if whole else f'Decimal("{value}")'
    if isinstance(value, float) and not math.isfinite(value):
        return f'float("{value}")'
    return repr(value)


def counter_fact(counter: PartBits) -> str:
    """A counter of frames as a tuple: attribute, number of values, and what it counts."""
    assert counter.counting is not None
    facts = (1 << counter.bits, counter.counting.per_frame, counter.counting.echo)
    return f'("{attribute(counter.name)}", {facts[0]}, {facts[1]}, {facts[2]})'


# Scales and rules


def scale_arguments(number: Scalar, place: Place) -> str:
    """Class and arguments of the constant that converts a scaled value."""
    assert number.scaling is not None
    scaling = number.scaling
    kind = "DecimalScale" if number.number == "decimal" else "Scale"
    settings = {"factor": (scaling.factor, 1), "bias": (scaling.bias, 0), "divisor": (scaling.divisor, 1)}
    given = [f"{key}={value}" for key, (value, usual) in settings.items() if value != usual]
    return f"{place.use(kind)}({', '.join([str(number.minimum), str(number.maximum), *given])})"


def rules(message: MessagePlan, place: Place, scales: Mapping[str, str]) -> list[Call]:
    """The rules of a message, those of address and values of its frame first."""
    found: list[Call] = []
    if message.allowed is not None and place.address:
        bounds = [str(bound) for each in message.allowed.ranges for bound in (each.low, each.high)]
        found.append(_rule(place, "IntRule", place.address, *bounds))
    for member in place.beside:
        found += _member_rules(member, place, scales)
    choices: dict[str, list[tuple[Presence, Call]]] = {}
    for step in message.payload.steps:
        rules = _rules(step, place, scales)
        if step.presence is None or not step.presence.slot:
            found += rules
            continue
        if step.presence.slot not in choices:
            found.append(Call("", [step.presence.slot]))
        choices.setdefault(step.presence.slot, []).append((step.presence, rules[0]))
    return [each if each.name else _choice_rule(choices[each.arguments[0]], place) for each in found]


def _choice_rule(cases: Sequence[tuple[Presence, Call]], place: Place) -> Call:
    """The rule of a choice: that of the case which the tested value selects."""
    first = cases[0][0]
    given = [f'"{attribute(first.slot)}"', f'"{attribute(first.choosing.value)}"']
    for presence, rule in cases:
        test = presence.choosing
        given.append(f"({test.ranges!r}, {test.negated}, {rule.flat})")
    return Call(place.use("ChoiceRule"), given)


def _rule(place: Place, kind: str, name: str, *arguments: object, unit: str = "") -> Call:
    given = [f'"{name}"', *map(str, arguments), *([f"unit={python_text.literal(unit)}"] if unit else [])]
    return Call(place.use(kind), given)


def _rules(step: Step, place: Place, scales: Mapping[str, str]) -> list[Call]:
    """The rules of a step."""
    rules = _plain_rules(step, place, scales)
    if step.presence is None or step.presence.slot:
        return rules
    settable = {held(each) for each in holders((step,))}
    return [_maybe(each, place) if each.arguments[0].strip('"') in settable else each for each in rules]


def _maybe(rule: Call, place: Place) -> Call:
    return Call(place.use("MaybeRule"), [rule.flat])


def _plain_rules(step: Step, place: Place, scales: Mapping[str, str]) -> list[Call]:
    name = held(step)
    match step:
        case ConstantStep():
            return [_rule(place, "ConstantRule", name, step.value, *step.accepted)]
        case CountStep():
            return [_rule(place, "CountRule", name, f'"{step.run}"')]
        case ReservedStep() | FilledStep():
            return []
        case BitsStep():
            return [rule for member in step.members for rule in _member_rules(member, place, scales)]
        case BytesStep():
            return [_octets_rule(step, place)]
        case ItemsStep():
            length, item = step.length, step.number
            if not _is_whole(item):
                inner = _number_rule(name, item, place, scales, step.name)
                return [Call(place.use("ListRule"), [str(length.minimum), str(length.maximum), inner.flat])]
            bounds = (length.minimum, length.maximum, item.minimum, item.maximum)
            return [_rule(place, "ArrayRule", name, *bounds, unit=item.unit)]
        case ValueStep():
            return [_number_rule(name, step.number, place, scales, step.name)]
        case RecordStep() | RecordsStep():
            return [_record_rule(step, place)]
        case _:
            assert_never(step)


def _octets_rule(step: BytesStep, place: Place) -> Call:
    name, sizes = held(step), (step.least, step.length.maximum)
    if step.excluded:
        kind = "BetweenRule" if step.text else "WithoutRule"
        return _rule(place, kind, name, *sizes, literal(step.excluded))
    rule = _rule(place, "TextRule" if step.text else "BytesRule", name, *sizes)
    return Call(place.use("PaddedRule"), [rule.flat, literal(step.pad)]) if step.pad else rule


def _record_rule(step: RecordStep | RecordsStep, place: Place) -> Call:
    name, kind = held(step), place.classes[step.record.name]
    if isinstance(step, RecordStep):
        return _rule(place, "RecordRule", name, kind)
    if step.last:
        rule = _rule(place, "EndedRule", name, kind, step.length.maximum, is_last(step))
    else:
        rule = _rule(place, "RecordsRule", name, kind, step.length.minimum, step.length.maximum)
    return Call(place.use("OpenRule"), [rule.flat, is_opened(step)]) if openings(step) else rule


def _is_whole(number: Scalar) -> bool:
    """Whether the value is any whole number in a range."""
    match number.meaning:
        case Float():
            return False
        case Flags() as flags:
            return not flags.reserved_zero
        case Characters():
            return False
        case Enum() | "bool" | None:
            return number.scaling is None
        case _:
            assert_never(number.meaning)


def _member_rules(member: Member, place: Place, scales: Mapping[str, str]) -> list[Call]:
    return [_number_rule(attribute(member.name), member.number, place, scales, member.name)]


def _number_rule(name: str, number: Scalar, place: Place, scales: Mapping[str, str], field: str) -> Call:
    """The rule of an attribute for the number of a field."""
    if number.scaling is not None:
        return _rule(place, "ScaledRule", name, scales[field], unit=number.unit)
    match number.meaning:
        case Flags(reserved_zero=True) as flags:
            return _rule(place, "MaskRule", name, f"0x{flags.mask:X}")
        case Float() as kind:
            return _rule(
                place,
                "FloatRule",
                name,
                kind.bits,
                *map(python_text.real, kind.bounds or ()),
                unit=number.unit,
            )
        case Characters(size, b""):
            return _rule(place, "TextRule", name, size, size)
        case Characters(size, excluded):
            return _rule(place, "BetweenRule", name, size, size, literal(excluded))
        case Flags() | Enum() | "bool" | None:
            return _rule(place, "IntRule", name, number.minimum, number.maximum, unit=number.unit)
        case _:
            assert_never(number.meaning)


# Descriptions


def description(cases: Sequence[tuple[Value, Holder]], place: Place) -> str:
    """Description, range and unit of a value, and whether its source is weak, as one paragraph.

    ``cases`` are those of a choice, or the value alone.
    """
    (value, each), *_ = cases
    text = value.doc.rstrip(".")
    facts = [_facts(each, place)]
    if value.field.slot:
        facts = [_case_text(each, place) for _, each in cases]
    if value.field.section:
        facts.append(f"section {value.field.section}")
    if not value.field.confirmed:
        facts.append("UNCONFIRMED: check it on the device")
    detail = "; ".join(fact for fact in facts if fact)
    return f"{text}; {detail}." if text and detail else f"{text or detail}."


def _case_text(each: Holder, place: Place) -> str:
    """What a choice is in one case."""
    assert each.presence is not None
    where = "otherwise" if each.presence.choosing.negated else f"where {condition_text(each.presence)}"
    return f"{_facts(each, place) or 'a number'} {where}"


def condition_text(presence: Presence) -> str:
    """What decides whether a field is present, in words."""
    if presence.optional:
        return "all fields before it are given"
    return " and ".join(_test_text(test) for test in presence.when)


def _test_text(test: Test) -> str:
    ranges = (str(low) if low == high else f"{low}..{high}" for low, high in test.ranges)
    return f"{attribute(test.value)} is {'not ' if test.negated else ''}{' or '.join(ranges)}"


def _facts(each: Holder, place: Place) -> str:
    match each:
        case BytesStep():
            kind = "characters" if each.text else "bytes"
            return f"{span(each.least, each.length.maximum)} {kind}"
        case ItemsStep():
            items, facts = span(each.length.minimum, each.length.maximum), _number_facts(each.number, place)
            return f"{items} items, each {facts}" if facts else f"{items} items"
        case ValueStep() | Member():
            return _number_facts(each.number, place)
        case RecordStep():
            return "a record"
        case RecordsStep():
            return f"{span(each.length.minimum, each.length.maximum)} records"
        case _:
            assert_never(each)


def _number_facts(number: Scalar, place: Place) -> str:
    match number.meaning:
        case Flags() as flags:
            return f"masks of {place.classes[flags.name]}"
        case Enum() | "bool":
            return ""
        case Float() as kind if kind.bounds is None:
            return f"{kind.name}{_of(number)}"
        case Characters() as text:
            return f"{text.number} characters"
        case Float() | None:
            pass
        case _:
            assert_never(number.meaning)
    low, high = number.span
    step = f" in steps of {number.scaling.scale}" if number.scaling else ""
    return f"{low}..{high}{_of(number)}{step}"


def _of(number: Scalar) -> str:
    return f" {number.unit}" if number.unit else ""


def span(low: int, high: int) -> str:
    """``low..high``, or one number if they are equal."""
    return str(low) if low == high else f"{low}..{high}"
