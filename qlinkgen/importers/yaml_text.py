"""Writes a document as YAML: on one line what fits there, with quotes only where YAML needs them.

No other module writes text of an input file into a schema. Any text results in one scalar of equal value.
"""

from __future__ import annotations

import json
import re
import textwrap
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field

from qlinkgen.importers.document import Block, Commented, Document, Notation, Value
from qlinkgen.model.texts import one_line

WIDTH = 110
#: Text that YAML may read as something else than text.
_SPECIAL = re.compile(
    r"[-?:,\[\]{}#&*!|>'\"%@`~=<.+0-9]|(?:true|false|null|yes|no|on|off|y|n)\Z", re.IGNORECASE
)
_BROKEN = re.compile(r":(?:\s|\Z)|\s#|[^\x20-\x7e\xa1-\ud7ff\ue000-\ufffd]")
_IN_FLOW = re.compile(r"[,\[\]{}?:]")
_KEY = re.compile(r"(?:[a-z_][a-z0-9_]*|[0-9]+(?:\.\.[0-9]+)?)\Z")


@dataclass
class Written:
    """The text of a schema file.

    Attributes:
        lines: The lines of the text.
        places: First and last line of each item, counted from 1, by section and name.
    """

    lines: list[str] = field(default_factory=list)
    places: dict[tuple[str, str], tuple[int, int]] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The text, with a line end at its end."""
        return "\n".join(self.lines) + "\n"

    def item_at(self, line: int) -> tuple[str, str] | None:
        """Section and name of the item at a line."""
        listed = list(self.places.items())  # in order of their lines
        at = bisect_right(listed, line, key=lambda each: each[1][0]) - 1
        return listed[at][0] if at >= 0 and line <= listed[at][1][1] else None


def write(document: Document) -> Written:
    """Write a document."""
    written = Written()
    _comment(written.lines, document.comment, 0)
    top: dict[str, Value] = {
        "qlinkgen": 1,
        "protocol": dict(document.protocol),
        "byteorder": document.byteorder,
    }
    _mapping(written.lines, top, 0)
    for section in ("enums", "flags", "types"):
        _section(written, section, document)
    for key, value in (
        ("attributes", dict(document.attributes)),
        ("frame", document.frame),
        ("bus", document.bus),
        ("defaults", dict(document.defaults)),
    ):
        if value or key == "bus":
            written.lines.append("")
            _mapping(written.lines, {key: value}, 0)
    for section in ("commands", "messages"):
        _section(written, section, document)
    return written


def _section(written: Written, section: str, document: Document) -> None:
    items = document.sections.get(section, ())
    if items:
        written.lines += ["", f"{section}:"]
    for item in items:
        first = len(written.lines) + 1
        _mapping(written.lines, {item.name: item.data}, 2)
        written.places[section, item.name] = first, len(written.lines)


def _mapping(lines: list[str], mapping: Mapping[str, Value], indent: int) -> None:
    for key, value in mapping.items():
        _entry(lines, f"{' ' * indent}{_key(key)}:", value, indent)


def _entry(lines: list[str], start: str, value: Value, indent: int) -> None:
    """Write a key, or the dash of a list, and its value."""
    while isinstance(value, Commented):
        _comment(lines, value.comment, indent)
        value = value.value
    line = f"{start} {_flow(value, inside=False)}"
    short = len(line) <= WIDTH and not isinstance(value, Block)
    if short or not value or isinstance(value, bool | int | Notation):
        lines.append(line)
    elif isinstance(value, dict):
        lines.append(start)
        _mapping(lines, value, indent + 2)
    elif isinstance(value, list):
        lines.append(start)
        for each in value:
            _entry(lines, f"{' ' * (indent + 2)}-", each, indent + 2)
    else:
        assert isinstance(value, str)
        lines.append(f"{start} >-")
        lines += _wrapped(value, indent + 2)


def _flow(value: Value, *, inside: bool) -> str:
    """A value on one line; `inside` braces or brackets more characters need quotes."""
    match value:
        case Commented():
            return _flow(value.value, inside=inside)
        case bool():
            return "true" if value else "false"
        case int():
            return str(value)
        case Notation():
            return value.text
        case str():
            return quoted(value, inside=inside)
        case list():
            return f"[{', '.join(_flow(each, inside=True) for each in value)}]"
        case dict():
            return (
                f"{{{', '.join(f'{_key(key)}: {_flow(each, inside=True)}' for key, each in value.items())}}}"
            )


def quoted(text: str, *, inside: bool) -> str:
    """Text as a scalar, in quotes only if it needs them."""
    text = one_line(text)
    plain = text and not _SPECIAL.match(text) and not _BROKEN.search(text)
    if plain and not (inside and _IN_FLOW.search(text)):
        return text
    return json.dumps(text, ensure_ascii=False)


def _key(key: str) -> str:
    return key if _KEY.match(key) else json.dumps(one_line(key), ensure_ascii=False)


def _wrapped(text: str, indent: int) -> list[str]:
    """Lines of folded text; words are never divided, as a line break means a blank."""
    margin = " " * indent
    return textwrap.wrap(
        one_line(text),
        WIDTH,
        initial_indent=margin,
        subsequent_indent=margin,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _comment(lines: list[str], text: str, indent: int) -> None:
    if text:
        margin = f"{' ' * indent}# "
        lines += textwrap.wrap(
            one_line(text), WIDTH, initial_indent=margin, subsequent_indent=margin, break_on_hyphens=False
        )
