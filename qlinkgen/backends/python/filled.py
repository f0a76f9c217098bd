"""Numbers of a payload that follow from earlier bytes: check values, and numbers derived from others."""

from __future__ import annotations

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python import integers, pieces
from qlinkgen.backends.python.layout import bare, slice_of
from qlinkgen.backends.python.place import Place
from qlinkgen.plan.expr import Size
from qlinkgen.plan.payload import Equal, FilledStep


@dataclass(frozen=True)
class Filling:
    """What an encoder adds to the bytes so far: statements, and the expression for the bytes."""

    lines: tuple[str, ...]
    octets: str


def filling(step: FilledStep, data: str, place: Place) -> Filling:
    """The bytes of a number, which follow those of ``data``."""
    at = step.place.front
    begin, end = _back(at.since(step.begin), data), _back(at.since(step.end), data)
    lines = (*number(step, data, begin, end, place), f"{step.name}_raw = {right(step, place)}")
    return Filling(lines, integers.to_bytes(step.integer, f"{step.name}_raw"))


def _back(distance: Size, data: str) -> str:
    """An index so far before the end of ``data``, "" for its end."""
    if not distance.terms:
        return str(-distance.fixed) if distance.fixed else ""
    text = integers.size_text(distance)
    return f"len({data}) - ({text})" if " " in text else f"len({data}) - {text}"


def number(step: FilledStep, data: str, begin: str, end: str, place: Place) -> list[str]:
    """Statements that assign what a number follows from: bytes, or the other number."""
    covered, rule = slice_of(data, begin, end), step.rule
    if not isinstance(rule, Equal):
        place.check(rule)
        return [f"covered = {covered}"]
    size = rule.source.size
    if rule.source.byteorder is not None:
        return [
            f"covered = {data}[{begin}]"
            if size == 1
            else f"covered = {integers.from_bytes(rule.source, covered)}"
        ]
    return [f"octets = {covered}", f"covered = {integers.read(rule.source, 'octets', str)}"]


def right(step: FilledStep, place: Place) -> str:
    """The expression for a number, once the local ``covered`` is assigned."""
    rule = step.rule
    if isinstance(rule, Equal):
        mask = step.integer.mask
        return bare(pieces.derived("covered", inverted=rule.inverted, added=rule.added, mask=mask))
    name = place.check(rule)
    return f"{name}.compute(covered, {name}.start)"
