"""Free text: what a schema says in words, as opposed to names, numbers and wire bytes.

Fields of the model that hold free text are declared as `Text` or `Labels`: `without_texts` finds them by it.
"""

from __future__ import annotations

import dataclasses
import functools
import re
import typing
from collections.abc import Mapping
from typing import Annotated, TypeAlias, TypeVar, cast

_FREE = "free text"

#: What the author wrote for readers, in any characters but `CONTROL`.
Text: TypeAlias = Annotated[str, _FREE]
#: Words of a protocol's own, by the name of what they belong to.
Labels: TypeAlias = Annotated[Mapping[str, str | int | bool], _FREE]

_Node = TypeVar("_Node")

#: Characters that no text may hold: control characters but tab and line feed, line separators, marks that
#: reorder text, surrogates, and code points that are not characters. On a terminal they are commands; in
#: source they end lines, or show a reader something else than a compiler reads.
CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff\ufffe\uffff\ud800-\udfff]"
)
_BLANKS = re.compile(r"[ \t\n]+")


def visible(text: str) -> str:
    """The text with its control characters as escapes, safe for a terminal."""
    return CONTROL.sub(lambda found: escaped(found[0]), text)


def escaped(character: str) -> str:
    r"""A character as ``\x1b`` or ``\u2028``, as Python and JSON know it."""
    number = ord(character)
    return f"\\x{number:02x}" if number < 0x100 else f"\\u{number:04x}"


def one_line(text: str) -> str:
    """The text on one line, safe for a terminal; any run of blanks is one."""
    return visible(_BLANKS.sub(" ", text).strip(" "))


def without_texts(node: _Node) -> _Node:
    """The same part of a model with every free text empty."""
    return cast(_Node, _Stripper().strip(node))


class _Stripper:
    """Strips each object once, so that what was shared stays shared."""

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
    """Empty values for the fields of a class that hold free text."""
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
