"""Conditions on values, and conversion between struct members and bits."""

from __future__ import annotations

from collections.abc import Iterable
from typing import assert_never

from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import halves, is_wide, literal, scalar_type, storage, unsigned, unsigned_type
from qlinkgen.model.types import Characters, Scalar
from qlinkgen.plan.expr import Clear, Condition, Legible, OneOf, Within
from qlinkgen.plan.payload import conditions, limits


def refused_before_sending(number: Scalar, value: str) -> list[str]:
    """Conditions that reject a struct member, whose C type may have a larger range than the wire."""
    if number.meaning == "bool":
        return []
    width = storage(number.bits)
    held = Within(-(1 << (width - 1)) if number.signed else 0, (1 << (width - number.signed)) - 1)
    return broken(limits(number), value, held, number.bits, signed=number.signed)


def refused_when_received(number: Scalar, value: str) -> list[str]:
    """Conditions that reject a received value."""
    held = Within(number.natural_minimum, number.natural_maximum)
    return broken(conditions(number), value, held, number.bits, signed=number.signed)


def broken(
    rules: Iterable[Condition], value: str, held: Within, bits: int, *, signed: bool = False
) -> list[str]:
    """Conditions that hold if a rule is violated; the value has ``bits`` bits and is in ``held``."""
    terms: list[str] = []
    for rule in rules:
        match rule:
            case Within() if bits > 64:
                terms += [_wide_less(value, rule.low, signed=signed)] * (rule.low > held.low)
                terms += [_wide_less(value, rule.high, signed=signed, above=True)] * (rule.high < held.high)
            case Within():
                terms += [f"{value} < {literal(rule.low, bits, signed=signed)}"] * (rule.low > held.low)
                terms += [f"{value} > {literal(rule.high, bits, signed=signed)}"] * (rule.high < held.high)
            case OneOf():
                terms.append(_outside(rule, value, held, bits, signed=signed))
            case Legible(Characters(number, excluded)):
                letters = [f"{value}[{at}]" for at in range(number)]
                terms += [f"{each} > 0x7FU" for each in letters]
                barred = [unsigned(each, 8, hexadecimal=True) for each in excluded]
                terms += [f"{each} == {octet}" for each in letters for octet in barred]
            case Clear():
                terms.append(f"({value} & {unsigned(rule.mask, bits, hexadecimal=True)}) != 0U")
            case _:
                assert_never(rule)
    return terms


def _wide_less(value: str, bound: int, *, signed: bool, above: bool = False) -> str:
    """The condition that a number of two halves is below a bound, or above it."""
    sign, order = 1 << 127, ">" if above else "<"
    end = (1 << 64) - 1 if above else 0  # beyond it is nothing, which compilers warn of
    top, (high, low) = f"{value}.high", halves(bound ^ sign if signed else bound)
    if signed:  # order numbers in two's complement
        top = f"({top} ^ {halves(sign)[0]})"
    terms = [f"{top} {order} {high}"] * (int(high[:-3], 16) != end)
    terms += [f"({top} == {high}) && ({value}.low {order} {low})"] * (int(low[:-3], 16) != end)
    return condition(terms)


def _outside(rule: OneOf, value: str, held: Within, bits: int, *, signed: bool) -> str:
    """The condition that holds outside of all ranges."""
    terms = [condition(broken([each], value, held, bits, signed=signed)) for each in rule.ranges]
    return terms[0] if len(terms) == 1 else " && ".join(f"({term})" for term in terms)


def condition(terms: list[str]) -> str:
    """The disjunction of the terms."""
    return terms[0] if len(terms) == 1 else " || ".join(f"({term})" for term in terms)


def refusal(terms: list[str], error: str) -> list[str]:
    """The statement that returns an error if a term holds; empty without terms."""
    return [f"if ({condition(terms)}) {{", f"    return {error};", "}"] if terms else []


def as_unsigned(number: Scalar, value: str) -> str:
    """The expression that converts a struct member other than a text to an unsigned integer of its bits."""
    if number.meaning == "bool":
        return f"({unsigned_type(number.bits)})({value} ? 1U : 0U)"
    return f"({unsigned_type(number.bits)}){value}" if number.signed and not is_wide(number) else value


def from_unsigned(number: Scalar, raw: str, layouts: Layouts) -> str:
    """The expression that converts received bits to a struct member."""
    if number.meaning == "bool":
        return f"{raw} != 0U"
    if is_wide(number):
        return layouts.extend_wide(raw, number.bits) if number.signed and number.bits < 128 else raw
    if not number.signed:
        return raw
    whole = raw if number.bits == storage(number.bits) else layouts.extend(raw, number.bits)
    return f"({scalar_type(number)}){whole}"
