"""Finds and reports control characters in a schema file."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator

from qlinkgen.model.texts import CONTROL

#: The id of the rule, also the type of the pydantic error.
CONTROL_CHARACTER = "control-character"
HINT = "remove it; a text may have line breaks and tabs, but no other control characters"


def control_character(character: str) -> str:
    """The error message for a control character."""
    name = unicodedata.name(character, "")
    return f"text contains the control character U+{ord(character):04X}{f' ({name.lower()})' if name else ''}"


def written(text: str) -> Iterator[tuple[int, int, str]]:
    """Line, column and character of the first control character in each line, comments included."""
    if CONTROL.search(text):
        for number, line in enumerate(text.split("\n"), 1):
            if found := CONTROL.search(line):
                yield number, found.start() + 1, found[0]
