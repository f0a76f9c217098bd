"""Sizes that follow from a file alone."""

from __future__ import annotations

from typing import Final

from qlinkgen.importers.ksy.blobs import contents
from qlinkgen.importers.ksy.expressions import Number, parsed
from qlinkgen.importers.ksy.scalars import bit_width, scalar
from qlinkgen.importers.ksy.tree import Attribute, Refused, Type

_DEEPEST: Final = 10


def bits_of(attribute: Attribute, depth: int = 0) -> int | None:
    """The number of bits of an attribute; None if it varies."""
    if attribute.text("if") or attribute.trouble or depth > _DEEPEST:
        return None
    one = _one(attribute, depth)
    match attribute.text("repeat"):
        case "":
            return one
        case "expr":
            times = parsed(attribute.text("repeat-expr"))
            return one * times.value if one is not None and isinstance(times, Number) else None
        case _:
            return None


def _one(attribute: Attribute, depth: int) -> int | None:
    if attribute.node.get("contents") is not None:
        try:
            return 8 * len(contents(attribute))
        except Refused:
            return None
    if size := attribute.text("size"):
        number = parsed(size)
        return 8 * number.value if isinstance(number, Number) else None
    if (found := scalar(attribute.type, "le")) is not None:
        return 8 * found.size
    if (width := bit_width(attribute.type)) is not None:
        return width
    inner = attribute.scope.find_type(attribute.type) if attribute.type else None
    return bits_of_type(inner, depth + 1) if inner is not None else None


def bits_of_type(type_: Type, depth: int = 0) -> int | None:
    """The number of bits of a type, a multiple of eight; None if it varies."""
    total = 0
    for each in type_.attributes:
        bits = bits_of(each, depth)
        if bits is None:
            return None
        if bit_width(each.type) is None:
            total += -total % 8
        total += bits
    return total + -total % 8
