"""The list of generated files, kept beside them.

It says which files each protocol has in an output folder, and which schema they come from. So a run for one
protocol leaves the others alone, and orphans are found: files of a deleted schema, of a renamed protocol, or
of a back-end that makes them no longer.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import TypedDict

from qlinkgen._resources import schemas_dir
from qlinkgen.backends.base import is_generated
from qlinkgen.cli.boundary import WRONG, Failure
from qlinkgen.cli.common import find_schema
from qlinkgen.model.protocol import Protocol

NAME = "manifest.json"
_NOTE = "Files that `qlinkgen generate` keeps in this folder. Do not edit."


@dataclass
class Entry:
    """What one protocol has in the folder: its schema, and target to paths."""

    schema: str = ""
    files: dict[str, list[str]] = field(default_factory=dict)

    def paths(self) -> set[str]:
        """Every file of the protocol; those of a package are shared with other protocols."""
        return {path for paths in self.files.values() for path in paths}


@dataclass
class Manifest:
    """Entries by protocol name, and hashes by path of the files that have no banner."""

    entries: dict[str, Entry] = field(default_factory=dict)
    hashes: dict[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, text: str, where: Path) -> Manifest:
        """The manifest in a text; ``where`` is its file, for errors.

        One that cannot be read, as after a merge with conflicts, is empty: it is written anew, and nothing is
        removed. Raises Failure for a file that is not a manifest of qlinkgen, and for paths that leave it.
        """
        if json.dumps(_NOTE) not in text:
            raise Failure(
                f"{where} was not written by qlinkgen, which keeps a file of this name in the output folder; "
                "nothing was written: move or delete it, or choose another folder with -o",
                WRONG,
            )
        try:
            found = json.loads(text)
            entries = {name: _entry(entry) for name, entry in found["protocols"].items()}
            hashes = {str(path): str(hashed) for path, hashed in found.get("sha256", {}).items()}
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            return cls()
        manifest = cls(entries, hashes)
        for path in sorted(manifest.paths()):
            if not _is_below(path):
                raise Failure(
                    f"{where} lists {path!r}, which is not a file below its folder; nothing was written: "
                    "remove the line",
                    WRONG,
                )
        return manifest

    def text(self) -> str:
        """The file's text."""
        protocols = {
            name: {
                "schema": entry.schema,
                "files": {target: paths for target, paths in sorted(entry.files.items()) if paths},
            }
            for name, entry in sorted(self.entries.items())
        }
        listed = self.paths()
        hashes = {path: hashed for path, hashed in sorted(self.hashes.items()) if path in listed}
        return json.dumps({"note": _NOTE, "protocols": protocols, "sha256": hashes}, indent=2) + "\n"

    def paths(self) -> set[str]:
        """Every file listed."""
        return set().union(*(entry.paths() for entry in self.entries.values()))

    def add(self, protocol: str, schema: str, target: str, outputs: Mapping[str, str]) -> None:
        """List what a target makes of a protocol, which may be nothing."""
        entry = self.entries.setdefault(protocol, Entry(schema))
        entry.files[target] = sorted(outputs)
        self.hashes |= {path: hash_of(text) for path, text in outputs.items() if not is_generated(text)}

    def over(self, before: Manifest, root: Path) -> Manifest:
        """This run's entries laid over those from before.

        A run for some targets or protocols does not concern the others: they stay, as long as their schema is
        there and was not generated under another name of the protocol.
        """
        made = {entry.schema for entry in self.entries.values()}
        kept = dict(self.entries)
        for name, entry in before.entries.items():
            if name in self.entries:
                kept[name] = Entry(self.entries[name].schema, {**entry.files, **self.entries[name].files})
            elif entry.schema not in made and _exists(entry.schema, root):
                kept[name] = entry
        return Manifest(kept, before.hashes | self.hashes)


class _Stored(TypedDict):
    """An entry as the file has it."""

    schema: str
    files: dict[str, list[str]]


def hash_of(text: str) -> str:
    """Identifies the text of a file that has no banner; line ends do not count."""
    return hashlib.sha256(text.replace("\r\n", "\n").encode()).hexdigest()


def ships(schema: str) -> bool:
    """A SCHEMA comes with qlinkgen, whether it is given by name or by path."""
    return find_schema(schema).resolve().parent == schemas_dir().resolve()


def schema_of(protocol: Protocol, given: str, root: Path) -> str:
    """How a manifest names a schema: by its shipped name, or by its path from the folder."""
    if ships(given):
        return protocol.name
    return Path(os.path.relpath(given, root)).as_posix()


def _entry(found: _Stored) -> Entry:
    files = {str(target): [str(path) for path in paths] for target, paths in found["files"].items()}
    return Entry(str(found["schema"]), files)


def _is_below(path: str) -> bool:
    """Anybody can edit a manifest: it must not lead out of the folder, on any system, nor to itself."""
    kinds = (PurePosixPath(path), PureWindowsPath(path))
    outside = any(pure.anchor or ".." in pure.parts or not pure.name for pure in kinds)
    return not outside and "\0" not in path and str(kinds[0]) == path != NAME


def _exists(schema: str, root: Path) -> bool:
    named = "/" not in schema and not Path(schema).suffix
    return (schemas_dir() / f"{schema}.yaml" if named else root / schema).is_file()
