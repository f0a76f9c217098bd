"""First pass: validates each mapping of the file.

A wrong node is reported and removed, and the rest is validated again, so that one error does not hide others.
A required node is replaced by a placeholder. Both are tainted in the report, so that errors derived from them
are suppressed.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from typing import get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from qlinkgen.schema.characters import CONTROL_CHARACTER, HINT
from qlinkgen.schema.file_base import BRANCH
from qlinkgen.schema.file_fields import ChoiceSpec, FieldSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Data, Path
from qlinkgen.schema.synonyms import key_hint, value_hint

#: Placeholders of required keys, so that the rest of their mapping can be validated.
_STAND_INS: dict[str, Data] = {
    "qlinkgen": 1, "protocol": {}, "name": "unnamed", "revision": "", "source": "",
    "frame": {}, "bus": {}, "kind": "host",
    "type": "u8", "id": 0, "fields": {}, "at": 0,
}  # fmt: skip
#: More rounds than levels of nested mappings.
_ROUNDS = 40
_EXPECTED = {
    "int_type": "write a whole number",
    "bool_type": "write true or false",
    "string_type": "write text",
    "list_type": "write a list, like [a, b]",
}


def check_structure(data: Data, report: Reporter) -> SchemaFile | None:
    """Validate plain data as a schema file, without its wrong nodes; None if nothing usable is left."""
    if not isinstance(data, dict):
        what = "the file is empty" if data is None else f"the file is {shown(data)}, not a mapping of keys"
        report.error("wrong-type", (), what, "begin with qlinkgen: 1 and protocol:")
        return None
    remaining = data
    for _ in range(_ROUNDS):
        try:
            return SchemaFile.model_validate(remaining)
        except ValidationError as error:
            details = error.errors(include_url=False)
        if remaining is data:
            remaining = copy.deepcopy(data)
        _Round(details, remaining, report).run()
    return None


class _Round:
    """Reports the errors of one validation, and repairs the data for the next."""

    def __init__(self, details: Sequence[ErrorDetails], data: Data, report: Reporter) -> None:
        self._details = [(detail, _path_in(data, detail["loc"])) for detail in details]
        self._data = data
        self._report = report

    def run(self) -> None:
        """Report all errors before repairs, which change the data that their texts quote."""
        for detail, path in self._details:
            if detail["type"] == "missing":
                self._missing(path)
            else:
                self._wrong(detail, path)
        for detail, path in sorted(self._details, key=lambda each: -len(each[1])):
            self._repair(path, missing=detail["type"] == "missing")

    def _missing(self, path: Path) -> None:
        key = str(path[-1])
        if self._report.touched(path) or key in self._meant(path[:-1]):
            return
        self._report.error(
            "missing-key", path[:-1], f"key '{key}' is missing", _purpose(path), of_key=True, needs=()
        )

    def _keys_at(self, path: Path) -> list[str]:
        """Keys that a mapping may have."""
        if "cases" in path:
            return _keys_at((*path[: path.index("cases")],))
        mapping = _at(self._data, path)
        if _is_field(path) and isinstance(mapping, dict) and "switch" in mapping:
            return list(ChoiceSpec.model_fields)
        return _keys_at(path)

    def _meant(self, parent: Path) -> set[str]:
        """Keys of a mapping of which unknown keys are probably misspellings."""
        unknown = [path for detail, path in self._details if detail["type"] == "extra_forbidden"]
        known = self._keys_at(parent)
        words = [str(path[-1]) for path in unknown if path[:-1] == parent]
        hints = [key_hint(word, known, field=False) or did_you_mean(word, known) for word in words]
        meant = {hint.partition(":")[0] for hint in hints}
        return {key for key in known if meant & {f"did you mean '{key}'?", f"write {key}"}}

    def _wrong(self, detail: ErrorDetails, path: Path) -> None:
        kind, seen = detail["type"], detail["input"]
        if kind == "extra_forbidden":
            key, known = str(path[-1]), self._keys_at(path[:-1])
            hint = key_hint(key, known, field=_is_field(path[:-1]))
            hint = hint or did_you_mean(key, known, f"known here: {listed(known)}")
            self._report.error("unknown-key", path, f"unknown key {shown(key)}", hint, of_key=True, needs=())
            return
        rule, what, hint = _explained(kind, seen, detail)
        self._report.error(rule, path, what, hint, needs=())

    def _repair(self, path: Path, *, missing: bool) -> None:
        parent, key = _at(self._data, path[:-1]), path[-1] if path else ""
        # Removing an item from a list would shift the indices of later items.
        while isinstance(parent, list):
            path = path[:-1]
            parent, key = _at(self._data, path[:-1]), path[-1]
        self._report.taint(path)
        if not isinstance(parent, dict):
            return
        if missing and key in _STAND_INS:
            parent[str(key)] = copy.deepcopy(_STAND_INS[str(key)])
        elif missing:
            self._repair(path[:-1], missing=False)
        else:
            parent.pop(str(key), None)


def _explained(kind: str, seen: object, detail: ErrorDetails) -> tuple[str, str, str]:
    """Rule, message and hint for an invalid value."""
    context = detail.get("ctx", {})
    if kind == "literal_error":
        given = context["expected"].replace("True", "true").replace(" or ", ", ")
        allowed = [word.strip("'") for word in given.split(", ")]
        hint = value_hint(str(seen), allowed) or did_you_mean(
            str(seen), allowed, f"use {listed(allowed, 'or')}"
        )
        return "bad-value", f"{shown(seen)} is not allowed here", hint
    if kind == CONTROL_CHARACTER:
        return kind, context["seen"], HINT
    if kind == "value_error":
        what, _, hint = str(context["error"]).partition("; ")
        return "bad-value", what, hint
    if kind == "greater_than_equal":
        return "bad-value", f"{shown(seen)} is too small", f"use {context['ge']} or more"
    if kind == "less_than_equal":
        return "bad-value", f"{shown(seen)} is too large", f"use {context['le']} or less"
    if kind in {"too_short", "too_long"} and context["actual_length"]:
        wanted = context["max_length" if kind == "too_long" else "min_length"]
        return "bad-value", f"the number of its entries is {context['actual_length']}", f"write {wanted}"
    if kind == "too_short":
        return (
            "bad-value",
            f"the {'list' if isinstance(seen, list) else 'mapping'} is empty",
            "write at least one entry, or remove the key",
        )
    return (
        "wrong-type",
        f"{shown(seen)} has the wrong type",
        _EXPECTED.get(kind, "write a mapping (key: value)"),
    )


def _purpose(path: Path) -> str:
    model, key = _model_at(path[:-1]), str(path[-1])
    description = model.model_fields[key].description if model and key in model.model_fields else None
    return f"add {key}: {description[0].lower()}{description[1:]}" if description else f"add {key}:"


def _path_in(data: Data, location: tuple[int | str, ...]) -> Path:
    """The path of an error in the file, without branches of unions and keys implied by short forms."""
    path: list[int | str] = []
    for step in location:
        if isinstance(step, str) and step.startswith(BRANCH):
            continue
        if not isinstance(data, dict | list):
            break
        path.append(step)
        data = _item(data, step)
    return tuple(path)


def _item(data: Data, step: int | str) -> Data:
    if isinstance(data, dict):
        return data.get(str(step))
    return data[step] if isinstance(data, list) and isinstance(step, int) and step < len(data) else None


def _at(data: Data, path: Path) -> Data:
    for step in path:
        data = _item(data, step)
    return data


def _model_at(path: Path) -> type[BaseModel] | None:
    """The class of the mapping at a path."""
    here: object = SchemaFile
    for step, below in zip(path, (*path, None)[1:], strict=True):
        if isinstance(here, type) and issubclass(here, BaseModel):
            field = here.model_fields.get(str(step))
            here = field.annotation if field else None
        else:
            here = next((part for part in reversed(get_args(here)) if part is not str), None)
        here = _mapping_type(here, below)
    return here if isinstance(here, type) and issubclass(here, BaseModel) else None


def _mapping_type(annotation: object, below: int | str | None) -> object:
    """The mapping or list inside an annotation; of several, the class that has the key ``below``."""
    found = list(_mapping_types(annotation))
    classes = [each for each in found if isinstance(each, type) and issubclass(each, BaseModel)]
    fitting = (each for each in classes if below is None or str(below) in each.model_fields)
    return next(fitting, found[0] if found else None)


def _mapping_types(annotation: object) -> Iterator[object]:
    is_class = isinstance(annotation, type) and issubclass(annotation, BaseModel)
    if is_class or getattr(annotation, "__origin__", None) in (dict, list):
        yield annotation
    else:
        for part in get_args(annotation):
            yield from _mapping_types(part)


def _is_field(path: Path) -> bool:
    model = _model_at(path)
    return model is not None and issubclass(model, FieldSpec)


def _keys_at(path: Path) -> list[str]:
    model = _model_at(path)
    return [field.alias or name for name, field in model.model_fields.items()] if model else []
