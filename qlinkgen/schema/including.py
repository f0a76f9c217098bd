"""`include`: the types, replies, commands and messages of another schema, as if written in the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from pathlib import PurePosixPath

from qlinkgen.schema.reading import read_regular, reason_of
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Data, Path, Position, Source, parse

_RULE = "bad-include"
_KEY: Path = ("include",)
#: Mappings that are taken over, by name; the rest belongs to one protocol.
GROUPS = ("enums", "flags", "types", "attributes", "replies", "to_unknown", "commands", "messages")
#: Frames of the other document.
_LEFT = "examples"


def include(source: Source, report: Reporter) -> tuple[str, ...]:
    """Add what the file includes to its data; returns the text of each other file."""
    data = source.data
    name = data.get("include") if isinstance(data, dict) else None
    if not isinstance(data, dict) or not isinstance(name, str):
        return ()
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or not path.suffix:
        report.error(_RULE, _KEY, f"'{name}' is not a file beside or below this one", "write NAME.yaml")
        return ()
    file = FilePath(report.file).parent / path
    try:
        text = read_regular(file)
    except (OSError, UnicodeDecodeError) as error:
        report.error(_RULE, _KEY, f"cannot read '{name}': {reason_of(error)}", "check the path")
        return ()
    other = parse(text)
    for fault in other.faults:
        report.at(fault.rule, replace(fault.position, file=str(file)), fault.message, fault.hint)
    if not isinstance(other.data, dict) or "include" in other.data:
        what = f"'{name}' is not a schema without an include of its own"
        report.error(_RULE, _KEY, what, "include a file that holds everything itself")
        return ()
    _merge(data, other.data)
    _place(source.keys, other.keys, str(file))
    _place(source.values, other.values, str(file))
    return (text,)


def _merge(data: dict[str, Data], other: Mapping[str, Data]) -> None:
    """Add the entries of the groups; keys of an entry in the file replace those of the same entry."""
    for group in GROUPS:
        theirs, ours = other.get(group), data.get(group, {})
        if not isinstance(theirs, dict) or not isinstance(ours, dict):
            continue
        merged: dict[str, Data] = {name: _without_examples(entry) for name, entry in theirs.items()}
        for name, entry in ours.items():
            before = merged.get(name)
            both = isinstance(before, dict) and isinstance(entry, dict)
            merged[name] = {**before, **entry} if both else entry  # type: ignore[dict-item]
        data[group] = merged


def _without_examples(entry: Data) -> Data:
    if not isinstance(entry, dict):
        return entry
    return {key: value for key, value in entry.items() if key != _LEFT}


def _place(ours: dict[Path, Position], theirs: Mapping[Path, Position], file: str) -> None:
    """Add the positions of what was added."""
    for path, position in theirs.items():
        if path and path[0] in GROUPS:
            ours.setdefault(path, replace(position, file=file))
