"""Lays out bytes and comments as lines of C."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from qlinkgen.backends import c_text

#: Line length without the indentation of tables.
WIDTH = 112


def numbers(data: Sequence[int]) -> str:
    """Bytes of a table."""
    return ", ".join(f"0x{byte:02X}" for byte in data)


def wrapped(text: str) -> list[str]:
    """Lines of a comment."""
    return c_text.comment(text, WIDTH - 6, break_on_hyphens=False)


def comment(text: str) -> list[str]:
    """A separate comment, empty for an empty text."""
    lines = wrapped(text)
    if not lines:
        return []
    framed = [f"/* {lines[0]}", *(f" * {line}" for line in lines[1:])]
    return [*framed[:-1], f"{framed[-1]} */"]


def folded(text: str) -> list[str]:
    """A list in one or more lines."""
    return textwrap.wrap(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def row_lines(pieces: Sequence[str]) -> list[str]:
    """The pieces of a row in one line if they fit, otherwise a line each; long pieces are folded."""
    one = " ".join(pieces)
    if len(one) <= WIDTH:
        return [one]
    lines = [line for piece in pieces for line in textwrap.wrap(piece, WIDTH - 4)]
    return [lines[0], *(f"    {line}" for line in lines[1:])]


def call(text: str) -> list[str]:
    """A call, with a line break after the opening parenthesis if it is too long."""
    if len(text) <= WIDTH:
        return [text]
    head, arguments = text.split("(", 1)
    return [f"{head}(", f"    {arguments}"]
