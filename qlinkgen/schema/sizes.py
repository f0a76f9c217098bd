"""Second pass, sizes from the request: arrays with as many items as a field of the request says."""

from __future__ import annotations

import re
from typing import NamedTuple

from qlinkgen.model.message import Message
from qlinkgen.model.types import Scalar
from qlinkgen.schema.file_fields import Fields
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_FROM_REQUEST = re.compile(r"\A(?P<base>[^\[]*)\[\s*request\.(?P<name>\w+)\s*\]\s*\Z", re.ASCII)


class Sized(NamedTuple):
    """The fields of an answer with the bounds of their sizes.

    Attributes:
        fields: each with a range in place of the reference.
        sizes: fields, and the fields of the request with their number of items.
    """

    fields: Fields
    sizes: tuple[tuple[str, str], ...]


def sized(fields: Fields, request: Message, path: Path, report: Reporter) -> Sized:
    """Replace ``u16[request.quantity]`` by the range of that field of the request."""
    found, sizes = dict(fields), []
    for name, spec in fields.items():
        match = _FROM_REQUEST.match(spec.type)
        if match is None:
            continue
        bounds = _bounds(match["name"], request, (*path, name), report)
        if bounds is None:
            del found[name]
            continue
        found[name] = spec.model_copy(update={"type": f"{match['base']}[{bounds[0]}..{bounds[1]}]"})
        sizes.append((name, match["name"]))
    return Sized(found, tuple(sizes))


def _bounds(name: str, request: Message, path: Path, report: Reporter) -> tuple[int, int] | None:
    known = {value.name: value.type for value in request.values}
    kind = known.get(name)
    if kind is None:
        what = f"the request has no field {shown(name)}"
        hint = did_you_mean(name, known, f"its fields are {listed(known)}")
        report.error("unknown-type", path, what, hint)
    elif not isinstance(kind, Scalar) or kind.scaling is not None or kind.meaning is not None:
        report.error(
            "bad-array", path, f"{name} of the request is not a number of items", "use an unsigned integer"
        )
    elif kind.minimum < 0 or kind.maximum == 0:
        what = f"{name} of the request may be {kind.minimum}..{kind.maximum}"
        report.error("bad-array", path, what, "give it a range of numbers of items, like 1..125")
    else:
        return kind.minimum, kind.maximum
    report.taint(path)
    return None
