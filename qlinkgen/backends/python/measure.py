"""The size of a message in a frame without a length, derived from its counts."""

from __future__ import annotations

from qlinkgen.backends.python import integers
from qlinkgen.backends.python.walked_size import walked_measure_lines
from qlinkgen.plan.expr import Within
from qlinkgen.plan.payload import CountStep, Learn, PayloadPlan, term_of


def measure_lines(payload: PayloadPlan) -> list[str]:
    """Body of the method that finds the size of a payload from its beginning; empty if it is constant.

    The method takes the bytes and the offset of the payload. It returns the size as far as counts have been
    received, or the negative offset after a count that is out of range.
    """
    if payload.fixed:
        return []
    if payload.walked:
        return walked_measure_lines(payload)
    lines = [f"size = {payload.least}"]
    for each in payload.sizing:
        if isinstance(each, Learn):
            lines += _learned(payload, each.count)
    return [*lines, "return size"]


def _learned(payload: PayloadPlan, count: CountStep) -> list[str]:
    run = payload.run(count.run)
    name = f"{count.run}_count"

    front, lines = count.place.front, []
    if front.terms:
        lines.append(f"start = at + {integers.size_text(front)}")

    def at(more: int) -> str:
        start = "start" if front.terms else "at"
        fixed = more if front.terms else front.fixed + more
        return f"{start} + {fixed}" if fixed else start

    number = integers.read(count.integer, "data", at)
    least, term = run.length.minimum, term_of(run)
    lines += [f"if len(data) < {at(count.integer.size)}:", "    return size"]
    odd, own = "", integers.own_bytes(count.term, number)
    if count.term.packed:
        lines.append(f"{name} = {integers.items_text(count.term, number)}")
    elif count.scale > 1:
        odd = f"{count.run}_odd or "
        lines.append(f"{name}, {count.run}_odd = divmod({own}, {count.scale})")
    else:
        lines.append(f"{name} = {own}")
    more = integers.term_text(term) + (f" - {term.value(least)}" if least else "")
    return [
        *lines,
        f"if {odd}{integers.broken(Within(least, run.length.maximum), name)}:",
        f"    return -({at(count.integer.size)})",
        f"size += {more}",
    ]
