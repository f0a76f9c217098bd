"""Parses the expressions of Kaitai Struct as far as a schema can state them: numbers, fields, operators."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, TypeAlias

_CONVERSION = re.compile(r"\.(?:to_i\b|as<[\w:]+>)")
_TOKEN = re.compile(
    r"""\s*(?:(?P<number>0[xX][0-9a-fA-F_]+|0[bB][01_]+|[0-9][0-9_]*)(?![\w.])
    |(?P<name>[a-z_][a-z0-9_]*(?:(?:::|\.)[a-z_][a-z0-9_]*)*)
    |(?P<sign>==|!=|<=|>=|<<|>>|[<>()+*/%&|^-]))""",
    re.VERBOSE,
)
_LONGEST: Final = 500
_DEEPEST: Final = 50
_COMPARISONS: Final = ("==", "!=", "<=", ">=", "<", ">")
#: Operators of two operands from the loosest to the tightest, as in Python.
_LEVELS: Final = (
    ("or",), ("and",), _COMPARISONS, ("|",), ("^",), ("&",), ("<<", ">>"), ("+", "-"), ("*", "/", "%"),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Number:
    """A whole number; `name` is that of a value of an enum."""

    value: int
    name: str = ""


@dataclass(frozen=True, slots=True)
class Name:
    """A field, an instance, or a value of an enum."""

    text: str


@dataclass(frozen=True, slots=True)
class Operation:
    """An operator with its operands: two, or one of `not` and of `-`."""

    sign: str
    operands: tuple[Expression, ...]


Expression: TypeAlias = Number | Name | Operation


class _Wrong(Exception):
    """Something else than an expression of these kinds."""


def parsed(text: str) -> Expression | None:
    """An expression; None if it has texts, lists, calls, floats or choices."""
    if len(text) > _LONGEST:
        return None
    try:
        parser = _Parser(list(_tokens(_CONVERSION.sub("", text).strip())))
        found = parser.at_level(0)
        return found if parser.at_end else None
    except _Wrong:
        return None


def _tokens(text: str) -> Iterator[str]:
    at = 0
    while at < len(text):
        found = _TOKEN.match(text, at)
        if found is None:
            raise _Wrong
        at = found.end()
        yield found[0].strip()


class _Parser:
    def __init__(self, tokens: list[str]) -> None:
        self._tokens = tokens
        self._at = 0
        self._depth = 0

    @property
    def at_end(self) -> bool:
        return self._at == len(self._tokens)

    def _next(self) -> str:
        return "" if self.at_end else self._tokens[self._at]

    def at_level(self, level: int) -> Expression:
        """Operations of a level and of tighter ones."""
        if level == len(_LEVELS):
            return self._operand()
        if _LEVELS[level] is _COMPARISONS and self._next() == "not":
            self._at += 1
            return Operation("not", (self.at_level(level),))
        found = self.at_level(level + 1)
        while (sign := self._next()) in _LEVELS[level]:
            self._at += 1
            found = Operation(sign, (found, self.at_level(level + 1)))
        return found

    def _operand(self) -> Expression:
        token = self._next()
        self._at += 1
        self._depth += 1
        if self._depth > _DEEPEST:
            raise _Wrong
        if token == "(":
            found = self.at_level(0)
            if self._next() != ")":
                raise _Wrong
            self._at += 1
        elif token == "-":
            found = Operation("-", (self._operand(),))
        elif token[:1].isdigit():
            found = Number(int(token.replace("_", ""), 0 if token[:2].lower() in ("0x", "0b") else 10))
        elif token[:1].isalpha() or token[:1] == "_":
            found = Name(token)
        else:
            raise _Wrong
        self._depth -= 1
        return found


def names(expression: Expression) -> Iterator[str]:
    """The names in an expression."""
    if isinstance(expression, Name):
        yield expression.text
    elif isinstance(expression, Operation):
        for each in expression.operands:
            yield from names(each)


def replaced(expression: Expression, of: Callable[[str], Expression | None]) -> Expression | None:
    """The expression with something in place of each name; None if one has nothing."""
    if isinstance(expression, Name):
        return of(expression.text)
    if isinstance(expression, Operation):
        operands = [replaced(each, of) for each in expression.operands]
        if any(each is None for each in operands):
            return None
        return folded(Operation(expression.sign, tuple(each for each in operands if each is not None)))
    return expression


def folded(operation: Operation) -> Expression:
    """The number that an operation of numbers is, if it is one."""
    values = [each.value for each in operation.operands if isinstance(each, Number)]
    if len(values) != len(operation.operands):
        return operation
    match (operation.sign, values):
        case ("+", [a, b]):
            return Number(a + b)
        case ("-", [a, b]):
            return Number(a - b)
        case ("-", [a]):
            return Number(-a)
        case ("*", [a, b]):
            return Number(a * b)
        case ("<<", [a, b]) if 0 <= b < 64:
            return Number(a << b)
        case _:
            return operation


@dataclass(frozen=True, slots=True)
class Count:
    """A number of bytes or items: ``scale`` times a field, plus ``offset``."""

    name: str
    scale: int = 1
    offset: int = 0


def count(expression: Expression | None) -> Count | int | None:
    """A number, or a field with a factor and a term; None for other expressions."""
    if isinstance(expression, Number):
        return expression.value
    if isinstance(expression, Name):
        return Count(expression.text)
    if expression is None or len(expression.operands) != 2:
        return None
    left, right = (count(each) for each in expression.operands)
    match expression.sign:
        case "+" if isinstance(left, Count) and isinstance(right, int):
            return Count(left.name, left.scale, left.offset + right)
        case "+" if isinstance(left, int) and isinstance(right, Count):
            return Count(right.name, right.scale, right.offset + left)
        case "-" if isinstance(left, Count) and isinstance(right, int):
            return Count(left.name, left.scale, left.offset - right)
        case "*" if isinstance(left, Count) and isinstance(right, int) and right > 0:
            return Count(left.name, left.scale * right, left.offset * right)
        case "*" if isinstance(left, int) and isinstance(right, Count) and left > 0:
            return Count(right.name, right.scale * left, right.offset * left)
        case _:
            return None


@dataclass(frozen=True, slots=True)
class Slice:
    """Bits of a field, moved to the right.

    Attributes:
        mask: The bits, None for all of them.
    """

    name: str
    mask: int | None = None
    shift: int = 0


def sliced(expression: Expression) -> Slice | None:
    """A field, or bits of it; None for other expressions."""
    if isinstance(expression, Name):
        return Slice(expression.text)
    if not isinstance(expression, Operation) or len(expression.operands) != 2:
        return None
    left, right = expression.operands
    if isinstance(left, Number) and expression.sign == "&":
        left, right = right, left
    inner = sliced(left)
    if inner is None or not isinstance(right, Number) or right.value < 0:
        return None
    match expression.sign:
        case "&":
            mask = right.value << inner.shift
            return Slice(inner.name, mask if inner.mask is None else mask & inner.mask, inner.shift)
        case ">>" if right.value < 64:
            return Slice(inner.name, inner.mask, inner.shift + right.value)
        case _:
            return None


def runs(mask: int) -> list[tuple[int, int]]:
    """The first and the last bit of each run of bits of a mask."""
    found: list[tuple[int, int]] = []
    for at in range(mask.bit_length()):
        if mask >> at & 1:
            if found and found[-1][1] == at - 1:
                found[-1] = found[-1][0], at
            else:
                found.append((at, at))
    return found
