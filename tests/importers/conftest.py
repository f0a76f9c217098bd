"""Runs an importer on text and reads what it has written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

import pytest

from qlinkgen.errors import ImportFileError
from qlinkgen.importers.checking import written
from qlinkgen.importers.document import Document
from qlinkgen.importers.notes import Notes
from qlinkgen.schema import loads
from qlinkgen.schema.source import Data, parse


class Reader(Protocol):
    """The function of an importer."""

    def __call__(self, path: Path | str, notes: Notes, /) -> Document: ...


@dataclass(frozen=True)
class Imported:
    """What an importer made of a text: the schema, its data, and the notes without the name of the file."""

    text: str
    data: dict[str, Data]
    notes: list[str]

    def part(self, *path: str) -> Data:
        found: Data = self.data
        for each in path:
            found = cast("dict[str, Data]", found)[each]
        return found


class Import(Protocol):
    """Imports a text."""

    def __call__(self, read: Reader, text: str | bytes, name: str = "file.txt") -> Imported: ...


@pytest.fixture
def imported(tmp_path: Path) -> Import:
    """A function that imports a text: the schema passes lint."""

    def run(read: Reader, text: str | bytes, name: str = "file.txt") -> Imported:
        return import_text(tmp_path, read, text, name)

    return run


def import_text(folder: Path, read: Reader, text: str | bytes, name: str) -> Imported:
    file = folder / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    notes = Notes(name)
    schema = written(read(file, notes), notes)
    protocol, faults = loads(schema, "schema.yaml")
    assert protocol is not None
    assert {each.rule for each in faults} <= {"unconfirmed", "unused-type"}
    data = parse(schema).data
    assert isinstance(data, dict)
    return Imported(schema, data, [str(each).removeprefix(f"{name}:") for each in sorted(notes.found)])


def refused(folder: Path, read: Reader, text: str | bytes, name: str = "file.txt") -> str:
    """The error of an importer, without the folder."""
    with pytest.raises(ImportFileError) as caught:
        import_text(folder, read, text, name)
    return str(caught.value).replace(f"{folder}/", "")


def survives(folder: Path, read: Reader, text: str | bytes, name: str = "file.txt") -> bool:
    """Whether an importer takes something of a text; any other end than its own error is a failure."""
    try:
        import_text(folder, read, text, name)
    except ImportFileError:
        return False
    return True
