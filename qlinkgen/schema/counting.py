"""Second pass, counts over several fields: ``counts: [kind, size, value]`` is the number of their bytes.

One of them has a variable size, which the count tells, or is a choice; the others have a constant one. The
count may be one of them itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from qlinkgen.model.fields import Field, Records
from qlinkgen.model.types import Array, Blob, Count, Scalar
from qlinkgen.schema.file_fields import Fields
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path


def with_beside(fields: Sequence[Field], specs: Fields, path: Path, report: Reporter) -> list[Field]:
    """The fields; a count over several ones names the one of variable size, and the others beside it."""
    return [_resolved(each, fields, specs, path, report) for each in fields]


def _resolved(field: Field, fields: Sequence[Field], specs: Fields, path: Path, report: Reporter) -> Field:
    kind = field.type
    if not isinstance(kind, Scalar) or not isinstance(kind.role, Count):
        return field
    choices = {each.slot for each in fields if each.slot}
    if not kind.role.beside and kind.role.run not in choices:
        return field
    names, known = (kind.role.run, *kind.role.beside), {each.name: each for each in fields}
    varying = [name for name in names if name in choices or (name in known and not known[name].fixed)]
    if fault := _fault(names, varying, known, specs):
        place = (*path, field.name)
        needs = (place, *((*path, name) for name in names))
        report.error("bad-count", (*place, "counts"), *fault, needs=needs)
        report.taint(place)
        return field
    beside = tuple(name for name in names if name != varying[0])
    role = replace(kind.role, run=varying[0], unit="bytes", beside=beside)
    return replace(field, type=replace(kind, role=role))


def choice_fault(field: Field, count: Count) -> tuple[str, str] | None:
    """Error and fix for a count of the bytes of a choice, None if it is right."""
    if field.conditional:
        what = f"{field.name} may be absent, so that it does not tell the size of {count.run}"
        return what, "remove its if"
    if (count.scale, count.offset) != (1, 0):
        what = f"the bytes of {count.run}, whose size varies with its case, are counted one by one"
        return what, "remove scale and offset"
    return None


def scale_fault(count: Count, target: Field, unit: str, beside: int) -> tuple[str, str] | None:
    """Error and fix for the scale or offset of a count, None if it tells every size of what it counts."""
    kind, scale, offset = target.type, count.scale, count.offset
    assert isinstance(kind, Blob | Array | Records)
    if (scale, offset) == (1, 0):
        return None
    if target.walked and unit == "bytes":
        what = f"the bytes of {target.name}, whose records vary in size, are counted one by one"
        return what, "remove scale and offset"
    least = kind.length.minimum if unit == "items" else kind.size_of(kind.length.minimum)
    if least + beside < offset:
        what = f"the count of {least + beside} {unit} of {target.name} would be negative"
        return what, f"let {target.name} have more items, or use a smaller offset"
    step = kind.size_of(1) if unit == "bytes" else 1
    if scale > 1 and (step % scale or (beside - offset) % scale or (isinstance(kind, Array) and kind.packed)):
        what = f"the {unit} that are counted are not always a multiple of {scale}"
        return what, f"count an array whose items have {scale} bytes, or remove scale"
    return None


def _fault(
    names: Sequence[str], varying: Sequence[str], known: dict[str, Field], specs: Fields
) -> tuple[str, str] | None:
    """Error and fix for what a count names, None if it is right."""
    for name in names:
        if name not in known and name not in varying:
            hint = did_you_mean(name, known, f"the fields are {listed(known)}")
            return f"{shown(name)} is not a field that it can count", hint
        if name in known and known[name].terminated:
            what = f"{name} has a terminator, which tells its size"
            return what, "count other fields, or remove the terminator"
        if names.count(name) > 1:
            return f"{name} is counted twice", "remove one of them"
        if name not in varying and (specs[name].when or specs[name].optional):
            hint = "count only fields that are always present beside the one of variable size"
            return f"{name} may be absent, so that the count does not tell the size of another", hint
    if not varying:
        return "none of these fields has a variable size", "remove counts, and write the number as const"
    if len(varying) > 1:
        what = f"{listed(varying)} have variable sizes, which one count does not tell"
        return what, "count one of them, and give the others counts of their own"
    return None
