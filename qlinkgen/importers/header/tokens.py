"""Divides the text of a C header into tokens, directives and comments."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from qlinkgen.importers.notes import Notes

Kind = Literal["word", "number", "string", "mark", "directive"]

_TOKEN = re.compile(
    r"""(?P<blank>(?:[ \t\f\v]|\\\n)+)
    |(?P<end>\n)
    |(?P<comment>/\*.*?\*/|//(?:\\\n|[^\n])*)
    |(?P<open>/\*)
    |(?P<string>(?:L|u8?|U)?(?:"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'))
    |(?P<word>[A-Za-z_$][A-Za-z0-9_$]*)
    |(?P<number>\.?[0-9](?:[eEpP][-+]|[A-Za-z0-9_.'])*)
    |(?P<mark>\.\.\.|<<=|>>=|->|\+\+|--|<<|>>|[<>=!]=|&&|\|\||\#\#|[-+*/%&|^]=|[!-/:-@\[\]^`{-~])
    """,
    re.VERBOSE | re.DOTALL,
)
#: A directive, with comments of its own, to the end of its last line.
_DIRECTIVE = re.compile(r'#(?:\\\n|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|(?!//)[^\n])*', re.DOTALL)
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Token:
    """A token, or a whole directive."""

    kind: Kind
    text: str
    line: int


@dataclass(frozen=True, slots=True)
class Comment:
    """A comment with its marks.

    Attributes:
        text: The comment.
        first: Line on which it begins.
        last: Line on which it ends.
        alone: Nothing precedes it on its first line.
    """

    text: str
    first: int
    last: int
    alone: bool


def scan(text: str, notes: Notes) -> tuple[list[Token], list[Comment]]:
    """Tokens and comments in order.

    Raises:
        ImportFileError: a comment does not end, or a character is not part of C.
    """
    tokens: list[Token] = []
    comments: list[Comment] = []
    at, line, fresh = 0, 1, True
    while at < len(text):
        if fresh and text[at] == "#":
            found = _DIRECTIVE.match(text, at)
            kind = "directive"
        else:
            found = _TOKEN.match(text, at)
            kind = found.lastgroup or "" if found else ""
        if found is None or kind == "open":
            raise notes.error(line, _unexpected(text[at], kind))
        piece = found[0]
        match kind:
            case "comment":
                comments.append(Comment(piece, line, line + piece.count("\n"), fresh))
            case "directive":
                tokens.append(Token("directive", _COMMENT.sub(" ", piece).replace("\\\n", " "), line))
            case "word" | "number" | "string" | "mark":
                tokens.append(Token(kind, piece, line))
            case _:
                pass
        fresh = kind == "end" or (fresh and kind in ("blank", "comment"))
        line += piece.count("\n")
        at = found.end()
    return tokens, comments


def _unexpected(character: str, kind: str) -> str:
    if kind == "open":
        return "a comment begins here and does not end; close it with */"
    return f"the character U+{ord(character):04X} is not part of C; is this a header?"
