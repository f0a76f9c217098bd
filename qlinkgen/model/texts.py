"""Free text of a schema, as opposed to names, numbers and wire bytes.

Fields of the model that hold free text are declared as `Text` or `Labels`; `without_texts` clears these.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import re
import typing
from collections.abc import Mapping
from typing import Annotated, TypeAlias, TypeVar, cast

_FREE = "free text"

#: Text for human readers, in any characters except `CONTROL`.
Text: TypeAlias = Annotated[str, _FREE]
#: Protocol-specific attributes by name.
Labels: TypeAlias = Annotated[Mapping[str, str | int | bool], _FREE]

_Node = TypeVar("_Node")

#: Illegal characters: control characters except tab and line feed, line separators, marks that reorder text,
#: the zero-width space, surrogates, and code points that are not characters. Terminals execute them; in
#: source code they end lines, are refused by linters, or display text that differs from what compilers read.
CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff\ufffe\uffff\ud800-\udfff]"
)
_BLANKS = re.compile(r"[ \t\n]+")


def schema_hash(text: str) -> str:
    """Return what identifies the text of a schema, whatever its line ends."""
    return hashlib.sha256(text.replace("\r\n", "\n").encode()).hexdigest()[:12]


def visible(text: str) -> str:
    """The text with its control characters as escapes, safe for a terminal."""
    return CONTROL.sub(lambda found: escaped(found[0]), text)


def escaped(character: str) -> str:
    r"""A character as an escape, ``\x1b`` or ``\u2028``."""
    number = ord(character)
    return f"\\x{number:02x}" if number < 0x100 else f"\\u{number:04x}"


def one_line(text: str) -> str:
    """The text on one line, safe for a terminal; runs of blanks are collapsed."""
    return visible(_BLANKS.sub(" ", text).strip(" "))


def without_texts(node: _Node) -> _Node:
    """A copy of a part of the model in which every free text is empty."""
    return cast(_Node, _Stripper().strip(node))


class _Stripper:
    """Strips each object once, so that shared objects stay shared."""

    def __init__(self) -> None:
        self._done: dict[int, object] = {}

    def strip(self, node: object) -> object:
        if isinstance(node, tuple):
            return tuple(map(self.strip, node))
        if not dataclasses.is_dataclass(node) or isinstance(node, type):
            return node
        if id(node) not in self._done:
            kept = {name: self.strip(getattr(node, name)) for name in _other_fields(type(node))}
            self._done[id(node)] = dataclasses.replace(node, **{**kept, **_blanks(type(node))})
        return self._done[id(node)]


@functools.cache
def _blanks(kind: type) -> Mapping[str, object]:
    """Empty values for the free text fields of a class."""
    hints = typing.get_type_hints(kind, include_extras=True)
    return {
        each.name: "" if hints[each.name] == Text else {}
        for each in dataclasses.fields(kind)
        if _FREE in getattr(hints[each.name], "__metadata__", ())
    }


@functools.cache
def _other_fields(kind: type) -> tuple[str, ...]:
    return tuple(
        each.name for each in dataclasses.fields(kind) if each.init and each.name not in _blanks(kind)
    )
