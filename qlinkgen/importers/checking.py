"""Writes a document so that `qlinkgen lint` accepts it: what lint refuses is left out, with its reason."""

from __future__ import annotations

from dataclasses import replace

from qlinkgen.errors import Fault
from qlinkgen.importers.document import Constants, Document, Item, Message, Record
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.yaml_text import Written, write
from qlinkgen.schema import loads

#: Sections without whose items a schema describes nothing.
_CONTENT = ("commands", "messages")
_SINGULAR = {"enums": "enum", "flags": "flags", "types": "type", "commands": "command", "messages": "message"}


def written(document: Document, notes: Notes, file: str = "schema") -> str:
    """The text of a document as a schema file.

    Args:
        document: What was found.
        notes: Told of each item that is left out.
        file: Name of the output, for errors.

    Raises:
        ImportFileError: lint accepts none of the messages.
    """
    while True:
        if not any(document.sections.get(section) for section in _CONTENT):
            raise notes.error(0, "nothing could be imported: no message or command is left")
        result = write(document)
        faults = [each for each in loads(result.text, file)[1] if each.severity == "error"]
        if not faults:
            return result.text
        if document.other_frame is not None and (fault := _of_frame(result, faults)) is not None:
            notes.add(0, f"the frame is an assumption: {fault.message} [{fault.rule}]")
            document = replace(document, frame=document.other_frame, other_frame=None)
        else:
            document = document.without(_refused(document, result, faults, notes))


def _of_frame(result: Written, faults: list[Fault]) -> Fault | None:
    """The first fault outside of all items."""
    return next((each for each in faults if result.item_at(each.line) is None), None)


def _refused(document: Document, result: Written, faults: list[Fault], notes: Notes) -> set[tuple[str, str]]:
    """The items with faults."""
    gone: set[tuple[str, str]] = set()
    for fault in faults:
        item = result.item_at(fault.line)
        if item is None:
            line = result.lines[fault.line - 1].strip() if result.lines else ""
            raise notes.error(0, f"the schema would be wrong in '{line}': {fault.message} [{fault.rule}]")
        if item not in gone:
            gone.add(item)
            section, name = item
            found = _found(document, section, name)
            source = found.source if isinstance(found, Constants | Record | Message) else None
            what = f"{_SINGULAR[section]} {name} is left out: {fault.message} [{fault.rule}]"
            (source or notes).add(found.line, what)
    return gone


def _found(document: Document, section: str, name: str) -> Item:
    return next(each for each in document.sections[section] if each.name == name)
