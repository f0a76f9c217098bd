"""Formats text of the schema for docstrings. `python_text` quotes it."""

from __future__ import annotations

import textwrap

from qlinkgen.model.texts import one_line

UNCONFIRMED = "UNCONFIRMED: the source is weak; check it on the device."


def opening(text: str, section: str, tail: str = "") -> str:
    """A description, followed by ``tail`` and the section of its source."""
    where = f" (section {section})" if section[:1].isdigit() else f" ({section})" if section else ""
    return one_line(f"{text.rstrip('.')}{tail}{where}.")


def paragraph(text: str, width: int) -> list[str]:
    """A text in lines; the first sentence has its own line if it fits."""
    first, _, rest = text.partition(". ")
    if rest and len(first) < width - 4:
        return [f"{first}.", "", *textwrap.wrap(rest, width)]
    return textwrap.wrap(text, width)


def item(text: str, width: int) -> list[str]:
    """An entry of a list of arguments or attributes."""
    return textwrap.wrap(text, width, initial_indent="    ", subsequent_indent="        ")
