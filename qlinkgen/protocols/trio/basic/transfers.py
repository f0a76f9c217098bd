"""Statements that set variables, and that exchange data with other nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from qlinkgen.protocols.trio.basic.errors import Place
from qlinkgen.protocols.trio.basic.expressions import Expression, Scope, whole
from qlinkgen.protocols.trio.basic.statements import Runner
from qlinkgen.protocols.trio.coordinator_node import send_message, text_message
from qlinkgen.protocols.trio.facts import check_channel
from qlinkgen.protocols.trio.printing import CHR, CURSOR, VALUE, pieces, printed


class Target(Protocol):
    """A variable that a statement can set."""

    def set(self, scope: Scope, value: float) -> None:
        """Set it."""
        ...


@dataclass(frozen=True, slots=True)
class Let:
    """target = expression."""

    place: Place
    target: Target
    expression: Expression

    def run(self, runner: Runner) -> bool:
        """Set the variable."""
        self.target.set(runner.scope, self.expression.value(runner.scope))
        return True


@dataclass(frozen=True, slots=True)
class Get:
    """GET #channel, target."""

    place: Place
    channel: Expression
    target: Target

    def run(self, runner: Runner) -> bool:
        """Take a character, if there is one."""
        channel = whole(self.channel, runner.scope)
        with self.channel.place.refusing():
            value = runner.scope.node.take(check_channel(channel))
        if value is None:
            return False
        self.target.set(runner.scope, float(value))
        return True


class Item(Protocol):
    """An item of PRINT."""

    def text(self, scope: Scope) -> str:
        """Return its text."""
        ...


@dataclass(frozen=True, slots=True)
class Text:
    """Text between quotes, or the blank of a comma."""

    written: str

    def text(self, scope: Scope) -> str:  # noqa: ARG002  # as all items
        """Return it."""
        return self.written


@dataclass(frozen=True, slots=True)
class Control:
    """CHR(code) or CURSOR(place)."""

    word: str
    code: Expression

    def text(self, scope: Scope) -> str:
        """Return the characters."""
        code = whole(self.code, scope)
        with self.code.place.refusing():
            return CHR(code) if self.word == "CHR" else CURSOR(code)


@dataclass(frozen=True, slots=True)
class Formatted:
    """A number, with its `[width, decimals]` or `[decimals]` if it has one."""

    number: Expression
    form: tuple[Expression, ...] = ()

    def text(self, scope: Scope) -> str:
        """Return the number as text."""
        number, form = self.number.value(scope), [whole(each, scope) for each in self.form]
        with self.number.place.refusing():
            match form:
                case [width, decimals]:
                    return str(VALUE(number, width, decimals))
                case [decimals]:
                    return str(VALUE(number, decimals=decimals))
                case _:
                    return str(VALUE(number))


@dataclass(frozen=True, slots=True)
class Print:
    """PRINT #node, item; item; ..."""

    place: Place
    node: Expression
    items: tuple[Item, ...]
    end: str

    def run(self, runner: Runner) -> bool:
        """Send the text of the items."""
        node = whole(self.node, runner.scope)
        items = tuple(item.text(runner.scope) for item in self.items)
        with self.node.place.refusing():
            text_message(node, "")  # refuses a wrong number before anything is sent
            messages = [text_message(node, piece) for piece in pieces(printed(items, "", self.end))]
        runner.transmit(messages, self.place)
        return True


@dataclass(frozen=True, slots=True)
class Send:
    """SEND(node, type, data1[, data2])."""

    place: Place
    node: Expression
    type: Expression
    data1: Expression
    data2: Expression | None = None

    def run(self, runner: Runner) -> bool:
        """Send the message."""
        scope = runner.scope
        node, kind, data1 = (whole(each, scope) for each in (self.node, self.type, self.data1))
        data2 = None if self.data2 is None else self.data2.value(scope)
        with self.place.refusing():
            message = send_message(node, kind, data1, data2)
        runner.transmit([message], self.place)
        return True


@dataclass(frozen=True, slots=True)
class DefKey:
    """DEFKEY(key, value, value, ...)."""

    place: Place
    key: Expression
    values: tuple[Expression, ...]

    def run(self, runner: Runner) -> bool:
        """Define the values of channel 3."""
        key, *values = (whole(each, runner.scope) for each in (self.key, *self.values))
        with self.place.refusing():
            runner.scope.node.keys.define(key, *values)
        return True
