"""What a field is in Python: its type, default, rule and description."""

from __future__ import annotations

from decimal import Decimal

from qlinkgen.backends import python_text
from qlinkgen.backends.python.place import Place, literal
from qlinkgen.model.message import Field, Message, Value
from qlinkgen.model.types import Array, Blob, Enum, Flags, Scalar
from qlinkgen.model.values import default_of


def annotation(value: Value, place: Place) -> str:
    """Type of the attribute."""
    kind = value.type
    if isinstance(kind, Array):
        return "list[int]"
    if isinstance(kind, Blob):
        return "str" if kind.text else "bytes"
    if isinstance(kind.meaning, Enum):
        return f"{place.names.enums[kind.meaning.name]} | int"
    if kind.meaning == "bool":
        return "bool"
    return {"int": "int", "float": "float", "decimal": "Decimal"}[kind.number]


def argument(value: Value, place: Place) -> str:
    """Parameter of a function that takes the value, with its default where it has one."""
    kind = annotation(value, place)
    if value.required:
        return f"{value.name}: {kind}"
    if isinstance(value.type, Array):
        return f"{value.name}: {kind} | None = None"
    return f"{value.name}: {kind} = {default(value, place)}"


def default(value: Value, place: Place) -> str:
    """Expression for the default; that of a list is made anew for each message."""
    kind, native = value.type, default_of(value)
    if isinstance(kind, Scalar) and isinstance(kind.meaning, Enum):
        name = kind.meaning.name_of(kind.default)
        return f"{place.names.enums[kind.meaning.name]}.{name.upper()}" if name else str(kind.default)
    if isinstance(kind, Scalar) and isinstance(kind.meaning, Flags) and kind.default:
        return f"{kind.default:#x}"
    if isinstance(native, str):
        return python_text.literal(native) if place.texts else python_text.numbers(native)
    if isinstance(native, bytes):
        return literal(native)
    return _decimal(native) if isinstance(native, Decimal) else repr(native)


def _decimal(value: Decimal) -> str:
    return f"Decimal({value})" if value == value.to_integral_value() else f'Decimal("{value}")'


def steps_name(scalar: Scalar, name: str) -> str:
    """Name of the constant that converts a scaled field; equal conversions of one name share it."""
    assert scalar.scaling is not None
    scaling = scalar.scaling
    words = [name, "u" if not scalar.signed else "i", str(scalar.bits)]
    parts = [scaling.factor, scaling.bias, scaling.divisor, scalar.minimum, scalar.maximum, scalar.unit]
    return "|".join(map(str, [*words, *parts]))


def steps_arguments(scalar: Scalar, name: str) -> str:
    """Class and arguments of the constant that converts a scaled field."""
    assert scalar.scaling is not None
    scaling = scalar.scaling
    kind = "DecimalSteps" if scalar.number == "decimal" else "Steps"
    numbers = [f"{scalar.minimum}, {scalar.maximum}"]
    numbers += [f"factor={scaling.factor}"] if scaling.factor != 1 else []
    numbers += [f"bias={scaling.bias}"] if scaling.bias else []
    numbers += [f"divisor={scaling.divisor}"] if scaling.divisor != 1 else []
    return f'{kind}("{name}", {", ".join(numbers)}{_unit(scalar.unit)})'


def rules(message: Message, place: Place, steps: dict[str, str]) -> list[str]:
    """Expressions for the rules of a message, the address first."""
    found = [_address(message, place)] if message.addresses and place.address else []
    settable = {value.name: value for value in message.values}
    for each in message.fields:
        inside = [value for value in message.values if value.field is each]
        if not inside and isinstance(each.type, Scalar) and not each.type.reserved:
            found.append(_fixed_rule(each, each.type))
        found += [_rule(settable[value.name], steps) for value in inside]
    return found


def _address(message: Message, place: Place) -> str:
    bounds = ", ".join(f"{low}, {high}" for low, high in message.addresses)
    return f'Whole("{place.address}", {bounds})'


def _fixed_rule(each: Field, scalar: Scalar) -> str:
    if scalar.counts:
        return f'Count("{each.name}", "{scalar.counts}")'
    return f'Constant("{each.name}", {scalar.default})'


def _rule(value: Value, steps: dict[str, str]) -> str:
    kind, name = value.type, value.name
    if isinstance(kind, Blob):
        return f'{"Text" if kind.text else "Octets"}("{name}", {kind.length.minimum}, {kind.length.maximum})'
    if isinstance(kind, Array):
        length, item = kind.length, kind.item
        bounds = f"{length.minimum}, {length.maximum}, {item.minimum}, {item.maximum}"
        return f'Items("{name}", {bounds}{_unit(item.unit)})'
    if kind.scaling is not None:
        return steps[name]
    if isinstance(kind.meaning, Flags) and kind.meaning.reserved_zero:
        return f'Mask("{name}", {kind.meaning.mask:#x})'
    return f'Whole("{name}", {kind.minimum}, {kind.maximum}{_unit(kind.unit)})'


def _unit(unit: str) -> str:
    return f", unit={python_text.literal(unit)}" if unit else ""


def description(value: Value, place: Place) -> str:
    """What the field is, its range and unit, and whether its source is weak; one paragraph."""
    text = value.doc.rstrip(".")
    facts = [_facts(value, place)]
    if value.field.section:
        facts.append(f"section {value.field.section}")
    if not value.field.confirmed:
        facts.append("UNCONFIRMED: check at the device")
    detail = "; ".join(fact for fact in facts if fact)
    return f"{text}; {detail}." if text and detail else f"{text or detail}."


def _facts(value: Value, place: Place) -> str:
    kind = value.type
    if isinstance(kind, Blob):
        return f"{_span(kind.length.minimum, kind.length.maximum)} {'characters' if kind.text else 'bytes'}"
    if isinstance(kind, Array):
        item = kind.item
        items = _span(kind.length.minimum, kind.length.maximum)
        return f"{items} items, each {item.minimum}..{item.maximum}{_of(item)}"
    if isinstance(kind.meaning, Flags):
        return f"masks of {place.names.enums[kind.meaning.name]}"
    if kind.meaning == "bool" or isinstance(kind.meaning, Enum):
        return ""
    low, high = sorted((kind.physical(kind.minimum), kind.physical(kind.maximum)))
    step = f" in steps of {kind.scaling.scale}" if kind.scaling else ""
    return f"{low}..{high}{_of(kind)}{step}"


def _of(scalar: Scalar) -> str:
    return f" {scalar.unit}" if scalar.unit else ""


def _span(low: int, high: int) -> str:
    return str(low) if low == high else f"{low}..{high}"
