"""Expressions of a program: parts of its tree that have a value."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from qlinkgen.link.ring_events import CommsError, NetStat
from qlinkgen.protocols.trio.basic.errors import Place
from qlinkgen.protocols.trio.coordinator_node import CoordinatorNode
from qlinkgen.protocols.trio.facts import check_channel

#: Values of a comparison, as every bit set and none, so that NOT, AND and OR work on them bit by bit.
TRUE, FALSE = -1.0, 0.0
#: Largest number with all its bits in a float.
_MOST_BITS = 2.0**53


class Scope:
    """What an expression can read.

    Attributes:
        node: the node that runs the program.
        names: the program's own variables.
        polled: KEY has found no character.
    """

    def __init__(self, node: CoordinatorNode) -> None:
        self.node = node
        self.names: dict[str, float] = {}
        self.polled = False


class Expression(Protocol):
    """A part of the tree with a value, a finite float."""

    @property
    def place(self) -> Place:
        """Where it begins."""
        ...

    def value(self, scope: Scope) -> float:
        """Return its present value. Raises BasicError if it has none."""
        ...


def whole(expression: Expression, scope: Scope) -> int:
    """Return the value of an expression that has to be a whole number.

    Raises:
        BasicError: it has decimals, or is so large that it has none by chance.
    """
    value = expression.value(scope)
    if value != int(value) or abs(value) > _MOST_BITS:
        raise expression.place.error(f"{value:g} was given; give a whole number")
    return int(value)


@dataclass(frozen=True, slots=True)
class Number:
    """A number as written, TRUE or FALSE."""

    place: Place
    number: float

    def value(self, scope: Scope) -> float:  # noqa: ARG002  # as all expressions
        """Return the number."""
        return self.number


def number_of(place: Place, text: str) -> Number:
    """Return a number by its digits.

    Raises:
        BasicError: it is too large.
    """
    return Number(place, _finite(place, float(text)))


@dataclass(frozen=True, slots=True)
class Name:
    """A variable of the program; 0 before it is set."""

    place: Place
    name: str

    def value(self, scope: Scope) -> float:
        """Return its value."""
        return scope.names.get(self.name, 0.0)

    def set(self, scope: Scope, value: float) -> None:
        """Set it."""
        scope.names[self.name] = value


@dataclass(frozen=True, slots=True)
class Variable:
    """VR(number), a variable of the Motion Coordinator that other nodes can set."""

    place: Place
    number: Expression

    def value(self, scope: Scope) -> float:
        """Return its value."""
        number = whole(self.number, scope)
        with self.place.refusing():
            return scope.node.vr[number]

    def set(self, scope: Scope, value: float) -> None:
        """Set it."""
        number = whole(self.number, scope)
        with self.place.refusing():
            scope.node.vr[number] = value


@dataclass(frozen=True, slots=True)
class Status:
    """NETSTAT or COMMSERROR, the errors of the network since it was set to 0."""

    place: Place
    word: str

    def value(self, scope: Scope) -> float:
        """Return the bits that are set."""
        link = scope.node.link
        return float(link.netstat if self.word == "NETSTAT" else link.commserror)

    def set(self, scope: Scope, value: float) -> None:
        """Clear it. Raises BasicError for another value than 0."""
        if value:
            raise self.place.error(
                f"{self.word} is set to {value:g}; it can only be set to 0, which clears it"
            )
        if self.word == "NETSTAT":
            scope.node.link.netstat = NetStat(0)
        else:
            scope.node.link.commserror = CommsError(0)


@dataclass(frozen=True, slots=True)
class Key:
    """KEY #channel: whether a character has been received."""

    place: Place
    channel: Expression

    def value(self, scope: Scope) -> float:
        """Return TRUE or FALSE; the character stays in the buffer."""
        channel = whole(self.channel, scope)
        with self.channel.place.refusing():
            check_channel(channel)
        scope.polled = scope.polled or not scope.node.received
        return TRUE if scope.node.received else FALSE


@dataclass(frozen=True, slots=True)
class Negative:
    """-operand."""

    place: Place
    operand: Expression

    def value(self, scope: Scope) -> float:
        """Return the negative value."""
        return -self.operand.value(scope)


@dataclass(frozen=True, slots=True)
class Not:
    """NOT operand: every bit inverted."""

    place: Place
    operand: Expression

    def value(self, scope: Scope) -> float:
        """Return the inverted value."""
        return float(~_bits(self.operand.place, self.operand.value(scope)))


@dataclass(frozen=True, slots=True)
class Chain:
    """Operands with operators of one rank between them, computed from the left.

    Attributes:
        rest: for each further operand its operator, where that is, and the operand.
    """

    place: Place
    first: Expression
    rest: tuple[tuple[str, Place, Expression], ...]

    def value(self, scope: Scope) -> float:
        """Return the value of the chain."""
        value = self.first.value(scope)
        for sign, place, operand in self.rest:
            value = _computed(sign, place, value, operand.value(scope))
        return value


_ARITHMETIC: Mapping[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
_COMPARISONS: Mapping[str, Callable[[float, float], bool]] = {
    "=": operator.eq,
    "<>": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
}
_BITWISE: Mapping[str, Callable[[int, int], int]] = {
    "AND": operator.and_,
    "&": operator.and_,
    "OR": operator.or_,
    "XOR": operator.xor,
}
#: Operators by rank, the weakest first; NOT ranks between AND and the comparisons.
RANKS = (("OR", "XOR"), ("AND", "&"), tuple(_COMPARISONS), ("+", "-"), ("*", "/"))


def _computed(sign: str, place: Place, left: float, right: float) -> float:
    if sign in _COMPARISONS:
        return TRUE if _COMPARISONS[sign](left, right) else FALSE
    if sign in _BITWISE:
        return float(_BITWISE[sign](_bits(place, left), _bits(place, right)))
    if sign == "/" and not right:
        raise place.error(f"{left:g} is divided by 0; test the divisor first")
    return _finite(place, _ARITHMETIC[sign](left, right))


def _finite(place: Place, value: float) -> float:
    if not math.isfinite(value):
        raise place.error("the number is too large; keep it below 1e308")
    return value


def _bits(place: Place, value: float) -> int:
    """Return the whole part of a number, on whose bits NOT, AND, OR and XOR work."""
    if abs(value) > _MOST_BITS:
        raise place.error(
            f"{value:g} was given; NOT, AND, OR and XOR work on numbers up to 2 to the power of 53"
        )
    return int(value)
