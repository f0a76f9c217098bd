"""Text in Python source: every text of a schema is quoted here, for the targets `python` and `construct`.

Nothing else may place free text in Python: what is returned is a literal, a docstring or comments, whatever
the text holds. A literal and a docstring have the value of the text.
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
    """A string literal of seven-bit text that spells each character as its number."""
    return '"' + "".join(map(escaped, text)) + '"'


def docstring(lines: Iterable[str]) -> list[str]:
    """Lines as a docstring; where there are several, the closing quotes get a line of their own."""
    first, *others = map(_in_docstring, lines)
    return [f'"""{first}', *others, '"""'] if others else [f'"""{first}"""']


def _in_docstring(line: str) -> str:
    # Backslashes come first: those of the escapes below have a meaning.
    doubled = visible(line.replace("\\", "\\\\"))
    return _QUOTES.sub(lambda found: found[0].replace('"', '\\"'), doubled)


def comment(text: str, width: int) -> list[str]:
    """The text of comments of at most ``width`` characters each, without their marks."""
    return textwrap.wrap(one_line(text), width)
