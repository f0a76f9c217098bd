"""Text in C source: every text of a schema is quoted here, for the targets `c` and `conformance`.

Texts appear in block comments alone. String literals hold names, which need no quoting.
"""

from __future__ import annotations

import re
import textwrap

from qlinkgen.model.texts import one_line

#: Characters that open or close a comment together with the next one, or begin a trigraph.
_JOINED = re.compile(r"\*(?=/)|/(?=\*)|\?(?=\?[=/'()!<>-])")


def comment_line(text: str) -> str:
    """Text for one line of a block comment; what would end the comment or splice its lines is broken up."""
    return _JOINED.sub(r"\g<0> ", one_line(text))


def comment(text: str, width: int, *, break_on_hyphens: bool = True) -> list[str]:
    """Text for the lines of a block comment, each of at most ``width`` characters."""
    return textwrap.wrap(comment_line(text), width, break_on_hyphens=break_on_hyphens)
