"""Choices by an earlier field: each becomes fields that exclude each other, one for each case.

The cases of a choice named ``value`` are fields named ``value_CASE``, present where the tested field has the
values of the case. Fields in braces become a record, named after their place.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TypeVar

from pydantic import BaseModel

from qlinkgen.schema.file_base import nested
from qlinkgen.schema.file_fields import CaseOf, ChoiceSpec, FieldSpec, RecordSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.notation import TestText, Wanted, wanted
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path

_T = TypeVar("_T")
_RULE = "bad-switch"
#: Name of the case of all other values.
OTHER = "other"
#: Keys that a case does not have, by attribute: the choice decides whether it is present, and it has a value.
_FOREIGN = {
    "counts": "counts", "echo": "echo", "equals": "equals", "when": "if", "optional": "optional",
    "const": "const", "reserved": "reserved", "bits": "bits",
}  # fmt: skip


def without_choices(file: SchemaFile, report: Reporter) -> SchemaFile:
    """The file with the cases of each choice in its place."""
    rewriter = _Rewriter(report)
    found = rewriter.rewritten(file, ())
    if not rewriter.records:
        return found
    for name, path in rewriter.records_at.items():
        if name in file.types:
            what = f"the fields of this case become the record {name}, which is also a type"
            report.error(_RULE, path, what, "rename the type", of_key=True)
    return found.model_copy(update={"types": {**rewriter.records, **found.types}})


@dataclass(frozen=True, slots=True)
class _Case:
    """One case as written: its name, when it applies, its place, and what it is."""

    name: str
    test: TestText
    path: Path
    spec: FieldSpec | Mapping[str, FieldSpec]


class _Rewriter:
    """Replaces choices by fields.

    Attributes:
        records: those of fields in braces, by name.
        records_at: their places.
    """

    def __init__(self, report: Reporter) -> None:
        self._report = report
        self.records: dict[str, RecordSpec] = {}
        self.records_at: dict[str, Path] = {}

    def rewritten(self, node: _T, path: Path) -> _T:
        """A node of the file without choices in it."""
        if isinstance(node, BaseModel):
            changed: dict[str, object] = {}
            for name, key, before in nested(node):
                after = self.rewritten(before, (*path, key))
                if after is not before:
                    changed[name] = after
            return node.model_copy(update=changed) if changed else node
        if isinstance(node, Mapping):
            found: dict[str, object] = {}
            for name, each in node.items():
                if isinstance(each, ChoiceSpec):
                    found |= self._fields(name, each, node, path)
                else:
                    found[name] = self.rewritten(each, (*path, name))
            same = found.keys() == node.keys() and all(found[name] is node[name] for name in found)
            return node if same else found  # type: ignore[return-value]  # fields of the model are dicts
        if isinstance(node, list):
            items = [self.rewritten(each, (*path, index)) for index, each in enumerate(node)]
            same = all(one is other for one, other in zip(items, node, strict=True))
            return node if same else items  # type: ignore[return-value]  # fields of the model are lists
        return node

    def _fields(
        self, slot: str, choice: ChoiceSpec, beside: Mapping[str, object], path: Path
    ) -> dict[str, FieldSpec]:
        """The fields of a choice."""
        place, found = (*path, slot), dict[str, FieldSpec]()
        cases = tuple(self._cases(choice, place))
        named = tuple(value for each in cases if each.name != OTHER for value in each.test.wanted)
        for case in cases:
            name = f"{slot}_{case.name}"
            if name in beside or name in found:
                what = f"a case of {slot} is called {name}, like another field"
                self._report.error(_RULE, case.path, what, "rename that field", of_key=True)
            spec = case.spec
            if not isinstance(spec, FieldSpec):
                if not spec:
                    continue
                spec = self._record(f"{_stem(place)}_{case.name}", spec, case.path)
            spec = self._checked(spec, case.path)
            of = CaseOf(slot, case.name, None if choice.default is not None else named)
            found[name] = _with_facts(spec, choice).as_case(of, case.test)
            self._report.move((*path, name), case.path)
            self._report.move((*path, name, "if"), case.path)
            for key in choice.model_fields_set - spec.model_fields_set - {"default"}:
                self._report.move((*path, name, key), (*place, key))
        if not found:
            what = f"no case of {slot} has a value"
            self._report.error(_RULE, place, what, "give one of them a type, or remove it", of_key=True)
        return found

    def _cases(self, choice: ChoiceSpec, path: Path) -> Iterator[_Case]:
        known: list[Wanted] = []
        for key, spec in choice.cases.items():
            place = (*path, "cases", key)
            try:
                value = wanted(key)
            except ValueError as error:
                what, _, hint = str(error).partition("; ")
                hint = hint or "write a number, a range first..last, or a name"
                self._report.error(_RULE, place, what, hint, of_key=True)
                continue
            known.append(value)
            yield _Case(_label(value), TestText(choice.switch, (value,), negated=False), place, spec)
        if choice.default is not None and known:
            test = TestText(choice.switch, tuple(known), negated=True)
            yield _Case(OTHER, test, (*path, "default"), choice.default)

    def _record(self, name: str, fields: Mapping[str, FieldSpec], path: Path) -> FieldSpec:
        """The field that holds a record of these fields."""
        self.records[name] = RecordSpec(fields=dict(fields))
        self.records_at[name] = path
        self._report.move(("types", name), path)
        self._report.move(("types", name, "fields"), path)
        return FieldSpec(type=name)

    def _checked(self, spec: FieldSpec, path: Path) -> FieldSpec:
        """A case without keys that a case does not have."""
        for attribute, key in _FOREIGN.items():
            if getattr(spec, attribute):
                what = f"'{key}' has no effect on a case"
                hint = "put the field into braces, as {NAME: {type: ..}}, which makes it a record"
                self._report.error("not-applicable", (*path, key), what, hint, of_key=True)
        return spec.model_copy(update={name: FieldSpec.model_fields[name].default for name in _FOREIGN})


def _stem(path: Path) -> str:
    """The name of a place: of the command or message, and the field."""
    words = [str(each) for each in path[1:]]
    return "_".join(
        word for index, word in enumerate(words) if index == 0 or word not in ("fields", "replies")
    )


def _label(value: Wanted) -> str:
    """The name of a case."""
    if value.name:
        return value.name
    if value.truth:
        return f"case_{value.text.strip(chr(39))}"
    ends = [f"m{-each}" if each < 0 else str(each) for each in (value.first, value.last)]
    return "_".join(("case", *dict.fromkeys(ends)))


def _with_facts(spec: FieldSpec, choice: ChoiceSpec) -> FieldSpec:
    """A case with what is stated of the whole choice."""
    facts = {
        "doc": spec.doc or choice.doc,
        "section": spec.section or choice.section,
        "confirmed": spec.confirmed and choice.confirmed,
        "since": choice.since,
        "until": choice.until,
        "deprecated": choice.deprecated,
    }
    return spec.model_copy(update=facts)
