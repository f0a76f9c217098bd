"""Conditions under which a value is refused, and how it gets from a struct to its bits and back."""

from __future__ import annotations

from collections.abc import Iterable
from typing import assert_never

from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import literal, scalar_type, storage, unsigned, unsigned_type
from qlinkgen.model.types import Scalar
from qlinkgen.plan.expr import Clear, Limit, Within
from qlinkgen.plan.payload import conditions, limits


def refused_before_sending(number: Scalar, value: str) -> list[str]:
    """Conditions on a struct member; its C type may hold more than the wire."""
    if number.meaning == "bool":
        return []
    width = storage(number.bits)
    held = Within(-(1 << (width - 1)) if number.signed else 0, (1 << (width - number.signed)) - 1)
    return broken(limits(number), value, held, number.bits, signed=number.signed)


def refused_when_received(number: Scalar, value: str) -> list[str]:
    """Conditions on a value that was read from its bits."""
    held = Within(number.natural_minimum, number.natural_maximum)
    return broken(conditions(number), value, held, number.bits, signed=number.signed)


def broken(rules: Iterable[Limit], value: str, held: Within, bits: int, *, signed: bool = False) -> list[str]:
    """Conditions of which one holds where a rule is broken; the value has so many bits and is in ``held``."""
    terms: list[str] = []
    for rule in rules:
        match rule:
            case Within():
                terms += [f"{value} < {literal(rule.low, bits, signed=signed)}"] * (rule.low > held.low)
                terms += [f"{value} > {literal(rule.high, bits, signed=signed)}"] * (rule.high < held.high)
            case Clear():
                terms.append(f"({value} & {unsigned(rule.mask, bits, hexadecimal=True)}) != 0U")
            case _:
                assert_never(rule)
    return terms


def condition(terms: list[str]) -> str:
    """Any of the terms."""
    return terms[0] if len(terms) == 1 else " || ".join(f"({term})" for term in terms)


def refusal(terms: list[str], error: str) -> list[str]:
    """The statement that returns an error where a term holds; none where there are no terms."""
    return [f"if ({condition(terms)}) {{", f"    return {error};", "}"] if terms else []


def as_unsigned(number: Scalar, value: str) -> str:
    """The expression of a struct member for writing it: its bits in an unsigned type."""
    if number.meaning == "bool":
        return f"({unsigned_type(number.bits)})({value} ? 1U : 0U)"
    return f"({unsigned_type(number.bits)}){value}" if number.signed else value


def from_unsigned(number: Scalar, raw: str, layouts: Layouts) -> str:
    """The expression that turns bits which were read into the struct member."""
    if number.meaning == "bool":
        return f"{raw} != 0U"
    if not number.signed:
        return raw
    whole = raw if number.bits == storage(number.bits) else layouts.extend(raw, number.bits)
    return f"({scalar_type(number)}){whole}"
