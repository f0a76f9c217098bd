"""Reads the sheets of a workbook with openpyxl."""

from __future__ import annotations

import io
import warnings
import zipfile
from collections.abc import Iterator
from pathlib import Path

from qlinkgen.errors import ExtraMissing, ImportFileError
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.reading import content
from qlinkgen.importers.table.columns import Row
from qlinkgen.importers.table.csv_file import MOST_ROWS

#: Limits of what a workbook may expand to.
_MOST_BYTES, _MOST_FILES, _MOST_COLUMNS = 64 << 20, 2000, 100


def xlsx_sheets(path: Path | str, notes: Notes) -> Iterator[tuple[str, list[Row]]]:
    """Give the name and the rows of each sheet; formulas have the values that were saved with them.

    Raises:
        ImportFileError: the file is not a workbook, or expands to too much.
        ExtraMissing: the package `openpyxl` is not installed.
    """
    try:
        from openpyxl import load_workbook  # noqa: PLC0415  # an optional package
    except ImportError:
        raise ExtraMissing(
            "importing a workbook needs the package openpyxl: pip install 'qlinkgen[import]'"
        ) from None
    data = content(path)
    try:
        _check(data, notes)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # openpyxl warns of every extension that it does not keep
            book = load_workbook(io.BytesIO(data), read_only=True, data_only=True)
            sheets = [
                (
                    each.title,
                    _rows(each.iter_rows(max_row=MOST_ROWS, max_col=_MOST_COLUMNS, values_only=True)),
                )
                for each in book.worksheets
            ]
            book.close()
    except ImportFileError:
        raise
    except Exception as error:  # noqa: BLE001  # zipfile and openpyxl raise whatever a broken file causes
        text = f"{type(error).__name__}: {error}"[:100]
        raise notes.error(0, f"this is not a workbook that can be read: {text}") from None
    yield from sheets


def _rows(values: Iterator[tuple[object, ...]]) -> list[Row]:
    return [Row(line, tuple(map(_text, cells))) for line, cells in enumerate(values, 1)]


def _text(value: object) -> str:
    if value is None:
        return ""
    # Numbers of a workbook are floating-point ones; most are whole, and the others have the digits shown.
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() else repr(value)
    return str(value)


def _check(data: bytes, notes: Notes) -> None:
    """Refuse what expands to too much, or has entities."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        files = archive.infolist()
        if sum(each.file_size for each in files) > _MOST_BYTES or len(files) > _MOST_FILES:
            raise notes.error(0, f"the workbook expands to more than {_MOST_BYTES >> 20} MiB")
        for each in files:
            if each.filename.endswith((".xml", ".rels")) and _has_entities(archive, each):
                raise notes.error(0, f"{each.filename} in the workbook has a document type; save it again")


def _has_entities(archive: zipfile.ZipFile, each: zipfile.ZipInfo) -> bool:
    # The sizes in the directory of a zip file are only claims.
    with archive.open(each) as file:
        return b"<!DOCTYPE" in file.read(_MOST_BYTES).replace(b"\0", b"").upper()
