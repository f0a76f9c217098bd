"""Exports of logic analysers: tables of Saleae's Logic, annotations of sigrok and PulseView."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from decimal import Decimal, InvalidOperation
from typing import BinaryIO, Literal, NamedTuple

from qlinkgen.captures.lines import lines
from qlinkgen.captures.pcapng import Direction
from qlinkgen.captures.records import NANO, Problems, Record
from qlinkgen.captures.times import direction

Radix = Literal["hexadecimal", "binary", "decimal", "characters"]

_TIMES = ("time [s]", "start_time", "start time", "start", "time")
_VALUES = ("value", "data", "mosi")
_NAMES = ("name", "analyzer name", "analyzer")
_FAULTS = ("parity error", "framing error", "error")
#: Rows of other kinds than these have no byte.
_KINDS = ("data", "result", "")
#: Characters that Logic writes as words.
_WORDS = {
    "comma": ",",
    "\\r": "\r",
    "\\n": "\n",
    "\\t": "\t",
    "\\0": "\0",
    "\\\\": "\\",
    "' '": " ",
    "space": " ",
}
_SHOWN = re.compile(r".{0,6}\((0x[0-9A-Fa-f]{1,2})\)$|.{0,6}(\\x[0-9A-Fa-f]{2})$", re.DOTALL)

#: Sigrok: sample numbers, decoder, class of annotation, value; PulseView writes them alike.
_NOTE = re.compile(
    r"(?:(?P<start>\d+)-(?P<end>\d+)\s+)?(?P<decoder>uart(?:-\d+)?|UART(?:\s*\[\d+\])?(?:\s*\d+)?)\s*:\s*"
    r"(?:(?P<kind>[A-Za-z][A-Za-z _-]*?)\s*:\s*)?\"?(?P<value>.*?)\"?\s*$"
)
_BYTE = re.compile(r"[0-9A-Fa-f]{2}$")
_ESCAPED = re.compile(r"\[([0-9A-Fa-f]{2})\]$")


class _Columns(NamedTuple):
    """Where a table has what."""

    time: int
    value: int
    kind: int | None
    name: int | None
    faults: tuple[int, ...]


def is_saleae(heads: Sequence[str]) -> bool:
    """Whether lines begin with the header of a table of Logic."""
    return bool(heads) and _columns(_cells(heads[0])) is not None


def read_saleae(file: BinaryIO, problems: Problems) -> Iterator[Record]:
    """Return a record for each byte; those with a wrong parity or stop bit are noted, and read.

    The radix of the display is found from the first values.
    """
    columns: _Columns | None = None
    held: list[Record] = []
    values: list[str] = []
    radix: Radix | None = None
    for line in lines(file, problems):
        if columns is None:
            columns = _columns(_cells(line.text))
            continue
        cells = _cells(line.text)
        if not cells:
            continue
        if max(columns.time, columns.value, *columns.faults, 0) >= len(cells):
            problems.add(line.offset, f"the row has {len(cells)} columns, less than its header; passed over")
            continue
        if columns.kind is not None and cells[columns.kind].lower() not in _KINDS:
            continue
        record = _record(columns, cells, line.offset, problems)
        if radix is None:
            held.append(record)
            values.append(cells[columns.value])
            if len(held) < _ENOUGH:
                continue
            radix = _radix(values)
            yield from _all(held, values, radix, problems)
            held, values = [], []
        else:
            yield from _all([record], [cells[columns.value]], radix, problems)
    yield from _all(held, values, _radix(values), problems)


#: Rows from which the radix is found.
_ENOUGH = 256


def _all(records: list[Record], values: list[str], radix: Radix, problems: Problems) -> Iterator[Record]:
    for record, value in zip(records, values, strict=True):
        byte = _byte(value, radix)
        if byte is None:
            problems.add(record.offset, f"'{value}' is not a byte in {radix}; passed over")
        else:
            yield record._replace(data=bytes([byte]))


def _record(columns: _Columns, cells: list[str], offset: int, problems: Problems) -> Record:
    try:
        at = int(Decimal(cells[columns.time]) * NANO)
    except (InvalidOperation, OverflowError):
        problems.add(offset, f"'{cells[columns.time]}' is not a time; the byte is read without one")
        at = None
    wrong = [cells[each] for each in columns.faults if cells[each].strip()]
    if wrong and wrong[0].strip().lower() not in ("false", "0"):
        problems.add(offset, f"the analyser states '{wrong[0]}' for a byte; it is read")
    name = cells[columns.name] if columns.name is not None else ""
    return Record(b"", offset, at, direction(name), name)


def _cells(text: str) -> list[str]:
    # The value of a comma is not quoted in the export of Logic 1, nor is a quote.
    if text.endswith((",,,,", ',",,')):
        return [*text.split(",")[:1], text.split(",")[1] or ",", "", ""]
    try:
        return next(csv.reader([text]), [])
    except csv.Error:  # a damaged line
        return [text]


def _columns(cells: list[str]) -> _Columns | None:
    names = [each.strip().lower() for each in cells]

    def place(of: Sequence[str]) -> int | None:
        return next((names.index(each) for each in of if each in names), None)

    time, value = place(_TIMES), place(_VALUES)
    if time is None or value is None or time == value:
        return None
    faults = tuple(names.index(each) for each in _FAULTS if each in names)
    return _Columns(time, value, place(("type",)), place(_NAMES), faults)


def _radix(values: Sequence[str]) -> Radix:
    """Return how bytes are written: as most values are; the file may be damaged."""

    def most(share: int) -> bool:
        return share * 2 > len(values)

    if most(sum(each.lower().startswith("0x") for each in values)):
        return "hexadecimal"
    if most(sum(each.lower().startswith("0b") for each in values)):
        return "binary"
    numbers = [each for each in values if each.isdecimal() and int(each) < 256]
    return "decimal" if most(len(numbers)) and any(len(each) > 1 for each in numbers) else "characters"


def _byte(value: str, radix: Radix) -> int | None:
    base = {"hexadecimal": 16, "binary": 2, "decimal": 10}.get(radix)
    if base is not None:
        try:
            found = int(value.replace(" ", ""), base)
        except ValueError:
            return None
        return found if found < 256 else None
    if shown := _SHOWN.match(value):
        return int((shown[1] or f"0{shown[2][1:]}"), 16)
    text = _WORDS.get(value.lower(), value)
    if len(text) == 3 and text[0] == text[-1] == "'":
        text = text[1]
    return ord(text) if len(text) == 1 and ord(text) < 256 else None


def is_annotation(text: str) -> bool:
    """Whether a line is an annotation of sigrok's UART decoder."""
    return _NOTE.match(text) is not None


def read_annotations(file: BinaryIO, problems: Problems) -> Iterator[Record]:
    """Return a record for each byte of the rows of data; others, as of start bits, are passed over.

    Sample numbers say nothing of time without a sample rate: records have no time.
    """
    decoders: list[str] = []
    for line in lines(file, problems):
        note = _NOTE.match(line.text)
        if note is None:
            if line.text.strip():
                problems.add(line.offset, f"'{line.text[:40]}' is not an annotation; passed over")
            continue
        kind = (note["kind"] or "").lower()
        if kind and "data" not in kind:
            continue
        byte = _noted(note["value"])
        if byte is None:
            if kind:
                problems.add(line.offset, f"'{note['value'][:40]}' is not a byte; set the data format to hex")
            continue
        decoder = note["decoder"]
        if decoder not in decoders:
            decoders.append(decoder)
        yield Record(bytes([byte]), line.offset, None, _way(kind), decoder)


def _way(kind: str) -> Direction | None:
    return direction(kind.replace("-", " ").replace("_", " "))


def _noted(value: str) -> int | None:
    if _BYTE.match(value):
        return int(value, 16)
    if escaped := _ESCAPED.match(value):
        return int(escaped[1], 16)
    return None
