"""Reads expressions, and the tokens of a program one by one.

The operators from weak to strong: OR XOR; AND &; NOT; = <> < > <= >=; + -; * /; the sign of a number.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from qlinkgen.protocols.trio.basic.errors import BasicError, Place
from qlinkgen.protocols.trio.basic.expressions import (
    FALSE,
    RANKS,
    TRUE,
    Chain,
    Expression,
    Key,
    Name,
    Negative,
    Not,
    Number,
    Status,
    Variable,
    number_of,
)
from qlinkgen.protocols.trio.basic.lexer import Kind, Token

#: Most levels of brackets, signs, NOT and IF inside one another.
DEEPEST = 32
#: Rank of the operators that NOT is weaker than.
_COMPARISONS = 2


class ExpressionParser:
    """Takes tokens, line by line.

    Attributes:
        set: names of the variables that the program sets.
        read: names of the variables that it reads, with the first place.
    """

    def __init__(self, lines: list[list[Token]]) -> None:
        self._lines = iter(lines)
        self._line: list[Token] = []
        self._next = 0
        self._depth = 0
        self.set: set[str] = set()
        self.read: dict[str, Place] = {}

    # tokens

    def next_line(self) -> bool:
        """Go to the beginning of the next line; return False after the last one."""
        self._line = next(self._lines, [])
        self._next = 0
        return bool(self._line)

    def at(self, kind: Kind, text: str | None = None, *, ahead: int = 0) -> bool:
        """Return whether the next token, or one after it, is of this kind and has this text."""
        place = min(self._next + ahead, len(self._line) - 1)
        token = self._line[place]
        return token.kind is kind and text in {None, token.text}

    def take(self) -> Token:
        """Return the next token; the end of the line is never passed."""
        token = self._line[self._next]
        if token.kind is not Kind.END:
            self._next += 1
        return token

    def skip(self, kind: Kind, text: str) -> bool:
        """Pass the next token if it is this one; return whether it was."""
        found = self.at(kind, text)
        if found:
            self._next += 1
        return found

    def expect(self, sign: str) -> None:
        """Pass a sign. Raises BasicError if it is not there."""
        if not self.skip(Kind.SIGN, sign):
            raise self.unexpected(f"'{sign}'")

    def unexpected(self, wanted: str) -> BasicError:
        """Return the error of the next token, in place of what is wanted."""
        token = self._line[self._next]
        return token.place.error(f"found {token}; expected {wanted}")

    @contextmanager
    def nested(self, place: Place) -> Iterator[None]:
        """Count a level of the tree.

        Raises:
            BasicError: there are too many inside one another.
        """
        if self._depth == DEEPEST:
            raise place.error(f"more than {DEEPEST} levels inside one another; divide the statement")
        self._depth += 1
        yield
        self._depth -= 1

    # expressions

    def expression(self) -> Expression:
        """Read an expression."""
        return self._chain(0)

    def _chain(self, rank: int) -> Expression:
        if rank == len(RANKS):
            return self._signed()
        if rank == _COMPARISONS and self.at(Kind.WORD, "NOT"):
            word = self.take()
            with self.nested(word.place):
                return Not(word.place, self._chain(rank))
        first = self._chain(rank + 1)
        rest = []
        while any(self.at(kind, sign) for sign in RANKS[rank] for kind in (Kind.SIGN, Kind.WORD)):
            sign = self.take()
            rest.append((sign.text, sign.place, self._chain(rank + 1)))
        return Chain(first.place, first, tuple(rest)) if rest else first

    def _signed(self) -> Expression:
        if not self.at(Kind.SIGN, "-"):
            return self.primary()
        sign = self.take()
        with self.nested(sign.place):
            return Negative(sign.place, self._signed())

    def primary(self) -> Expression:
        """Read a number, a variable, a function or an expression in brackets."""
        token = self.take()
        match token.kind, token.text:
            case Kind.NUMBER, text:
                return number_of(token.place, text)
            case Kind.NAME, text:
                self.read.setdefault(text, token.place)
                return Name(token.place, text)
            case Kind.WORD, "TRUE" | "FALSE":
                return Number(token.place, TRUE if token.text == "TRUE" else FALSE)
            case Kind.WORD, "NETSTAT" | "COMMSERROR":
                return Status(token.place, token.text)
            case Kind.WORD, "VR":
                return Variable(token.place, self._bracketed())
            case Kind.WORD, "KEY":
                return Key(token.place, self.device())
            case Kind.SIGN, "(":
                self._next -= 1
                return self._bracketed()
        raise token.place.error(f"found {token}; expected a number, a variable or '('")

    def _bracketed(self) -> Expression:
        with self.nested(self._line[self._next].place):
            self.expect("(")
            inner = self.expression()
            self.expect(")")
        return inner

    def device(self) -> Expression:
        """Read the #number of a channel or node."""
        self.expect("#")
        return self.primary()

    def arguments(self) -> list[Expression]:
        """Read expressions in brackets with commas between them, at least one."""
        self.expect("(")
        found = [self.expression()]
        while self.skip(Kind.SIGN, ","):
            found.append(self.expression())
        self.expect(")")
        return found

    def target(self, token: Token) -> Name | Variable | Status:
        """Return the variable that begins with a token."""
        match token.kind, token.text:
            case Kind.NAME, name:
                self.set.add(name)
                return Name(token.place, name)
            case Kind.WORD, "VR":
                return Variable(token.place, self._bracketed())
            case Kind.WORD, "NETSTAT" | "COMMSERROR":
                return Status(token.place, token.text)
        raise token.place.error(f"found {token}; expected a variable, such as VR(0)")
