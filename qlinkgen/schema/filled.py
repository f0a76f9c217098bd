"""Second pass, numbers that follow from earlier fields: check values, and numbers derived from others."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from qlinkgen.model.fields import Field
from qlinkgen.model.types import Bits, Checked, Derived, Float, Role, Scalar
from qlinkgen.schema.algorithms import AlgorithmBuilder
from qlinkgen.schema.file_fields import Fields, FieldSpec
from qlinkgen.schema.notation import DERIVED, beyond, shown
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_RULE = "bad-derivation"


def is_filled(spec: FieldSpec) -> bool:
    """Whether a field follows from others."""
    return spec.algorithm is not None or spec.equals is not None


class FilledBuilder:
    """Connects check values and derived numbers of one message or record with the fields before them."""

    def __init__(self, specs: Fields, path: Path, report: Reporter) -> None:
        """``specs`` are the fields as written."""
        self._specs = specs
        self._path = path
        self._report = report

    def build(self, fields: Sequence[Field]) -> list[Field]:
        """The fields; those that follow from others know from which."""
        if not any(map(is_filled, self._specs.values())):
            return list(fields)
        self._walked = any(each.conditional or each.terminated or each.walked for each in fields)
        return [self._resolved(each, fields) for each in fields]

    def _resolved(self, field: Field, fields: Sequence[Field]) -> Field:
        spec, kind, place = self._specs[field.name], field.type, (*self._path, field.name)
        if not is_filled(spec) or not isinstance(kind, Scalar):
            return field
        if field.conditional:
            what = f"{field.slot or field.name} may be absent, so it does not follow from other fields"
            self._error(place, "algorithm" if spec.algorithm else "equals", what, "put it into a record")
            self._report.taint(place)
            return field
        before = list(fields[: fields.index(field)])
        if spec.algorithm is not None:
            role = self._checked(spec, kind, before, place)
        else:
            role = self._derived(str(spec.equals), kind, before, place)
        if role is None:
            self._report.taint(place)
            return field
        return replace(field, type=replace(kind, role=role))

    def _error(self, place: Path, key: str, what: str, hint: str) -> None:
        spec = self._specs[str(place[-1])]
        named = {*(spec.over or ()), *re.findall(r"\w+", spec.equals or "")}
        needs = (place, *((*self._path, name) for name in self._specs if name in named))
        self._report.error(_RULE, (*place, key), what, hint, of_key=True, needs=needs)

    def _checked(self, spec: FieldSpec, kind: Scalar, before: Sequence[Field], place: Path) -> Role | None:
        assert spec.algorithm is not None
        algorithm = AlgorithmBuilder(self._report).build(spec.algorithm, spec.init, place)
        names, over = [each.name for each in before], spec.over or []
        if unknown := next((each for each in over if each not in names), None):
            hint = did_you_mean(unknown, names, f"earlier fields: {listed(names)}")
            self._error(place, "over", f"{shown(unknown)} is not a field before {place[-1]}", hint)
            return None
        if not over:
            hint = f"add over: [{', '.join(names) or 'FIELD'}]"
            self._error(place, "algorithm", f"{place[-1]} covers no fields", hint)
            return None
        indices = [names.index(each) for each in over]
        if indices != list(range(indices[0], indices[0] + len(indices))):
            whole = names[min(indices) : max(indices) + 1]
            what = f"the fields that {place[-1]} covers do not follow each other"
            self._error(place, "over", what, f"write over: [{', '.join(whole)}]")
            return None
        if algorithm is None or not self._has_place(before[indices[0] :], place, "over"):
            return None
        if kind.bits != algorithm.width:
            what = f"{algorithm.name} has {algorithm.width} bits, {place[-1]} {kind.bits}"
            hint = "use a type as wide as the algorithm"
            self._report.error("checksum-does-not-fit", place, what, hint, of_key=True)
        return Checked(algorithm, over[0], over[-1])

    def _derived(self, text: str, kind: Scalar, before: Sequence[Field], place: Path) -> Role | None:
        match = DERIVED.match(text)
        names = [each.name for each in before]
        if match is None:
            what = f"{shown(text)} does not name a field"
            self._error(place, "equals", what, "write FIELD, ~FIELD, FIELD + N or FIELD - N")
            return None
        name = match["name"]
        if name not in names:
            hint = did_you_mean(name, names, f"earlier fields: {listed(names)}")
            self._error(place, "equals", f"{shown(name)} is not a field before {place[-1]}", hint)
            return None
        source = before[names.index(name)]
        number = source.type.container if isinstance(source.type, Bits) else source.type
        if not isinstance(number, Scalar) or not _is_plain(number) or number.bits != kind.bits:
            what = f"{place[-1]} cannot be derived from {name}"
            hint = f"name an unsigned whole number of {kind.bits} bits, not as text or BCD"
            self._error(place, "equals", what, hint)
            return None
        if not self._has_place(before[names.index(name) :], place, "equals"):
            return None
        added = int((match["added"] or "0").replace(" ", ""))
        if fault := beyond(added, name, kind.bits):
            self._error(place, "equals", *fault)
            return None
        return Derived(name, bool(match["not"]), added)

    def _has_place(self, between: Sequence[Field], place: Path, key: str) -> bool:
        """Whether the fields from the first one named on are at constant distances, or at counted ones."""
        varied = next((each for each in between if self._walked and not each.fixed), None)
        if varied is None:
            return True
        name, first = varied.slot or varied.name, between[0].name
        what = f"{place[-1]} has no constant distance from {first}, because the size of {name} varies"
        self._error(place, key, what, f"put the fields from {first} to {place[-1]} into a record")
        return False


def _is_plain(number: Scalar) -> bool:
    """Whether other numbers can be derived from it."""
    whole = not number.signed and not number.bcd and number.text is None
    return whole and not isinstance(number.meaning, Float) and number.bits <= 64
