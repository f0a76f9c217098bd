"""The function that finds the id with which a payload begins, as code."""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen.backends.c.words import octets_are
from qlinkgen.plan.text_ids import TextIds
from qlinkgen.plan.tree import Plan


def numbering(plan: Plan, prefix: str, id_type: str, *, directed: bool) -> list[str]:
    """The function; [] if parts hold ids. ``prefix`` is that of the frames of a direction."""
    if not plan.frame.texts:
        return []
    unknown = f"{len(plan.frame.texts)}U"
    direction = f"{plan.protocol.name}_direction_t direction, " if directed else ""
    lines = [
        "/* The number of the longest id that a payload begins with, one above the last if there is none. */",
        f"static inline {id_type} {prefix}_number_({direction}const uint8_t *payload, size_t size)",
        "{",
    ]
    found = {each: plan.texts(each) for each in plan.received_directions}
    if directed:
        for each, texts in found.items():
            lines.append(f"    if (direction == {plan.protocol.name.upper()}_{each.upper()}) {{")
            lines += [f"    {line}" for line in _found(texts)]
            lines.append("    }")
    else:
        lines += _found(next(iter(found.values())))
    last = _always(next(iter(found.values()))) and not directed
    used = any("payload[" in line for line in lines)
    if not used:
        lines += ["    (void)payload;", "    (void)size;"]
    return [*lines, *([] if last else [f"    return {unknown};"]), "}"]


def _always(texts: TextIds | None) -> bool:
    """Whether every payload begins with an id: that of no characters."""
    return texts is not None and any(not text for text, _ in texts.numbers)


def _found(texts: TextIds | None) -> Iterator[str]:
    for text, number in texts.numbers if texts else ():
        if not text:
            yield f"    return {number}U;"
            continue
        *terms, last = octets_are("payload", text, folded=texts is not None and texts.folded)
        yield f"    if ((size >= {len(text)}U) &&"
        yield from (f"        {term} &&" for term in terms)
        yield f"        {last}) {{"
        yield f"        return {number}U;"
        yield "    }"
