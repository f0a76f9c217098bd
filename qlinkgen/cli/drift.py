"""The output folder against what it should hold: drift, missing files, orphans; and putting it right."""

from __future__ import annotations

import contextlib
import difflib
import os
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Literal

from qlinkgen.cli import manifest
from qlinkgen.cli.manifest import Manifest


@dataclass(frozen=True, slots=True)
class Change:
    """One file that is not as it should be. ``ours``: it is in the manifest, so it may be removed."""

    path: str
    kind: Literal["changed", "missing", "orphan"]
    diff: tuple[str, ...] = ()
    ours: bool = True


@dataclass
class Folder:
    """An output folder: what is there, what should be, and the difference.

    The folders in which outputs stand belong to qlinkgen: whatever else is in them is an orphan.
    ``complete`` says that the run covers every protocol. Without ``listed`` there is neither manifest nor
    orphan.
    """

    root: Path
    complete: bool = False
    listed: bool = True
    made: Manifest = field(default_factory=Manifest)
    wanted: dict[str, str] = field(default_factory=dict)

    def want(self, protocol: str, schema: str, target: str, outputs: dict[str, str]) -> None:
        """Add what a target makes of a protocol."""
        self.wanted.update(outputs)
        self.made.add(protocol, schema, target, outputs)

    def files(self) -> dict[str, str]:
        """Path to text of everything that should be there, the manifest included."""
        return {**self.wanted, manifest.NAME: self._kept().text()} if self.listed else self.wanted

    def changes(self) -> list[Change]:
        """Everything that differs, by path."""
        found = [change for path, text in self.files().items() if (change := self._compare(path, text))]
        found += self._orphans() if self.listed else []
        return sorted(found, key=lambda change: change.path)

    def update(self, changes: Iterable[Change]) -> None:
        """Write what is changed or missing, and remove orphans that an earlier run has made."""
        files = self.files()
        for change in changes:
            if change.kind != "orphan":
                write(self.root / change.path, files[change.path])
            elif change.ours:
                (self.root / change.path).unlink()

    def _kept(self) -> Manifest:
        return self.made.over(Manifest.read(self.root), self.root, complete=self.complete)

    def _compare(self, path: str, text: str) -> Change | None:
        try:
            present = (self.root / path).read_bytes().decode("utf-8", "replace")
        except FileNotFoundError:
            return Change(path, "missing")
        return None if present == text else Change(path, "changed", tuple(_diff(present, text, path)))

    def _orphans(self) -> list[Change]:
        before, kept = set(Manifest.read(self.root).paths()), set(self._kept().paths())
        there = {path for path in before if self._is_below(path)} | set(self._present())
        return [Change(path, "orphan", ours=path in before) for path in sorted(there - kept)]

    def _is_below(self, path: str) -> bool:
        """A manifest is a file that anybody can edit: it must not lead out of the folder."""
        pure = PurePosixPath(path)
        return not pure.is_absolute() and ".." not in pure.parts and (self.root / path).is_file()

    def _present(self) -> Iterator[str]:
        """Files in the folders that outputs of this run stand in."""
        for folder in sorted({str(PurePosixPath(path).parent) for path in self.wanted} - {"."}):
            if (self.root / folder).is_dir():
                for file in (self.root / folder).iterdir():
                    if file.is_file() and not file.name.startswith("."):
                        yield f"{folder}/{file.name}"


def _diff(present: str, text: str, path: str) -> Iterable[str]:
    before, after = present.splitlines(), text.splitlines()
    lines = difflib.unified_diff(before, after, f"{path} (in the folder)", f"{path} (generated)", lineterm="")
    return list(lines) or [f"--- {path}: line ends differ"]


def write(path: Path, text: str) -> None:
    """Replace a file as a whole: a compiler that runs at the same time never sees half of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with open(handle, "w", encoding="utf-8", newline="\n") as file:  # noqa: PTH123  # a descriptor, not a path
            file.write(text)
        Path(name).chmod(path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask())
        Path(name).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(name).unlink()
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
