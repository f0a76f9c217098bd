"""The list of generated files that stands beside them.

It says which files each protocol has in an output folder, and which schema they come from. So a run for one
protocol leaves the others alone, and what no schema makes any more is found: after a schema was deleted, a
protocol renamed, or a back-end has stopped to make a file.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from qlinkgen._resources import schemas_dir
from qlinkgen.model.protocol import Protocol

NAME = "manifest.json"
_NOTE = "Files that `qlinkgen generate` keeps in this folder. Do not edit."


@dataclass
class Entry:
    """What one protocol has in the folder: its schema, and target to paths. Shared files have no schema."""

    schema: str = ""
    files: dict[str, list[str]] = field(default_factory=dict)


@dataclass
class Manifest:
    """Entries by protocol name; files that all protocols share stand under ""."""

    entries: dict[str, Entry] = field(default_factory=dict)

    @classmethod
    def read(cls, root: Path) -> Manifest:
        """The manifest of a folder, an empty one if there is none; a spoilt one is written anew anyway."""
        try:
            found = json.loads((root / NAME).read_text("utf-8"))["protocols"]
            return cls({name: _entry(entry) for name, entry in found.items()})
        except (FileNotFoundError, ValueError, KeyError, TypeError, AttributeError):
            return cls()

    def text(self) -> str:
        """The file's text."""
        protocols = {
            name: {"schema": entry.schema, "files": dict(sorted(entry.files.items()))}
            for name, entry in sorted(self.entries.items())
        }
        return json.dumps({"note": _NOTE, "protocols": protocols}, indent=2) + "\n"

    def paths(self) -> Iterator[str]:
        """Every file listed."""
        for entry in self.entries.values():
            for paths in entry.files.values():
                yield from paths

    def add(self, protocol: str, schema: str, target: str, outputs: Mapping[str, str]) -> None:
        """List what a target makes of a protocol."""
        entry = self.entries.setdefault(protocol, Entry(schema))
        entry.files[target] = sorted(outputs)

    def over(self, before: Manifest, root: Path, *, complete: bool) -> Manifest:
        """This run's entries laid over those from before.

        A run for some targets or protocols says nothing about the others: they stay, as long as their
        schema is there. ``complete`` says that the run covers every protocol of the folder.
        """
        made = {entry.schema for entry in self.entries.values()}
        kept = dict(self.entries)
        for name, entry in before.entries.items():
            files = {**entry.files, **(self.entries[name].files if name in self.entries else {})}
            if name in self.entries:
                kept[name] = Entry(self.entries[name].schema, files)
            elif not complete and entry.schema not in made and _exists(entry.schema, root):
                kept[name] = entry
        return Manifest(kept)


def schema_of(protocol: Protocol, given: str, root: Path) -> str:
    """How a manifest names a schema: by its shipped name, or by its path from the folder."""
    if "/" not in given and not Path(given).suffix:
        return protocol.name
    return Path(os.path.relpath(given, root)).as_posix()


def _entry(found: Any) -> Entry:
    files = {str(target): [str(path) for path in paths] for target, paths in found["files"].items()}
    return Entry(str(found["schema"]), files)


def _exists(schema: str, root: Path) -> bool:
    named = "/" not in schema and not Path(schema).suffix
    return (schemas_dir() / f"{schema}.yaml" if named else root / schema).is_file()
