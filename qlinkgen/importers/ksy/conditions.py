"""Conditions of a schema from expressions of Kaitai Struct."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from qlinkgen.importers.document import Notation, Value
from qlinkgen.importers.ksy.expressions import Expression, Number, Operation, Slice, runs, sliced

_MIRRORED: Final = {"==": "==", "!=": "!=", "<": ">", ">": "<", "<=": ">=", ">=": "<="}


@dataclass(frozen=True, slots=True)
class Tested:
    """A field that a condition tests.

    Attributes:
        name: Its name in the schema.
        limits: Least and greatest value.
        truth: It is a truth value.
        bit: Gives the name of bits of it, from the first to the last one; None if it is not divided so.
    """

    name: str
    limits: tuple[int, int]
    truth: bool
    bit: Callable[[int, int], str | None]


#: Gives a field by its path; None if there is none.
Field = Callable[[str], Tested | None]


def condition(expression: Expression | None, field: Field) -> dict[str, Value] | None:
    """Values that fields have where an expression is true; None if a schema cannot state it."""
    if expression is None or isinstance(expression, Number):
        return None
    if not isinstance(expression, Operation) or expression.sign in ("&", ">>"):
        return _truth(expression, field)
    match expression.sign, expression.operands:
        case "not", (inner,):
            return _inverted(condition(inner, field))
        case "and", (left, right):
            return _both(condition(left, field), condition(right, field))
        case "or", (left, right):
            return _either(condition(left, field), condition(right, field))
        case sign, (left, Number() as right) if sign in _MIRRORED:
            return _compared(sliced(left), sign, right, field)
        case sign, (Number() as left, right) if sign in _MIRRORED:
            return _compared(sliced(right), _MIRRORED[sign], left, field)
        case _:
            return None


def _truth(expression: Expression, field: Field) -> dict[str, Value] | None:
    found = sliced(expression)
    tested = field(found.name) if found else None
    whole = found is not None and found == Slice(found.name)
    return {tested.name: True} if tested and tested.truth and whole else None


def _both(left: dict[str, Value] | None, right: dict[str, Value] | None) -> dict[str, Value] | None:
    return None if left is None or right is None or left.keys() & right.keys() else {**left, **right}


def _either(left: dict[str, Value] | None, right: dict[str, Value] | None) -> dict[str, Value] | None:
    if left is None or right is None or left.keys() != right.keys() or len(left) != 1:
        return None
    name, first = next(iter(left.items()))
    listed = [*_listed(first), *_listed(right[name])]
    if any(isinstance(each, bool) or (isinstance(each, Notation) and "not" in each.text) for each in listed):
        return None
    return {name: listed}


def _listed(value: Value) -> list[Value]:
    return value if isinstance(value, list) else [value]


def _inverted(found: dict[str, Value] | None) -> dict[str, Value] | None:
    if found is None or len(found) != 1:
        return None
    name, value = next(iter(found.items()))
    match value:
        case bool():
            return {name: not value}
        case Notation() if value.text.startswith("not "):
            return {name: Notation(value.text.removeprefix("not "))}
        case Notation():
            return {name: Notation(f"not {value.text}")}
        case int() | str():
            return {name: Notation(f"not {value}")}
        case _:
            return None


def _compared(found: Slice | None, sign: str, right: Number, field: Field) -> dict[str, Value] | None:
    tested = field(found.name) if found else None
    if tested is None or found is None:
        return None
    if found.mask is None and not found.shift:
        value = _value(sign, right, tested.limits)
        if tested.truth and sign in ("==", "!=") and right.value in (0, 1):
            value = (right.value == 1) is (sign == "==")
        return None if value is None else {tested.name: value}
    mask = found.mask if found.mask is not None else tested.limits[1] >> found.shift << found.shift
    wanted = right.value << found.shift
    parts = runs(mask & tested.limits[1])
    if wanted & ~mask or not parts or sign not in ("==", "!=") or (sign == "!=" and len(parts) > 1):
        return None
    values: dict[str, Value] = {}
    for first, last in parts:
        name = tested.bit(first, last)
        if name is None:
            return None
        value = wanted >> first & ((1 << (last - first + 1)) - 1)
        if first == last:
            values[name] = (value == 1) is (sign == "==")
        else:
            values[name] = value if sign == "==" else Notation(f"not {value}")
    return values


def _value(sign: str, right: Number, limits: tuple[int, int]) -> Value | None:
    number = right.value
    match sign:
        case "==":
            return right.name or number
        case "!=":
            return Notation(f"not {right.name or number}")
        case ">":
            return _range(number + 1, limits[1])
        case ">=":
            return _range(number, limits[1])
        case "<":
            return _range(limits[0], number - 1)
        case _:
            return _range(limits[0], number)


def _range(first: int, last: int) -> Value | None:
    return Notation(f"{first}..{last}") if first < last else first if first == last else None
