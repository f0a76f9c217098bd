"""Finds the heading of a table, and what each of its columns states."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from qlinkgen.importers.notes import Notes

#: What a column can state, and how people call it.
KEYS: Final[Mapping[str, tuple[str, ...]]] = {
    "message": (
        "message",
        "message name",
        "msg",
        "packet",
        "packet name",
        "command",
        "command name",
        "telegram",
    ),
    "id": (
        "id",
        "message id",
        "msg id",
        "packet id",
        "command id",
        "cmd",
        "cmd id",
        "opcode",
        "function code",
    ),
    "direction": ("direction", "dir", "way"),
    "offset": ("offset", "byte", "byte offset", "start byte", "start", "position", "pos", "index", "byte no"),
    "bit": ("bit", "bits", "bit offset", "start bit", "bit position", "bit no", "bit number"),
    "name": (
        "name",
        "field",
        "field name",
        "signal",
        "signal name",
        "parameter",
        "variable",
        "item",
        "member",
    ),
    "type": ("type", "data type", "datatype", "format", "field type"),
    "size": ("size", "length", "len", "width", "bytes", "no of bytes", "number of bytes"),
    "count": ("count", "elements", "array", "array size", "items", "repeat"),
    "scale": ("scale", "factor", "scaling", "scale factor", "resolution", "lsb", "multiplier", "gain"),
    "bias": ("bias", "value offset", "physical offset", "zero"),
    "unit": ("unit", "units", "uom", "engineering unit"),
    "min": ("min", "minimum", "min value", "minimum value", "lower limit", "from"),
    "max": ("max", "maximum", "max value", "maximum value", "upper limit", "to"),
    "range": ("range", "valid range", "limits", "value range"),
    "default": ("default", "default value", "initial value", "initial", "init"),
    "const": ("const", "constant", "fixed value", "fixed"),
    "values": (
        "values",
        "enum",
        "enumeration",
        "states",
        "coding",
        "value table",
        "possible values",
        "options",
    ),
    "doc": (
        "description",
        "desc",
        "doc",
        "comment",
        "comments",
        "remark",
        "remarks",
        "note",
        "notes",
        "meaning",
    ),
    "section": ("section", "chapter", "clause"),
    "byteorder": ("byteorder", "byte order", "endian", "endianness"),
}
_BY_NAME: Final = {name: key for key, names in KEYS.items() for name in names}
_OTHER = re.compile(r"[^a-z0-9]+")
_HINT = re.compile(r"[(\[](.*?)[)\]]")
#: Places in the whole message, where no column states the byte.
_OFFSETS_IN_BITS = ("bit offset", "start bit", "bit position")
#: Rows that may precede the heading: a title, a date, a version.
_SEARCHED = 25


@dataclass(frozen=True, slots=True)
class Row:
    """A row of a table: its line, and the text of its cells."""

    line: int
    cells: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Record:
    """A row below the heading: text by key, without the empty cells."""

    line: int
    values: Mapping[str, str]

    def get(self, key: str) -> str:
        """The text of a key, empty if there is none."""
        return self.values.get(key, "")


@dataclass
class Table:
    """A table below its heading.

    Attributes:
        records: Rows with something in them.
        in_bits: Keys whose column is in bits.
    """

    records: list[Record] = field(default_factory=list)
    in_bits: frozenset[str] = frozenset()


def table(rows: Iterable[Row], notes: Notes, chosen: Mapping[str, str]) -> Table | None:
    """Read a table, None without a heading.

    Args:
        rows: All rows.
        notes: Told of columns that are ignored.
        chosen: Keys of columns by their headings, given by the user; an empty key ignores a column.
    """
    listed = list(rows)
    for number, row in enumerate(listed[:_SEARCHED]):
        keys = _keys(row, chosen)
        if "name" in keys and len(keys.keys() & {"type", "size", "bit", "offset"}) > 0:
            _report(row, keys, notes, chosen)
            return _below(listed[number + 1 :], row, keys)
    return None


def _plain(heading: str) -> str:
    return _OTHER.sub(" ", _HINT.sub(" ", heading.lower())).strip()


def _keys(row: Row, chosen: Mapping[str, str]) -> dict[str, int]:
    """The column of each key; a column that the user has chosen comes first."""
    keys: dict[str, int] = {}
    wanted = {_plain(heading): key for heading, key in chosen.items()}
    plain = [_plain(cell) for cell in row.cells]
    for column, heading in enumerate(plain):
        if wanted.get(heading):
            keys.setdefault(wanted[heading], column)
    for column, heading in enumerate(plain):
        key = _BY_NAME.get(heading, "")
        if key and heading not in wanted:
            if key == "offset" and heading == "offset" and _is_bias(plain, column):
                key = "bias"
            keys.setdefault(key, column)
    if "offset" not in keys and "size" in keys and "bit" in keys and plain[keys["bit"]] in _OFFSETS_IN_BITS:
        keys["offset"] = keys.pop("bit")
    return keys


def _is_bias(headings: Sequence[str], column: int) -> bool:
    """Whether an offset beside a scale is one of values: another column states the place."""
    return any(
        _BY_NAME.get(each) == "offset"
        for at, each in enumerate(headings)
        if at != column and each != "offset"
    )


def _report(row: Row, keys: Mapping[str, int], notes: Notes, chosen: Mapping[str, str]) -> None:
    ignored = {_plain(heading) for heading, key in chosen.items() if not key}
    for column, cell in enumerate(row.cells):
        if cell and column not in keys.values() and _plain(cell) not in ignored:
            text = f"column '{cell[:40]}' is ignored; --map '{cell[:40]}=KEY' says what it states"
            notes.add(row.line, text)


def _below(rows: Iterable[Row], heading: Row, keys: Mapping[str, int]) -> Table:
    records: list[Record] = []
    for row in rows:
        cells = row.cells
        values = {key: cells[at].strip() for key, at in keys.items() if at < len(cells) and cells[at].strip()}
        if values and cells != heading.cells:
            records.append(Record(row.line, values))
    hints = {key: " ".join(_HINT.findall(heading.cells[at].lower())) for key, at in keys.items()}
    in_bits = {key for key, hint in hints.items() if hint.startswith("bit")}
    if "offset" in keys and _plain(heading.cells[keys["offset"]]) in _OFFSETS_IN_BITS:
        in_bits.add("offset")
    return Table(records, frozenset(in_bits))
