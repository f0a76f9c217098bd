"""Second pass, sizes by name: ``u16[count]`` has as many items as an earlier field says.

That field is a count: it is filled and checked by the codec. Its range is that of the number of items.
"""

from __future__ import annotations

import re

from qlinkgen.schema.file_fields import Fields, FieldSpec
from qlinkgen.schema.notation import shown, type_text
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_NAME = re.compile(r"[A-Za-z_]\w*\Z", re.ASCII)
_UNKNOWN = "1"


def with_counts(specs: Fields, path: Path, report: Reporter) -> Fields:
    """The fields, with a size by name written as a count and a range."""
    found = dict(specs)
    for name, spec in specs.items():
        size = _size(spec)
        if not size:
            continue
        base = type_text(spec.type).base
        bounds = _bounds(found, name, size, path, report)
        bare = base in ("bytes", "text") and not bounds
        found[name] = spec.model_copy(update={"type": base if bare else f"{base}[{bounds}]"})
    return found


def _size(spec: FieldSpec) -> str:
    """The name in the brackets of a type, "" if there is none."""
    try:
        count = (type_text(spec.type).count or "").strip()
    except ValueError:
        return ""
    return count if _NAME.match(count) else ""


def _bounds(found: Fields, name: str, size: str, path: Path, report: Reporter) -> str:
    """Make a field the count of another; returns its range, one item if it cannot count."""
    order = list(found)
    earlier = {each: found[each] for each in order[: order.index(name)]}
    place, needs = (*path, name, "type"), ((*path, name), (*path, size))
    count = earlier.get(size)
    if count is None:
        hint = did_you_mean(size, earlier, f"earlier fields: {listed(earlier)}")
        what = f"{shown(size)} is not a field before {name}, which has as many items"
        report.error("bad-count", place, what, hint, needs=needs)
        return _UNKNOWN
    if count.counts not in (None, [name]):
        what = f"{size} already gives the size of {listed(count.counts or ())}"
        report.error("bad-count", place, what, f"give {name} a count of its own", needs=needs)
        return _UNKNOWN
    limits = count.range or count.raw_range
    changes = {"counts": [name], "range": None, "raw_range": None}
    found[size] = count.model_copy(update=changes)
    return f"{limits.first}..{limits.last}" if limits is not None else ""
