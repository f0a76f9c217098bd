"""The slots of a schema: every place for free text, found in the classes of the file model.

A new key declared as `Text` or `Label` has slots without a change here. It fails
`test_every_text_of_the_file_model_has_a_slot` until a schema in this folder contains its mapping.
"""

from __future__ import annotations

import copy
import functools
import typing
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel

from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import kinds, loads
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.source import parse

FOLDER = Path(__file__).parent
SCHEMAS = ("delimited", "marked", "packet", "several")
#: Mapping and key of a text, such as ("FieldSpec", "unit").
Kind = tuple[str, str]


@dataclass(frozen=True)
class Slot:
    """A place for a text: its path in the file, and the mapping and key that declare it."""

    path: tuple[str | int, ...]
    kind: Kind


def kinds_of_slots() -> set[Kind]:
    """Every text that the file model declares."""
    found: set[Kind] = set()
    seen: set[type[BaseModel]] = set()

    def visit(model: type[BaseModel]) -> None:
        if model in seen:
            return
        seen.add(model)
        for key, hint in typing.get_type_hints(model, include_extras=True).items():
            if key in model.model_fields:
                found.update((model.__name__, key) for part in _parts(hint) if _is_text(part))
                for part in _parts(hint):
                    if _is_model(part):
                        visit(part)

    visit(SchemaFile)
    return found


def _parts(hint: Any) -> Iterator[Any]:
    """An annotation and all annotations inside it."""
    yield hint
    for part in typing.get_args(hint):
        yield from _parts(part)


def _is_model(hint: Any) -> bool:
    return isinstance(hint, type) and issubclass(hint, BaseModel)


def _is_table(hint: Any) -> bool:
    return getattr(hint, "__origin__", None) is dict


def _is_list(hint: Any) -> bool:
    return getattr(hint, "__origin__", None) is list


def _is_text(hint: Any) -> bool:
    return hint in (kinds.Text, kinds.Label)


@functools.cache
def document(name: str) -> Any:
    """A schema's data, with short forms expanded."""
    data = yaml.safe_load((FOLDER / f"{name}.yaml").read_text("utf-8"))
    _write_out(data, SchemaFile)
    return data


def _write_out(data: Any, hint: Any) -> Any:
    marks = getattr(hint, "__metadata__", ())
    short = next((mark for mark in marks if isinstance(mark, kinds.ShortForm)), None)
    if short is not None and not isinstance(data, dict):
        data = {short.key: data}
    if isinstance(data, dict):
        for key, inner in _members(data, hint):
            data[key] = _write_out(data[key], inner)
    if isinstance(data, list):
        return [_write_out(each, _item(hint)) for each in data]
    return data


def _item(hint: Any) -> Any:
    """The annotation of the items of a list."""
    found = _first(hint, _is_list)
    return typing.get_args(found)[0] if found is not None else None


def _members(data: Mapping[str, Any], hint: Any) -> Iterator[tuple[str, Any]]:
    """Keys of a mapping with the annotations of their values."""
    model = _model_of(data, hint)
    if model is not None:
        hints = typing.get_type_hints(model, include_extras=True)
        yield from ((key, hints[key]) for key in data if key in hints)
        return
    table = _first(hint, _is_table)
    if table is not None:
        yield from ((key, typing.get_args(table)[1]) for key in data)


def _model_of(data: Mapping[str, Any], hint: Any) -> Any:
    """The class of a mapping; None for a table of names, which may be its short form."""
    models = list(_all(hint, _is_model))
    model = next((each for each in models if data.keys() <= each.model_fields.keys()), None)
    model = model or next(iter(models), None)
    short = any(map(_is_table, _parts(hint))) and not _is_table(hint)
    return None if short and model is not None and not data.keys() <= model.model_fields.keys() else model


def _first(hint: Any, wanted: Any) -> Any:
    return next(_all(hint, wanted, through_dicts=True), None)


def _all(hint: Any, wanted: Any, *, through_dicts: bool = False) -> Iterator[Any]:
    """The parts of an annotation that are wanted, without what is inside them."""
    if wanted(hint):
        yield hint
    elif through_dicts or not _is_table(hint):
        for part in typing.get_args(hint):
            yield from _all(part, wanted, through_dicts=through_dicts)


@functools.cache
def slots(name: str) -> tuple[Slot, ...]:
    """The slots that a schema may use; a constant, for example, cannot have a unit."""
    found = list(_slots(document(name), SchemaFile, (), ("", "")))
    for _ in found:
        text = text_of(put(name, found, "x"))
        source, (_, faults) = parse(text), loads(text, name)
        places = {(fault.line, fault.column) for fault in faults}
        refused = {
            path
            for where in (source.keys, source.values)
            for path, position in where.items()
            if (position.line, position.column) in places
        }
        if not refused:
            break
        found = [slot for slot in found if slot.path not in refused]
    return tuple(found)


def _slots(data: Any, hint: Any, path: tuple[str | int, ...], kind: Kind) -> Iterator[Slot]:
    if any(map(_is_text, [hint, *typing.get_args(hint)])) and not isinstance(data, dict | list):
        yield Slot(path, kind)
    elif isinstance(data, list):
        if any(map(_is_text, _parts(hint))):
            yield from (Slot((*path, index), kind) for index in range(len(data)))
        else:
            for index, each in enumerate(data):
                yield from _slots(each, _item(hint), (*path, index), kind)
    elif isinstance(data, dict):
        model = _model_of(data, hint)
        members = dict(_members(data, hint))
        if model is not None:
            texts = typing.get_type_hints(model, include_extras=True)
            absent = {key: texts[key] for key in model.model_fields if key not in data}
            members |= {key: part for key, part in absent.items() if _may_be_text(part)}
        for key, inner in members.items():
            named = (model.__name__, key) if model is not None else kind
            yield from _slots(data.get(key), inner, (*path, key), named)


def _may_be_text(hint: Any) -> bool:
    return any(map(_is_text, [hint, *typing.get_args(hint)])) and typing.get_origin(hint) not in (dict, list)


def put(name: str, places: Iterable[Slot], texts: str | Sequence[str]) -> Any:
    """A schema's data with texts in some of its slots, several texts cyclically.

    A label is the same in all its slots, because it is declared once.
    """
    data = copy.deepcopy(document(name))
    turn = [texts] if isinstance(texts, str) else texts
    for index, slot in enumerate(places):
        parent = data
        for step in slot.path[:-1]:
            parent = parent[step]
        parent[slot.path[-1]] = turn[0] if is_label(slot) else turn[index % len(turn)]
    return data


def is_label(slot: Slot) -> bool:
    """Whether its text is a label: declared in one slot, used in others."""
    return slot.kind[1] in {"values", "attributes"}


def text_of(data: Any) -> str:
    """The YAML of plain data."""
    # The C dumper takes a twentieth of the time; wheels of PyYAML have it, other builds may not.
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    text: str = yaml.dump(data, Dumper=dumper, allow_unicode=True, sort_keys=False, width=1000)
    return text


def protocol_of(
    name: str,
    texts: str | Sequence[str],
    places: Iterable[Slot] | None = None,
    *,
    default: str | None = None,
    file: str = "",
) -> Protocol:
    """The protocol of a schema with texts in some or all of its slots.

    Args:
        name: One of `SCHEMAS`.
        texts: One text, or several, used cyclically.
        places: Slots that get a text, None for all.
        default: Default of the field that is text on the wire, if the schema has one.
        file: Name of the schema's file.
    """
    data = put(name, slots(name) if places is None else places, texts)
    if default is not None and name == "delimited":
        data["commands"]["measure"]["response"]["note"]["default"] = default
    protocol, faults = loads(text_of(data), file or f"{name}.yaml")
    assert protocol is not None, [str(fault) for fault in faults]
    return protocol
