"""Conditions of ``--where``: what a frame must be to be shown.

    position > 1000 and node in (1, 2)
    not (mode == heating) or running in motor_status

Names are those of fields, of values of the frame, of the address, and `message`, `time` and `offset`; a dot
leads into a record. A word that names a value of an enum or a flag is that text. A name that a frame does not
have makes its comparison false. A list fits if one of its items does.
"""

from __future__ import annotations

import operator
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Any, TypeAlias

from qlinkgen._dataclass import dataclass
from qlinkgen.model.spelling import similar
from qlinkgen.model.values import Json

#: Most conditions inside one another.
_DEEPEST = 50
_TOKEN = re.compile(
    r"""\s*(?:(?P<number>[-+]?(?:0[xX][0-9a-fA-F]+|0[bB][01]+|\d+(?:\.\d+)?(?:[eE][-+]?\d{1,3})?))(?![\w.])
    |(?P<text>'[^']*'|"[^"]*")
    |(?P<word>[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)
    |(?P<sign>==|!=|<=|>=|=|<|>|\(|\)|,))""",
    re.VERBOSE,
)
_COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq, "=": operator.eq, "!=": operator.ne,
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
_ORDER = ("<", "<=", ">", ">=")
_WORDS = ("and", "or", "not", "in")

#: Values of a frame by their names; values of records are mappings.
Values: TypeAlias = Mapping[str, Json]


class ConditionError(ValueError):
    """A text is not a condition.

    Attributes:
        message: what was seen, the rule and the fix.
        at: index of the character.
    """

    def __init__(self, message: str, at: int) -> None:
        super().__init__(message)
        self.message = message
        self.at = at


class Condition(ABC):
    """Something that a frame fulfils or does not."""

    @abstractmethod
    def fits(self, values: Values) -> bool:
        """Whether a frame with these values fulfils it."""


@dataclass(frozen=True, slots=True)
class _Both(Condition):
    left: Condition
    right: Condition

    def fits(self, values: Values) -> bool:
        return self.left.fits(values) and self.right.fits(values)


@dataclass(frozen=True, slots=True)
class _Either(Condition):
    left: Condition
    right: Condition

    def fits(self, values: Values) -> bool:
        return self.left.fits(values) or self.right.fits(values)


@dataclass(frozen=True, slots=True)
class _Not(Condition):
    what: Condition

    def fits(self, values: Values) -> bool:
        return not self.what.fits(values)


@dataclass(frozen=True, slots=True)
class _Literal:
    value: Json

    def found(self, values: Values) -> Sequence[Json]:  # noqa: ARG002  # as of names
        return (self.value,)


@dataclass(frozen=True, slots=True)
class _Name:
    path: tuple[str, ...]

    def found(self, values: Values) -> Sequence[Json]:
        """Return the values, none if the frame does not have them; those of all records of a list."""
        found: list[Json] = [values]
        for name in self.path:
            found = [each[name] for each in found if isinstance(each, Mapping) and name in each]
            found = [item for each in found for item in (each if isinstance(each, list | tuple) else (each,))]
        return [each for each in found if each is not None]


@dataclass(frozen=True, slots=True)
class _List:
    items: tuple[_Literal | _Name, ...]

    def found(self, values: Values) -> Sequence[Json]:
        return [value for each in self.items for value in each.found(values)]


_Operand: TypeAlias = _Literal | _Name | _List


@dataclass(frozen=True, slots=True)
class _Compared(Condition):
    left: _Operand
    sign: str
    right: _Operand

    def fits(self, values: Values) -> bool:
        right = self.right.found(values)
        return any(_compare(self.sign, each, other) for each in self.left.found(values) for other in right)


@dataclass(frozen=True, slots=True)
class _Among(Condition):
    left: _Operand
    right: _Operand

    def fits(self, values: Values) -> bool:
        right = self.right.found(values)
        return any(_compare("==", each, other) for each in self.left.found(values) for other in right)


@dataclass(frozen=True, slots=True)
class _True(Condition):
    what: _Operand

    def fits(self, values: Values) -> bool:
        return any(map(bool, self.what.found(values)))


def _compare(sign: str, left: Json, right: Json) -> bool:
    numbers = all(isinstance(each, int | float | Decimal) for each in (left, right))
    if sign in _ORDER and not numbers and not (isinstance(left, str) and isinstance(right, str)):
        return False
    return _COMPARE[sign](left, right)


def parse_condition(text: str, names: Collection[str], texts: Collection[str]) -> Condition:
    """Return the condition that a text states.

    Args:
        text: the condition.
        names: what frames may have, records with dots.
        texts: names of values of enums, and of flags.

    Raises:
        ConditionError: it is not a condition, or a word is not known.
    """
    return _Parser(text, names, texts).whole()


class _Parser:
    def __init__(self, text: str, names: Collection[str], texts: Collection[str]) -> None:
        self._names, self._texts = names, texts
        self._tokens = [*_tokens(text), ("end", "", len(text))]
        self._at = 0
        self._depth = 0

    def whole(self) -> Condition:
        found = self._either()
        kind, token, at = self._tokens[self._at]
        if kind != "end":
            raise ConditionError(f"'{token}' follows a condition; join conditions by and or or", at)
        return found

    def _either(self) -> Condition:
        found = self._both()
        while self._take("or"):
            found = _Either(found, self._both())
        return found

    def _both(self) -> Condition:
        found = self._one()
        while self._take("and"):
            found = _Both(found, self._one())
        return found

    def _one(self) -> Condition:
        self._depth += 1
        if self._depth > _DEEPEST:
            at = self._tokens[self._at][2]
            raise ConditionError(f"more than {_DEEPEST} conditions inside one another", at)
        found: Condition
        if self._take("not"):
            found = _Not(self._one())
        elif self._take("("):
            found = self._either()
            self._expect(")")
        else:
            found = self._comparison()
        self._depth -= 1
        return found

    def _comparison(self) -> Condition:
        after = [token for _, token, _ in self._tokens[self._at + 1 : self._at + 4] if token != "not"]
        among = after[:1] == ["in"] and after[1:2] != ["("]
        left = self._operand(first_text=among)
        _, sign, _ = self._tokens[self._at]
        if sign in _COMPARE:
            self._at += 1
            return _Compared(left, sign, self._operand(first_text=True))
        if self._take("not"):
            self._expect("in")
            return _Not(_Among(left, self._list()))
        if self._take("in"):
            return _Among(left, self._list())
        return _True(left)

    def _list(self) -> _Operand:
        if not self._take("("):
            return self._operand(first_text=False)
        items = [self._operand(first_text=True)]
        while self._take(","):
            items.append(self._operand(first_text=True))
        self._expect(")")
        return _List(tuple(items))

    def _operand(self, *, first_text: bool) -> _Literal | _Name:
        """Return a number, a text or a name; `first_text`: a word that is both is a text."""
        kind, token, at = self._tokens[self._at]
        if kind == "number":
            self._at += 1
            return _Literal(_number(token))
        if kind == "text":
            self._at += 1
            return _Literal(token[1:-1])
        if kind != "word" or token in _WORDS:
            raise ConditionError(f"{_shown(token)} is not a name, a number or a text", at)
        self._at += 1
        if token in self._texts and (first_text or token not in self._names):
            return _Literal(token)
        if token in self._names:
            return _Name(tuple(token.split(".")))
        if token in {"true", "false"}:
            return _Literal(token == "true")
        close = similar(token, {*self._names, *self._texts}, most=2)
        fix = f"; did you mean {' or '.join(close)}?" if close else "; write texts in quotes"
        raise ConditionError(f"no message has a value '{token}'{fix}", at)

    def _take(self, token: str) -> bool:
        if self._tokens[self._at][1] != token or self._tokens[self._at][0] == "text":
            return False
        self._at += 1
        return True

    def _expect(self, token: str) -> None:
        if not self._take(token):
            _, seen, at = self._tokens[self._at]
            raise ConditionError(f"{_shown(seen)} where '{token}' is due", at)


def _tokens(text: str) -> Iterator[tuple[str, str, int]]:
    at = 0
    while text[at:].strip():
        found = _TOKEN.match(text, at)
        if found is None:
            at += len(text[at:]) - len(text[at:].lstrip())
            signs = "==, !=, <, <=, >, >=, in, and, or, not"
            raise ConditionError(f"'{text[at]}' is not part of a condition; use {signs}", at)
        kind = str(found.lastgroup)
        yield kind, found[kind], found.start(kind)
        at = found.end()


def _number(token: str) -> int | Decimal:
    try:
        return int(token, 0)
    except ValueError:
        return Decimal(token)


def _shown(token: str) -> str:
    return f"'{token}'" if token else "the end"
