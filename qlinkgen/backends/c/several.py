"""Several answers to one request: their end for a master, and the turn of a slave in a list of nodes."""

from __future__ import annotations

from collections.abc import Iterable

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.checks import broken, condition
from qlinkgen.backends.c.names import Names, count_type, scalar_type
from qlinkgen.model.message import Message
from qlinkgen.model.naming import member, snake
from qlinkgen.model.transaction import ByCount, ByEach, ByField, Command
from qlinkgen.model.types import Scalar
from qlinkgen.plan.expr import Within


@dataclass(frozen=True, slots=True)
class Listed:
    """A list of nodes in a request, as expressions.

    Attributes:
        most: maximum number of nodes.
        kind: type of a place in it.
        count: number of nodes.
        item: the node at a place, which replaces ``{}``.
    """

    most: int
    kind: str
    count: str
    item: str

    def node(self, place: str) -> str:
        """The node at a place."""
        return self.item.format(place)


@dataclass(frozen=True, slots=True, kw_only=True)
class SeveralEntry:
    """How a master counts the answers to a request.

    Attributes:
        request, response: the structs that the functions take, "" for none.
        kind: type of the number of answers.
        count: their number, "" if something else ends them.
        last: condition for the last one, "" if their number ends them.
        listed: the nodes of which each sends one, None if something else ends them.
        node: the node of an answer, "" if its frame has it.
    """

    name: str
    request: str = ""
    response: str = ""
    kind: str = ""
    count: str = ""
    last: str = ""
    listed: Listed | None = None
    node: str = ""


def several(names: Names, commands: Iterable[Command], present: Iterable[Message]) -> list[SeveralEntry]:
    """The commands whose answers a master can count."""
    kept = {message.name for message in present}
    return [
        entry
        for command in commands
        if command.request.name in kept
        and command.response is not None
        and command.response.name in kept
        and (entry := _entry(names, command, command.response))
    ]


def _entry(names: Names, command: Command, response: Message) -> SeveralEntry | None:
    """What a master of a command counts, None if a reply or a time ends the answers."""
    name, request = f"{names.prefix}_{snake(command.name)}_answers", f"{names.function(command.request)}_t"
    answer = f"{names.function(response)}_t"
    match command.many:
        case ByCount() as many:
            kind = count_type(many.most)
            count = f"({kind})request->{member(many.field)}" if many.field else f"{many.most}U"
            return SeveralEntry(name=name, request=request if many.field else "", kind=kind, count=count)
        case ByField() as many:
            value = next(each for each in response.values if each.name == many.field)
            assert isinstance(value.type, Scalar)
            return SeveralEntry(name=name, response=answer, last=_within(value.type, many))
        case ByEach() as many:
            listed = listed_in(command.request, many, "request->")
            node = f"response->{member(many.by)}" if many.by else ""
            response_type = answer if many.by else ""
            return SeveralEntry(
                name=name, request=request, response=response_type, kind=listed.kind, listed=listed, node=node
            )
        case _:
            return None


def listed_in(request: Message, many: ByEach, place: str) -> Listed:
    """The list of a request at a place, which ends with ``.`` or ``->``."""
    field = next(each for each in request.fields if each.name == many.field)
    path = f"{place}{member(many.field)}"
    count = f"{many.most}U" if field.fixed else f"{place}{many.field}_{field.quantity}"
    inside = f".{member(many.key)}" if many.key else ""
    return Listed(many.most, count_type(many.most), count, f"{path}[{{}}]{inside}")


def _within(number: Scalar, many: ByField) -> str:
    """The condition that a response is the last one."""
    value = f"response->{member(many.field)}"
    assert scalar_type(number) != "bool"
    held = Within(number.natural_minimum, number.natural_maximum)
    rule = Within(max(many.first, held.low), min(many.last, held.high))
    terms = broken([rule], value, held, number.bits, signed=number.signed)
    return f"!({condition(terms)})" if terms else "true"
