"""Quotes all schema text in C source, for the targets `c` and `conformance`.

Text appears only in block comments. String literals contain names, which need no quoting.
"""

from __future__ import annotations

import re
import textwrap

from qlinkgen.model.texts import one_line

#: First characters of comment delimiters and trigraphs.
_JOINED = re.compile(r"\*(?=/)|/(?=\*)|\?(?=\?[=/'()!<>-])")


def comment_line(text: str) -> str:
    """Text for one line of a block comment; a space breaks up comment delimiters and trigraphs."""
    return _JOINED.sub(r"\g<0> ", one_line(text))


def comment(text: str, width: int, *, break_on_hyphens: bool = True) -> list[str]:
    """Text for a block comment, in lines of at most ``width`` characters."""
    return textwrap.wrap(comment_line(text), width, break_on_hyphens=break_on_hyphens)
