"""Versions of a protocol: what is not part of a version is removed before the model is built."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeVar

from pydantic import BaseModel

from qlinkgen.schema.file_base import Lifetime, nested
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.notation import Version
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path

_T = TypeVar("_T")
#: Before every version that a file names.
FIRST = Version((0,))


def check_lifetimes(file: SchemaFile, report: Reporter) -> None:
    """Check that nothing ends, or is deprecated, before it begins."""
    for path, spec in _lifetimes(file, ()):
        for key, end in (("until", spec.until), ("deprecated", spec.deprecated)):
            if spec.since is not None and end is not None and end < spec.since:
                what = f"{key} {end} is before since {spec.since}"
                report.error(
                    "bad-value", (*path, key), what, "write the versions in this order", needs=(path,)
                )


def boundaries(file: SchemaFile) -> tuple[Version, ...]:
    """Versions of which each has its own layout, except the newest: before, at and after every change."""
    lives = [spec for _, spec in _lifetimes(file, ())]
    begins = {spec.since for spec in lives if spec.since is not None}
    ends = {spec.until for spec in lives if spec.until is not None}
    found = begins | ends | {end.next for end in ends}
    return tuple(sorted({FIRST, *found})) if found else ()


def in_version(file: SchemaFile, version: Version | None) -> SchemaFile:
    """The parts of the file that the version has; None is the newest one."""
    # Named types have no lifetime, which is an error of its own.
    types = {name: _pruned(spec, version) for name, spec in file.types.items()}
    return _pruned(file, version).model_copy(update={"types": types})


def _lives(spec: object, version: Version | None) -> bool:
    if not isinstance(spec, Lifetime):
        return True
    if version is None:
        return spec.until is None
    return (spec.since is None or spec.since <= version) and (spec.until is None or version <= spec.until)


def _pruned(node: _T, version: Version | None) -> _T:
    if isinstance(node, BaseModel):
        changed: dict[str, object] = {}
        for name, _, before in nested(node):
            after = _pruned(before, version)
            if after is not before:
                changed[name] = after
        changed |= _noted(node, version)
        return node.model_copy(update=changed) if changed else node
    if isinstance(node, Mapping):
        kept = {key: _pruned(each, version) for key, each in node.items() if _lives(each, version)}
        same = len(kept) == len(node) and all(kept[key] is node[key] for key in kept)
        return node if same else kept  # type: ignore[return-value]  # fields of the model are dicts
    if isinstance(node, list):
        items = [_pruned(each, version) for each in node]
        same = all(one is other for one, other in zip(items, node, strict=True))
        return node if same else items  # type: ignore[return-value]  # fields of the model are lists
    return node


def _noted(node: BaseModel, version: Version | None) -> dict[str, object]:
    """The description of what is deprecated says so."""
    if not isinstance(node, Lifetime) or node.deprecated is None:
        return {}
    if version is not None and version < node.deprecated:
        return {}
    doc = getattr(node, "doc", "").rstrip(".")
    return {"doc": f"{doc}{'. ' if doc else ''}Deprecated since {node.deprecated}"}


def _lifetimes(node: object, path: Path) -> Iterator[tuple[Path, Lifetime]]:
    """Everything in the file that has a lifetime, with its path."""
    if isinstance(node, Lifetime):
        yield path, node
    if isinstance(node, BaseModel):
        for _, key, each in nested(node):
            yield from _lifetimes(each, (*path, key))
    elif isinstance(node, Mapping):
        for name, each in node.items():
            yield from _lifetimes(each, (*path, name))
    elif isinstance(node, list):
        for index, each in enumerate(node):
            yield from _lifetimes(each, (*path, index))
