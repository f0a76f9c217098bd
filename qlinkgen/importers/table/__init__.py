"""Imports tables of fields, with a row for each field: CSV files and workbooks."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from qlinkgen.importers import cells
from qlinkgen.importers.document import Command, Document, Field, Item, Message, Value, hexadecimal
from qlinkgen.importers.frames import assumed
from qlinkgen.importers.names import Names, schema_name
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.table.columns import KEYS, Record, Table, table
from qlinkgen.importers.table.csv_file import csv_rows
from qlinkgen.importers.table.enums import Enums
from qlinkgen.importers.table.fields import Layout, place
from qlinkgen.importers.table.values import byteorder as order_of
from qlinkgen.importers.table.xlsx_file import xlsx_sheets

__all__ = ["KEYS", "Options", "read_csv", "read_xlsx"]

#: What only the row of a field states; other rows are about their message.
_OF_FIELDS = KEYS.keys() - {"message", "id", "direction", "doc", "section"}
_REQUESTS = frozenset(
    {"request", "req", "command", "cmd", "query", "write", "set", "master", "host", "master to slave"}
)
_RESPONSES = frozenset(
    {"response", "resp", "answer", "reply", "slave", "device", "status", "slave to master"}
)


@dataclass
class _Draft:
    """The rows of a message."""

    raw: str
    line: int
    notes: Notes
    table: Table
    id: str = ""
    doc: str = ""
    direction: str = ""
    records: list[Record] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Options:
    """What the user states about a table.

    Attributes:
        name: Name of the protocol; that of the file by default.
        byteorder: Byte order of fields for which the table states none.
        columns: Keys of columns by their headings; an empty key ignores a column.
    """

    name: str = ""
    byteorder: Literal["big", "little"] = "big"
    columns: Mapping[str, str] = field(default_factory=dict)


def read_csv(path: Path | str, notes: Notes, options: Options | None = None) -> Document:
    """Read a table of comma-separated values, or with semicolons, tabs or bars.

    Raises:
        ImportFileError: the file cannot be read, or is not such a table.
    """
    options = options or Options()
    found = table(csv_rows(path, notes), notes, options.columns)
    stem = Path(os.fspath(path)).stem
    return _document(path, [(stem, found, notes)] if found else [], notes, options)


def read_xlsx(path: Path | str, notes: Notes, options: Options | None = None) -> Document:
    """Read the sheets of a workbook; those without a heading are named and ignored.

    Raises:
        ImportFileError: the file cannot be read, or has no such table.
        ExtraMissing: the package `openpyxl` is not installed.
    """
    options = options or Options()
    tables: list[tuple[str, Table, Notes]] = []
    for sheet, rows in xlsx_sheets(path, notes):
        own = notes.of(f"{notes.file}[{sheet}]")
        if (found := table(rows, own, options.columns)) is None:
            own.add(0, "this sheet is ignored: no row with the headings of a table of fields")
        else:
            tables.append((sheet, found, own))
    return _document(path, tables, notes, options)


def _document(
    path: Path | str, tables: list[tuple[str, Table, Notes]], notes: Notes, options: Options
) -> Document:
    if not tables:
        raise notes.error(
            0, "no row has the headings of a table: a name, and a type, size, bit or offset; see --map"
        )
    file = Path(os.fspath(path))
    order = _byteorder([each for _, found, _ in tables for each in found.records], options.byteorder)
    messages = _Messages(
        notes, order, [draft for sheet, found, own in tables for draft in _drafts(sheet, found, own)]
    )
    protocol: dict[str, Value] = {
        "name": options.name or schema_name(file.stem, "protocol"),
        "revision": "",
        "source": file.name,
    }
    return Document(
        protocol=protocol,
        byteorder=order,
        frame=assumed("A table", messages.largest, max(messages.ids, default=1)),
        bus={"kind": "master_slave"},
        sections=messages.sections,
        comment=messages.comment(file.name),
    )


def _byteorder(records: Iterable[Record], otherwise: str) -> str:
    """The most frequent byte order of a table."""
    found = Counter(filter(None, (order_of(each.get("byteorder")) for each in records)))
    return found.most_common(1)[0][0] if found else otherwise


def _drafts(sheet: str, found: Table, notes: Notes) -> list[_Draft]:
    """Divide the rows into messages; an empty cell repeats the message above it."""
    drafts: dict[tuple[str, str], _Draft] = {}
    raw, direction, number = "", "", ""
    for record in found.records:
        if record.get("message") and record.get("message") != raw:
            raw, direction, number = record.get("message"), "", ""
        elif not record.get("message") and record.get("id") and record.get("id") != number and not raw:
            direction = ""
        number = record.get("id") or number
        direction = _direction(record, notes) or direction
        called = raw or (f"message {number}" if number else sheet)
        draft = drafts.get((called, direction))
        if draft is None:
            draft = drafts[called, direction] = _Draft(called, record.line, notes, found, direction=direction)
        draft.id = draft.id or number
        if _OF_FIELDS & record.values.keys() and not cells.is_nothing(record.get("name") or "?"):
            draft.records.append(record)
        elif record.get("doc"):
            draft.doc = record.get("doc")
    return list(drafts.values())


def _direction(record: Record, notes: Notes) -> str:
    text = " ".join(
        "".join(each if each.isalpha() else " " for each in record.get("direction").lower()).split()
    )
    if text in _REQUESTS:
        return "request"
    if text in _RESPONSES:
        return "response"
    if text:
        notes.add(record.line, f"direction '{text[:40]}' is ignored: only request and response are known")
    return ""


class _Messages:
    """Makes messages and commands of their rows.

    Attributes:
        ids: Their numbers.
        largest: Size of the largest payload.
    """

    def __init__(self, notes: Notes, order: str, drafts: Sequence[_Draft]) -> None:
        self._names = Names(notes, "message")
        self._enums = Enums(notes)
        self._order = order
        self._start = _start(drafts)
        self._commands: list[Command] = []
        self._messages: list[Message] = []
        self._numbered = False
        self.ids = [number for each in drafts if (number := cells.integer(each.id)) is not None]
        self.largest = 1
        answers = {each.raw: each for each in drafts if each.direction == "response"}
        asked = {each.raw for each in drafts if each.direction == "request"}
        for draft in drafts:
            if draft.direction == "request" and draft.raw in answers:
                self._command(draft, answers[draft.raw])
            elif draft.direction != "response" or draft.raw not in asked:
                self._message(draft)

    @property
    def sections(self) -> Mapping[str, tuple[Item, ...]]:
        """All of them, with their enums."""
        return {
            "enums": self._enums.all,
            "commands": tuple(self._commands),
            "messages": tuple(self._messages),
        }

    def comment(self, file: str) -> str:
        """What a reader of the schema should know."""
        ids = (
            " Message ids are numbered in order where the table has none: replace them."
            if self._numbered
            else ""
        )
        repeats = " Whether a command may be repeated is not stated in a table." if self._commands else ""
        return f"From {file}.{ids}{repeats}" if ids or repeats else ""

    def _message(self, draft: _Draft) -> None:
        fields = self._fields(draft)
        keys: dict[str, Value] = {**self._id(draft)}
        if draft.direction:
            keys["direction"] = draft.direction
        if fields or not draft.records:
            name = self._names.take(draft.raw, draft.line)
            self._messages.append(Message(name, fields, draft.line, keys, draft.doc))

    def _command(self, draft: _Draft, answer: _Draft) -> None:
        own, other = cells.integer(draft.id), cells.integer(answer.id)
        keys = self._id(draft if own is not None else answer)
        request, response = self._fields(draft), self._fields(answer)
        name = self._names.take(draft.raw, draft.line)
        doc = draft.doc or answer.doc
        differs = own is not None and other is not None and own != other
        self._commands.append(
            Command(
                name,
                request,
                response,
                draft.line,
                {**keys, "repeat": "unsafe"},
                doc,
                self._id(answer) if differs else {},
            )
        )

    def _id(self, draft: _Draft) -> dict[str, Value]:
        """The id, which is not confirmed if the table has none."""
        number = cells.integer(draft.id)
        if number is not None and number >= 0:
            return {"id": hexadecimal(number) if _is_hex(draft.id) else number}
        if draft.id:
            draft.notes.add(draft.line, f"id '{draft.id[:40]}' is not a number; the message is numbered")
        self._numbered = True
        number = max(self.ids, default=0) + 1
        self.ids.append(number)
        return {"id": number, "confirmed": False}

    def _fields(self, draft: _Draft) -> tuple[Field, ...]:
        name = schema_name(draft.raw, "message")
        layout = Layout(
            name,
            draft.notes,
            self._enums,
            start=self._start,
            in_bits=draft.table.in_bits,
            order=self._order,
        )
        fields = layout.fields(draft.records)
        self.largest = max(self.largest, layout.size, 255 if layout.open else 0)
        return fields


def _is_hex(text: str) -> bool:
    return not text.strip().isdecimal()


def _start(drafts: Sequence[_Draft]) -> int:
    """The offset at which payloads begin: the least one; tables may count from 1 or include a header."""
    found = [
        (byte, record.line, draft.notes)
        for draft in drafts
        for record in draft.records
        if (byte := place(record, draft.table.in_bits).byte) is not None
    ]
    least = min((byte for byte, _, _ in found), default=0)
    if least > 0:
        _, line, own = next(each for each in found if each[0] == least)
        own.add(line, f"offsets begin with {least}: this is the first byte of the payload")
    return least
