"""Second pass, sizes of answers: arrays with as many items as a field of an earlier frame says."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

from qlinkgen.model.message import Message
from qlinkgen.model.types import Scalar
from qlinkgen.schema.file_fields import Fields
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_FROM_FRAME = re.compile(r"\A(?P<base>[^\[]*)\[\s*(?P<frame>[A-Za-z]\w*)\.(?P<name>\w+)\s*\]\s*\Z", re.ASCII)


class Sized(NamedTuple):
    """The fields of an answer with the bounds of their sizes.

    Attributes:
        fields: each with a range in place of the reference.
        sizes: fields, and the fields with their number of items.
        by: the frame that has the latter, None without sizes.
    """

    fields: Fields
    sizes: tuple[tuple[str, str], ...] = ()
    by: Message | None = None


def sized(fields: Fields, frames: Mapping[str, Message], path: Path, report: Reporter) -> Sized:
    """Replace ``u16[request.quantity]`` by the range of that field of the request.

    ``frames`` are what the master has sent before: the request, and steps by name.
    """
    found, sizes = dict(fields), []
    by = ""
    for name, spec in fields.items():
        match = _FROM_FRAME.match(spec.type)
        if match is None:
            continue
        place = (*path, name)
        bounds = _bounds(match["frame"], match["name"], frames, place, report)
        if bounds and by and by != match["frame"]:
            what = f"sizes are in two frames, {by} and {match['frame']}"
            report.error("bad-array", place, what, "put the numbers of items into one frame")
            report.taint(place)
            bounds = None
        if bounds is None:
            del found[name]
            continue
        by = match["frame"]
        found[name] = spec.model_copy(update={"type": f"{match['base']}[{bounds[0]}..{bounds[1]}]"})
        sizes.append((name, match["name"]))
    return Sized(found, tuple(sizes), frames.get(by))


def _bounds(
    frame: str, name: str, frames: Mapping[str, Message], path: Path, report: Reporter
) -> tuple[int, int] | None:
    if frame not in frames:
        what = f"no frame before it is called {shown(frame)}"
        report.error("unknown-type", path, what, did_you_mean(frame, frames, f"use {listed(frames)}"))
        report.taint(path)
        return None
    text = "the request" if frame == "request" else frame
    known = {value.name: value.type for value in frames[frame].values}
    kind = known.get(name)
    if kind is None:
        what = f"{text} has no field {shown(name)}"
        hint = did_you_mean(name, known, f"its fields are {listed(known)}")
        report.error("unknown-type", path, what, hint)
    elif not isinstance(kind, Scalar) or not _counts(kind):
        report.error(
            "bad-array", path, f"{name} of {text} is not a number of items", "use an unsigned integer"
        )
    elif _number(kind, kind.minimum) < 0 or _number(kind, kind.maximum) == 0:
        what = f"{name} of {text} may be {_number(kind, kind.minimum)}..{_number(kind, kind.maximum)}"
        report.error("bad-array", path, what, "give it a range of numbers of items, like 1..125")
    else:
        return _number(kind, kind.minimum), _number(kind, kind.maximum)
    report.taint(path)
    return None


def _counts(kind: Scalar) -> bool:
    """Whether a number may be one of items: it is whole, and grows with the raw one."""
    scaling = kind.scaling
    whole = scaling is None or (scaling.divisor == 1 and scaling.factor > 0)
    return whole and kind.meaning is None


def _number(kind: Scalar, raw: int) -> int:
    """The number of items that a raw number says."""
    return raw if kind.scaling is None else raw * kind.scaling.factor + kind.scaling.bias
