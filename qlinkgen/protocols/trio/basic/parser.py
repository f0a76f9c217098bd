"""Reads a program: tokens to steps, labels, and one error for the first fault.

A program is a list of lines::

    line       = [label ":"] statements
    statements = [statement (":" statement)*]
    statement  = target "=" expression | IF expression THEN statements [ELSE statements]
               | REPEAT | UNTIL expression | WAIT UNTIL expression | WA(expression)
               | GOTO label | GOSUB label | RETURN | STOP
               | GET #channel, target | PRINT #node, items | SEND(...) | DEFKEY(...)

Expressions are described in `expression_parser`. REPEAT and UNTIL are paired by their places in the text, not
at run time, so a jump into or out of a loop does no harm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from qlinkgen.model.spelling import similar
from qlinkgen.protocols.trio.basic.errors import Place
from qlinkgen.protocols.trio.basic.expression_parser import ExpressionParser
from qlinkgen.protocols.trio.basic.items import Pointed, items_of
from qlinkgen.protocols.trio.basic.lexer import Kind, Token, tokens_of
from qlinkgen.protocols.trio.basic.statements import (
    Goto,
    Jump,
    Return,
    Step,
    Stop,
    Unless,
    Wait,
    WaitUntil,
)
from qlinkgen.protocols.trio.basic.transfers import DefKey, Get, Let, Print, Send


@dataclass(frozen=True, slots=True)
class Program:
    """A program that can be run.

    Attributes:
        file: name of its file, for messages.
        steps: what it does, in the order of the text.
        labels: label to the index of its first step, which may be after the last one.
    """

    file: str
    steps: tuple[Step, ...]
    labels: Mapping[str, int]


def parse(text: str, file: str = "program", *, pointed: Pointed = "before") -> Program:
    """Read a program.

    Args:
        text: the program.
        file: its name, for messages.
        pointed: what the 6 of ``PRINT #10,x[6.1]`` is, which the document leaves open: the places before the
            point, or the width.

    Raises:
        BasicError: the first fault, with its place.
    """
    return _Parser(text, file, pointed).program()


class _Parser:
    def __init__(self, text: str, file: str, pointed: Pointed) -> None:
        self._file = file
        self._pointed: Pointed = pointed
        self._tokens = ExpressionParser(tokens_of(text, file))
        self._steps: list[Step] = []
        self._labels: dict[str, int] = {}
        self._repeats: list[tuple[Place, int]] = []
        self._statements: Mapping[str, Callable[[Token], Step | None]] = {
            "COMMSERROR": self._let,
            "DEFKEY": self._defkey,
            "GET": self._get,
            "GOSUB": lambda word: self._goto(word, returns=True),
            "GOTO": lambda word: self._goto(word, returns=False),
            "IF": self._if,
            "NETSTAT": self._let,
            "PRINT": self._print,
            "REPEAT": self._repeat,
            "RETURN": lambda word: Return(word.place),
            "SEND": self._send,
            "STOP": lambda word: Stop(word.place),
            "UNTIL": self._until,
            "VR": self._let,
            "WA": self._wa,
            "WAIT": self._wait,
        }

    def program(self) -> Program:
        tokens = self._tokens
        while tokens.next_line():
            self._label()
            self._several()
            if not tokens.at(Kind.END):
                raise tokens.unexpected("':' before another statement, or the end of the line")
        for place, _ in self._repeats:
            raise place.error("REPEAT without UNTIL; end the loop with UNTIL and its condition")
        self._check_names()
        return Program(self._file, tuple(self._steps), self._labels)

    def _check_names(self) -> None:
        for step in self._steps:
            if isinstance(step, Goto) and step.label not in self._labels:
                raise step.place.error(f"no label '{step.label}'{_meant(step.label, self._labels)}")
        set_, read = self._tokens.set, self._tokens.read
        for name, place in read.items():
            if name not in set_:
                raise place.error(f"'{name}' is neither a word nor a variable{_meant(name, set_)}")

    def _label(self) -> None:
        tokens = self._tokens
        if not (tokens.at(Kind.NAME) and tokens.at(Kind.SIGN, ":", ahead=1)):
            return
        label = tokens.take()
        tokens.take()
        if label.text in self._labels:
            raise label.place.error(f"label '{label.text}' is there twice; rename one of them")
        self._labels[label.text] = len(self._steps)

    def _several(self, *ends: str) -> None:
        """Read statements up to the end of the line, or to one of these words."""
        tokens = self._tokens
        while True:
            while tokens.skip(Kind.SIGN, ":"):
                pass
            if tokens.at(Kind.END) or any(tokens.at(Kind.WORD, word) for word in ends):
                return
            self._statement()
            if not tokens.at(Kind.SIGN, ":"):
                return

    def _statement(self) -> None:
        word = self._tokens.take()
        if word.kind is Kind.NAME and self._tokens.at(Kind.SIGN, "="):
            read: Callable[[Token], Step | None] = self._let
        elif word.kind is Kind.WORD and word.text in self._statements:
            read = self._statements[word.text]
        elif word.kind is Kind.NAME:
            raise word.place.error(f"unknown word '{word.text}'{_meant(word.text.upper(), self._statements)}")
        else:
            raise word.place.error(
                f"found {word}; a statement begins with a word such as PRINT, or a variable"
            )
        step = read(word)
        if step is not None:
            self._steps.append(step)

    # statements

    def _let(self, word: Token) -> Step:
        target = self._tokens.target(word)
        self._tokens.expect("=")
        return Let(word.place, target, self._tokens.expression())

    def _get(self, word: Token) -> Step:
        channel = self._tokens.device()
        self._tokens.expect(",")
        return Get(word.place, channel, self._tokens.target(self._tokens.take()))

    def _print(self, word: Token) -> Step:
        node = self._tokens.device()
        items, end = items_of(self._tokens, self._pointed)
        return Print(word.place, node, items, end)

    def _send(self, word: Token) -> Step:
        given = self._tokens.arguments()
        if not 3 <= len(given) <= 4:
            raise word.place.error(f"SEND has {len(given)} arguments; write SEND(n, type, data1[, data2])")
        node, kind, data1, *data2 = given
        return Send(word.place, node, kind, data1, *data2)

    def _defkey(self, word: Token) -> Step:
        key, *values = self._tokens.arguments()
        if not values:
            raise word.place.error("DEFKEY has no values; write DEFKEY(key, value, value, ...)")
        return DefKey(word.place, key, tuple(values))

    def _goto(self, word: Token, *, returns: bool) -> Step:
        label = self._tokens.take()
        if label.kind is not Kind.NAME:
            raise label.place.error(f"found {label}; {word.text} needs the name of a label")
        return Goto(label.place, label.text, self._labels, returns)

    def _wa(self, word: Token) -> Step:
        given = self._tokens.arguments()
        if len(given) != 1:
            raise word.place.error(f"WA has {len(given)} arguments; write WA(milliseconds)")
        return Wait(word.place, given[0])

    def _wait(self, word: Token) -> Step:
        if not self._tokens.skip(Kind.WORD, "UNTIL"):
            raise self._tokens.unexpected("UNTIL after WAIT")
        return WaitUntil(word.place, self._tokens.expression())

    # order

    def _repeat(self, word: Token) -> None:
        self._repeats.append((word.place, len(self._steps)))

    def _until(self, word: Token) -> Step:
        if not self._repeats:
            raise word.place.error("UNTIL without REPEAT; begin the loop with REPEAT, or write WAIT UNTIL")
        _, begin = self._repeats.pop()
        return Unless(word.place, self._tokens.expression(), begin)

    def _if(self, word: Token) -> None:
        tokens = self._tokens
        with tokens.nested(word.place):
            condition = tokens.expression()
            if not tokens.skip(Kind.WORD, "THEN"):
                raise tokens.unexpected("THEN after the condition")
            branch = self._hole(word.place)
            self._part(word.place, "ELSE")
            if tokens.skip(Kind.WORD, "ELSE"):
                jump = self._hole(word.place)
                self._steps[branch] = Unless(word.place, condition, len(self._steps))
                self._part(word.place, "ELSE")
                self._steps[jump] = Jump(word.place, len(self._steps))
            else:
                self._steps[branch] = Unless(word.place, condition, len(self._steps))

    def _hole(self, place: Place) -> int:
        """Keep the place of a jump whose target is read later."""
        self._steps.append(Jump(place, 0))
        return len(self._steps) - 1

    def _part(self, place: Place, end: str) -> None:
        """Read the statements after THEN or ELSE, which are on the same line."""
        loops, before = len(self._repeats), len(self._steps)
        self._several(end)
        if len(self._repeats) != loops:
            raise place.error(
                "REPEAT and UNTIL are not both in one part of the IF; put the loop on its own lines"
            )
        if len(self._steps) == before:
            raise self._tokens.unexpected("a statement after THEN or ELSE, on the same line")


def _meant(word: str, known: Mapping[str, object] | set[str]) -> str:
    close = similar(word, known)
    return f"; did you mean {close[0]}?" if close else ""
