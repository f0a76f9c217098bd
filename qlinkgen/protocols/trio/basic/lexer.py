"""Cuts the text of a program into tokens."""

from __future__ import annotations

import re
from enum import Enum
from typing import NamedTuple

from qlinkgen.model.texts import visible
from qlinkgen.protocols.trio.basic.errors import Place

#: Words with a meaning of their own; none can be the name of a variable or a label.
WORDS = frozenset({
    *("AND", "CHR", "COMMSERROR", "CURSOR", "DEFKEY", "ELSE", "FALSE", "GET", "GOSUB", "GOTO", "IF", "KEY"),
    *("NETSTAT", "NOT", "OR", "PRINT", "REPEAT", "RETURN", "SEND", "STOP", "THEN", "TRUE", "UNTIL", "VR"),
    *("WA", "WAIT", "XOR"),
})  # fmt: skip

_LINE_END = re.compile(r"\r\n|\r|\n")
_TOKEN = re.compile(
    r"""(?P<blank>[ \t]+|'.*)
    |(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)
    |"(?P<text>[^"]*)"
    |(?P<word>[A-Za-z_][A-Za-z0-9_]*)
    |(?P<sign><>|<=|>=|[-+*/=<>&()\[\],;:\#])""",
    re.VERBOSE,
)


class Kind(Enum):
    """Kind of token."""

    WORD = "word"
    NAME = "name"
    NUMBER = "number"
    TEXT = "text"
    SIGN = "sign"
    END = "end of the line"


class Token(NamedTuple):
    """A token. The text of words is in capitals, and that of names in small letters: case has no meaning."""

    kind: Kind
    text: str
    place: Place

    def __str__(self) -> str:
        if self.kind is Kind.END:
            return "the end of the line"
        return f"the text {self.text!r}" if self.kind is Kind.TEXT else repr(self.text)


def tokens_of(text: str, file: str) -> list[list[Token]]:
    """Return the tokens of each line; the last one of a line is its end.

    Raises:
        BasicError: a character that begins no token, or a text with characters that the ring cannot carry.
    """
    return [_tokens_of_line(line, file, number) for number, line in enumerate(_LINE_END.split(text), 1)]


def _tokens_of_line(line: str, file: str, number: int) -> list[Token]:
    tokens: list[Token] = []
    at = 0
    while at < len(line):
        place = Place(file, number, at + 1)
        found = _TOKEN.match(line, at)
        if found is None:
            raise place.error(_unreadable(line[at]))
        at = found.end()
        if found.lastgroup != "blank":
            tokens.append(_token(str(found.lastgroup), found[str(found.lastgroup)], place))
    tokens.append(Token(Kind.END, "", Place(file, number, len(line) + 1)))
    return tokens


def _token(group: str, text: str, place: Place) -> Token:
    if group == "word":
        known = text.upper() in WORDS
        return Token(Kind.WORD, text.upper(), place) if known else Token(Kind.NAME, text.lower(), place)
    if group == "text" and not (text.isascii() and text.isprintable()):
        bad = next(each for each in text if not (each.isascii() and each.isprintable()))
        raise place.error(
            f"text contains '{visible(bad)}'; write characters from blank to ~, and the others with CHR"
        )
    return Token(Kind(group), text, place)


def _unreadable(character: str) -> str:
    if character == '"':
        return 'text without its end; close it with " on the same line'
    return f"unknown character '{visible(character)}'; text is between straight quotes, a comment after '"
