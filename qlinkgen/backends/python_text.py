"""Quotes all schema text in Python source, for the targets `python` and `construct`.

No other module may insert free text into Python. Any text results in a literal, a docstring or comments. The
value of a literal or docstring equals the text.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable

from qlinkgen.model.texts import escaped, one_line, visible

_QUOTES = re.compile('"{3,}|"$')


def literal(text: str) -> str:
    """A string literal, in the quotes that need fewer escapes; double ones otherwise."""
    quote = "'" if text.count('"') > text.count("'") else '"'
    return quote + "".join(_in_literal(each, quote) for each in text) + quote


def _in_literal(character: str, quote: str) -> str:
    if character in (quote, "\\"):
        return f"\\{character}"
    return character if character.isprintable() else repr(character)[1:-1]


def numbers(text: str) -> str:
    """A string literal of seven-bit text with every character escaped."""
    return '"' + "".join(map(escaped, text)) + '"'


def real(value: float) -> str:
    """A floating-point number, with its exponent as ruff writes it."""
    return repr(value).replace("e+", "e")


def docstring(lines: Iterable[str]) -> list[str]:
    """Lines as a docstring; after several lines the closing quotes have their own line."""
    first, *others = map(_in_docstring, lines)
    return [f'"""{first}', *others, '"""'] if others else [f'"""{first}"""']


def _in_docstring(line: str) -> str:
    # Backslashes first, since the escapes below contain backslashes.
    doubled = visible(line.replace("\\", "\\\\"))
    return _QUOTES.sub(lambda found: found[0].replace('"', '\\"'), doubled)


def comment(text: str, width: int) -> list[str]:
    """Text for comments, in lines of at most ``width`` characters without the comment sign."""
    return textwrap.wrap(one_line(text), width)
