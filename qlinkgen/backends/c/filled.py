"""Numbers of a payload that follow from earlier bytes: check values, and numbers derived from others."""

from __future__ import annotations

from qlinkgen.backends.c.layout import Layouts, pointer
from qlinkgen.backends.c.names import unsigned, unsigned_type
from qlinkgen.backends.c.sizes import Count, index_of, size_text
from qlinkgen.plan.payload import Equal, FilledStep, PayloadPlan, Place


def right(step: FilledStep, layouts: Layouts, count: Count) -> str:
    """The number that follows from the bytes at ``payload``; ``count`` prints numbers of items."""
    place, rule = index_of(Place(step.begin, None), count), step.rule
    if isinstance(rule, Equal):
        other = layouts.peek(rule.source, "payload", place)
        return derived(step.integer.bits, step.integer.mask, other, inverted=rule.inverted, added=rule.added)
    size = size_text(step.end.since(step.begin), count)
    return f"{layouts.check(rule)}_of_({pointer('payload', place)}, {size})"


def differs(step: FilledStep, number: str, layouts: Layouts, count: Count) -> str:
    """The condition for another number than the one that follows from the bytes at ``payload``."""
    rule = step.rule
    if not isinstance(rule, Equal) or not rule.inverted:
        return f"{number} != {right(step, layouts, count)}"
    # In this form gcc has no objection to the promotion of a complement.
    bits, mask = step.integer.bits, step.integer.mask
    every = unsigned(mask, bits, hexadecimal=True)
    if rule.added:
        number = f"({unsigned_type(bits)})(({number} + {unsigned(-rule.added & mask, bits)}) & {every})"
    other = layouts.peek(rule.source, "payload", index_of(Place(step.begin, None), count))
    return f"({number} ^ {other}) != {every}"


def derived(bits: int, mask: int, other: str, *, inverted: bool, added: int) -> str:
    """The value of a number derived from another one."""
    kind, every = unsigned_type(bits), unsigned(mask, bits, hexadecimal=True)
    value = f"({kind})({every} - {other})" if inverted else other
    if not added:
        return value
    return f"({kind})(({value} + {unsigned(added & mask, bits)}) & {every})"


def has_checks(payload: PayloadPlan) -> bool:
    """Whether the bytes of a record may be wrong in another way than a value out of range."""
    inside = (record.payload for record in payload.records)
    return any(step.fault == "crc" for each in (payload, *inside) for step in each.filled_in)
