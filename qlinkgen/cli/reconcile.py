"""Operations on output folders: list, check, show, update."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from qlinkgen.cli import manifest
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.common import on_terminal, warn
from qlinkgen.cli.drift import Change, Folder
from qlinkgen.cli.output import locked
from qlinkgen.model.texts import visible


def outputs(folders: Sequence[Folder]) -> list[Path]:
    """Return every file generated from the schemas, without manifests, which depend on other runs too."""
    return sorted(folder.root / path for folder in folders for path in folder.wanted)


def manifests(folders: Sequence[Folder]) -> list[Path]:
    """Return the path of the manifest of every folder that has one."""
    return [folder.root / manifest.NAME for folder in folders if folder.listed]


def list_outputs(folders: Sequence[Folder]) -> int:
    """Print the path of every file, the manifest included."""
    click.echo("\n".join(sorted(str(folder.root / path) for folder in folders for path in folder.files())))
    return FINE


def check(folders: Sequence[Folder]) -> int:
    """Print every difference; return 1 if there are any."""
    with _locked(folders):
        changes = _changes(folders)
        for folder, change in changes:
            _report(folder, change)
    root = folders[0].root
    if not changes:
        click.echo(f"{_total(folders)} files are up to date in {root}")
        return FINE
    click.echo(
        f"qlinkgen: {len(changes)} file{'s' if len(changes) > 1 else ''} out of date in {root}; "
        "run `qlinkgen generate` with the same arguments, and never edit the files",
        err=True,
    )
    return WRONG


def show(folders: Sequence[Folder]) -> int:
    """Print what an update would write and remove. Raises Failure like `update`."""
    with _locked(folders):
        changes = _changes(folders)
        _refuse(folders, changes)
    for folder, change in changes:
        if change.kind != "orphan" or change.ours:
            what = "removed" if change.kind == "orphan" else "written"
            click.echo(f"{folder.root / change.path}: would be {what}")
    return FINE


def update(folders: Sequence[Folder]) -> None:
    """Write changed files and remove orphans. Raises Failure, without any change, if a file is in the way."""
    for folder in folders:
        folder.root.mkdir(parents=True, exist_ok=True)
    with _locked(folders):
        changes = _changes(folders)
        _refuse(folders, changes)
        for folder in folders:
            folder.update([change for owner, change in changes if owner is folder])
    for folder, change in changes:
        if not change.ours:
            path = folder.root / change.path
            warn(f"{path} is among generated files, but qlinkgen did not write it; move it elsewhere")
    written = sum(change.kind != "orphan" for _, change in changes)
    removed = sum(change.kind == "orphan" and change.ours for _, change in changes)
    gone = f", {removed} removed" if removed else ""
    click.echo(f"{written} written, {_total(folders) - written} unchanged{gone} in {folders[0].root}")


@contextlib.contextmanager
def _locked(folders: Sequence[Folder]) -> Iterator[None]:
    with contextlib.ExitStack() as stack:
        for folder in folders:
            if folder.root.is_dir():
                stack.enter_context(locked(folder.root))
        yield


def _changes(folders: Sequence[Folder]) -> list[tuple[Folder, Change]]:
    return [(folder, change) for folder in folders for change in folder.changes()]


def _refuse(folders: Sequence[Folder], changes: Sequence[tuple[Folder, Change]]) -> None:
    refused = [each for folder, change in changes if (each := folder.refusal(change))]
    refused += [each for folder in folders for each in folder.taken()]
    if refused:
        fix = "nothing was written: move or delete it, or choose another folder with -o"
        raise Failure("\n".join([*refused[1:], f"{refused[0]}; {fix}"]), WRONG)


def _total(folders: Sequence[Folder]) -> int:
    return sum(len(folder.files()) for folder in folders)


def _report(folder: Folder, change: Change) -> None:
    explained = {
        "missing": "is missing",
        "changed": "differs",
        "orphan": "is an orphan: it is not generated from any schema",
    }[change.kind]
    click.echo(
        visible(f"{folder.root / change.path}: {explained}{change.obstacle and ': '}{change.obstacle}")
    )
    for line in map(visible, folder.diff(change)):
        click.echo(_coloured(line) if on_terminal() else line)


def _coloured(line: str) -> str:
    colour = {"+": "green", "-": "red", "@": "cyan"}.get(line[:1])
    return click.style(line, fg=colour) if colour else line
