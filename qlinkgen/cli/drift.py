"""Compares an output folder with its expected contents (drift, missing files, orphans), and updates it."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Sequence
from dataclasses import field
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Literal

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.base import is_generated
from qlinkgen.cli import manifest, output
from qlinkgen.cli.boundary import WRONG, Failure
from qlinkgen.cli.manifest import Manifest, hash_of
from qlinkgen.cli.output import Found


@dataclass(frozen=True, slots=True)
class Change:
    """One difference between folder and expected contents.

    Attributes:
        ours: qlinkgen wrote the file, so it may be replaced or removed.
        obstacle: why a file cannot be written or removed there.
    """

    path: str
    kind: Literal["changed", "missing", "orphan"]
    ours: bool = True
    obstacle: str = ""


@dataclass
class Folder:
    """An output folder: actual contents, expected contents, and their difference.

    The folders of the outputs belong to qlinkgen: any other file in them is an orphan, but is never
    changed. Without ``listed`` there is neither a manifest nor an orphan, and every file is qlinkgen's.
    """

    root: Path
    listed: bool = True
    made: Manifest = field(default_factory=Manifest)
    wanted: dict[str, str] = field(default_factory=dict)

    def want(self, protocol: str, schema: str, target: str, outputs: dict[str, str]) -> None:
        """Add the outputs of a target for a protocol. Raises Failure if another one makes the same file."""
        for path, text in outputs.items():
            if self.wanted.setdefault(path, text) != text:
                raise Failure(
                    f"{path} is an output of {protocol} and of another protocol; rename one of them"
                )
        self.made.add(protocol, schema, target, outputs)

    def files(self) -> dict[str, str]:
        """Return path to text of all expected files; the manifest, if any, is last."""
        return {**self.wanted, manifest.NAME: self._kept.text()} if self.listed else self.wanted

    def changes(self) -> list[Change]:
        """Return all differences, by path. Raises Failure for a manifest that is not qlinkgen's."""
        found = [change for path, text in self.files().items() if (change := self._compare(path, text))]
        found += self._orphans() if self.listed else []
        return sorted(found, key=lambda change: change.path)

    def refusal(self, change: Change) -> str:
        """Return why a change cannot be made, "" if it can: qlinkgen did not write the existing file."""
        if change.kind == "changed" and not (change.ours or change.obstacle):
            return f"{self.root / change.path} was not written by qlinkgen, or its banner was changed"
        return change.obstacle

    def taken(self) -> Iterator[str]:
        """Yield files of another protocol of an earlier run, such as `oven_bus` for the bus of `oven`."""
        made = self.made.entries
        for name, entry in self._kept.entries.items() if self.listed else ():
            own = {f"{each}.py" for each in (name, *made)}
            for path in sorted(entry.paths() & set(self.wanted)) if name not in made else ():
                if PurePosixPath(path).name in own:
                    yield f"{self.root / path} belongs to the protocol {name}"

    def update(self, changes: Sequence[Change]) -> None:
        """Write changed and missing files, and remove orphans written by an earlier run."""
        files = self.files()
        written = {change.path for change in changes if change.kind != "orphan"}
        gone = [change.path for change in changes if change.kind == "orphan" and change.ours]
        output.clean(self.root, [*files, *gone])
        # The manifest is written last: after a killed run, the next one still finds the orphans in it.
        texts = {path: text for path, text in files.items() if path in written}
        output.replace(self.root, texts, gone, last=manifest.NAME)

    def diff(self, change: Change) -> list[str]:
        """Return the diff of a changed file."""
        if change.kind != "changed" or change.obstacle:
            return []
        present = (self._found(change.path).data or b"").decode("utf-8", "replace")
        before, after = present.splitlines(), self.files()[change.path].splitlines()
        names = f"{change.path} (in the folder)", f"{change.path} (generated)"
        lines = difflib.unified_diff(before, after, *names, lineterm="")
        return list(lines) or [f"--- {change.path}: line ends differ"]

    @cached_property
    def _before(self) -> Manifest:
        found = self._found(manifest.NAME)
        if found.obstacle:
            raise Failure(f"{found.obstacle}, in place of the manifest; move or delete it", WRONG)
        if found.data is None:
            return Manifest()
        return Manifest.read(found.data.decode("utf-8", "replace"), self.root / manifest.NAME)

    @cached_property
    def _kept(self) -> Manifest:
        return self.made.over(self._before, self.root)

    def _found(self, path: str) -> Found:
        return output.look(self.root, path)

    def _compare(self, path: str, text: str) -> Change | None:
        found = self._found(path)
        if found.obstacle:
            return Change(path, "changed", ours=False, obstacle=found.obstacle)
        if found.data is None:
            return Change(path, "missing")
        if found.data == text.encode():
            return None
        return Change(path, "changed", ours=self._is_ours(path, found.data))

    def _is_ours(self, path: str, data: bytes) -> bool:
        """Whether a file has the banner, or is listed and unchanged."""
        text = data.decode("utf-8", "replace")
        listed = path == manifest.NAME or self._before.hashes.get(path) == hash_of(text)
        return not self.listed or listed or is_generated(text)

    def _orphans(self) -> Iterator[Change]:
        kept = self._kept.paths()
        listed = self._before.paths() - kept
        for path in sorted(listed):
            found = self._found(path)
            if found.obstacle:
                yield Change(path, "orphan", ours=False, obstacle=found.obstacle)
            elif found.data is not None:
                yield Change(path, "orphan", ours=self._is_ours(path, found.data))
        for path in sorted(set(self._present()) - kept - listed):
            yield Change(path, "orphan", ours=False)

    def _present(self) -> Iterator[str]:
        """Yield the files in the folders of this run's outputs."""
        for folder in sorted({str(PurePosixPath(path).parent) for path in self.wanted} - {"."}):
            if (self.root / folder).is_dir():
                for file in (self.root / folder).iterdir():
                    if file.is_file() and not file.name.startswith("."):
                        yield f"{folder}/{file.name}"
