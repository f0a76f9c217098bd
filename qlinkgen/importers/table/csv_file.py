"""Reads the rows of a CSV file in the dialects of spreadsheets."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path

from qlinkgen.importers.notes import Notes
from qlinkgen.importers.reading import content, text_of
from qlinkgen.importers.table.columns import Row

_DELIMITERS = (",", ";", "\t", "|")
_SAMPLE = 30
MOST_ROWS = 100_000


def csv_rows(path: Path | str, notes: Notes) -> Iterator[Row]:
    """Give the rows with the lines on which they begin.

    Raises:
        ImportFileError: the file cannot be read, or a quoted cell does not end.
    """
    text = text_of(content(path), notes)
    reader = csv.reader(io.StringIO(text), delimiter=_delimiter(text), strict=True)
    line = 1
    for number in range(MOST_ROWS + 1):
        try:
            cells = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            raise notes.error(line, f"this row is not CSV: {error}") from None
        if number == MOST_ROWS:
            break
        yield Row(line, tuple(cells))
        line = reader.line_num + 1
    raise notes.error(line, f"more than {MOST_ROWS} rows")


def _delimiter(text: str) -> str:
    """The character that divides a row of the beginning into the most cells."""
    lines = text.splitlines()[:_SAMPLE]
    return max(_DELIMITERS, key=lambda each: max((line.count(each) for line in lines), default=0))
