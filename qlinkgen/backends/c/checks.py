"""Conditions under which a value is refused."""

from __future__ import annotations

from qlinkgen.backends.c.names import literal, scalar_literal, storage, unsigned, unsigned_type
from qlinkgen.model.types import Flags, Scalar


def refused_before_sending(scalar: Scalar, value: str) -> list[str]:
    """Conditions on a struct member; its C type may hold more than the wire."""
    if scalar.meaning == "bool":
        return []
    width = storage(scalar.bits)
    least = -(1 << (width - 1)) if scalar.signed else 0
    most = (1 << (width - scalar.signed)) - 1
    return _bounds(scalar, value, least, most) + _reserved_bits(scalar, value)


def refused_when_received(scalar: Scalar, value: str) -> list[str]:
    """Conditions on a value that was read from its bits."""
    return _bounds(scalar, value, scalar.natural_minimum, scalar.natural_maximum) + _reserved_bits(
        scalar, value
    )


def condition(terms: list[str]) -> str:
    """Any of the terms."""
    return terms[0] if len(terms) == 1 else " || ".join(f"({term})" for term in terms)


def _bounds(scalar: Scalar, value: str, least: int, most: int) -> list[str]:
    terms = []
    if scalar.minimum > least:
        terms.append(f"{value} < {literal(scalar.minimum, scalar.bits, signed=scalar.signed)}")
    if scalar.maximum < most:
        terms.append(f"{value} > {literal(scalar.maximum, scalar.bits, signed=scalar.signed)}")
    return terms


def _reserved_bits(scalar: Scalar, value: str) -> list[str]:
    flags = scalar.meaning
    if not isinstance(flags, Flags) or not flags.reserved_zero:
        return []
    reserved = ((1 << scalar.bits) - 1) & ~flags.mask
    return [f"({value} & {unsigned(reserved, scalar.bits, hexadecimal=True)}) != 0U"] if reserved else []


def as_unsigned(scalar: Scalar, value: str) -> str:
    """The expression of a struct member for writing it: its bits in an unsigned type."""
    if scalar.meaning == "bool":
        return f"({unsigned_type(scalar.bits)})({value} ? 1U : 0U)"
    if scalar.signed or scalar.size == 1:
        return f"({unsigned_type(scalar.bits)}){value}" if scalar.signed else value
    return value


def from_unsigned(scalar: Scalar, raw: str, prefix: str) -> str:
    """The expression that turns bits which were read into the struct member."""
    if scalar.meaning == "bool":
        return f"{raw} != 0U"
    if not scalar.signed:
        return raw
    kind = f"int{storage(scalar.bits)}_t"
    if scalar.bits == storage(scalar.bits):
        return f"({kind}){raw}"
    sign = unsigned(1 << (scalar.bits - 1), scalar.bits, hexadecimal=True)
    return f"({kind}){prefix}_extend_{storage(scalar.bits)}_({raw}, {sign})"


def constant_bits(scalar: Scalar) -> str:
    """What a constant, reserved or default value is on the wire."""
    return unsigned(scalar.default & ((1 << scalar.bits) - 1), scalar.bits, hexadecimal=True)


__all__ = [
    "as_unsigned",
    "condition",
    "constant_bits",
    "from_unsigned",
    "refused_before_sending",
    "refused_when_received",
    "scalar_literal",
]
