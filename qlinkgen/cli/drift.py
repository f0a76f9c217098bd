"""The output folder against what it should hold: drift, missing files, orphans; and putting it right."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Literal

from qlinkgen.backends.base import is_generated
from qlinkgen.cli import manifest, output
from qlinkgen.cli.boundary import WRONG, Failure
from qlinkgen.cli.manifest import Manifest, hash_of
from qlinkgen.cli.output import Found


@dataclass(frozen=True, slots=True)
class Change:
    """One file that is not as it should be.

    Attributes:
        ours: qlinkgen wrote it, so it may be replaced or removed.
        obstacle: why no file can be written or removed there.
    """

    path: str
    kind: Literal["changed", "missing", "orphan"]
    ours: bool = True
    obstacle: str = ""


@dataclass
class Folder:
    """An output folder: what is there, what should be, and the difference.

    The folders of the outputs belong to qlinkgen: any other file in them is an orphan, though it is never
    touched. Without ``listed`` there is neither manifest nor orphan, and every file is qlinkgen's.
    """

    root: Path
    listed: bool = True
    made: Manifest = field(default_factory=Manifest)
    wanted: dict[str, str] = field(default_factory=dict)

    def want(self, protocol: str, schema: str, target: str, outputs: dict[str, str]) -> None:
        """Add what a target makes of a protocol. Raises Failure if another one makes the same file."""
        for path, text in outputs.items():
            if self.wanted.setdefault(path, text) != text:
                raise Failure(f"{path} would be made twice, for {protocol} and another; rename the protocol")
        self.made.add(protocol, schema, target, outputs)

    def files(self) -> dict[str, str]:
        """Path to text of everything that should be there; the manifest, if there is one, is last."""
        return {**self.wanted, manifest.NAME: self._kept.text()} if self.listed else self.wanted

    def changes(self) -> list[Change]:
        """Everything that differs, by path. Raises Failure for a manifest that is not qlinkgen's."""
        found = [change for path, text in self.files().items() if (change := self._compare(path, text))]
        found += self._orphans() if self.listed else []
        return sorted(found, key=lambda change: change.path)

    def refusal(self, change: Change) -> str:
        """Why a change cannot be made, "" if it can: qlinkgen did not write what is there."""
        if change.kind == "changed" and not (change.ours or change.obstacle):
            return f"{self.root / change.path} was not written by qlinkgen, or its first lines were changed"
        return change.obstacle

    def taken(self) -> Iterator[str]:
        """Files that are a protocol's of another run, such as `oven_bus` beside the bus module of `oven`."""
        made = self.made.entries
        for name, entry in self._kept.entries.items() if self.listed else ():
            own = {f"{each}.py" for each in (name, *made)}
            for path in sorted(entry.paths() & set(self.wanted)) if name not in made else ():
                if PurePosixPath(path).name in own:
                    yield f"{self.root / path} belongs to the protocol {name}"

    def update(self, changes: Sequence[Change]) -> None:
        """Write what is changed or missing, and remove orphans that an earlier run has made."""
        files = self.files()
        written = {change.path for change in changes if change.kind != "orphan"}
        gone = [change.path for change in changes if change.kind == "orphan" and change.ours]
        output.clean(self.root, [*files, *gone])
        # The manifest is last: if the run is killed, the next one still finds the orphans in it.
        texts = {path: text for path, text in files.items() if path in written}
        output.replace(self.root, texts, gone, last=manifest.NAME)

    def diff(self, change: Change) -> list[str]:
        """How a changed file differs."""
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
            raise Failure(f"{found.obstacle}, where the manifest should be; move or delete it", WRONG)
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
        """A file has the banner, or is listed and as it was written."""
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
        """Files in the folders of this run's outputs."""
        for folder in sorted({str(PurePosixPath(path).parent) for path in self.wanted} - {"."}):
            if (self.root / folder).is_dir():
                for file in (self.root / folder).iterdir():
                    if file.is_file() and not file.name.startswith("."):
                        yield f"{folder}/{file.name}"
