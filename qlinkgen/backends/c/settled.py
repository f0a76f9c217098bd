"""Values of frames that are the same in every frame of a message."""

from __future__ import annotations

from collections.abc import Mapping

from qlinkgen.backends.c.names import literal
from qlinkgen.model.message import Message
from qlinkgen.model.naming import member
from qlinkgen.model.types import Scalar
from qlinkgen.plan.payload import Member


def differing(message: Message, values: Mapping[str, Member], owner: str) -> list[str]:
    """Conditions that hold if a member of ``owner`` is not what the message states."""
    return [
        (f"{'!' if number else ''}{owner}{member(name)}")
        if values[name].number.meaning == "bool"
        else f"{owner}{member(name)} != {_literal(values[name].number, number)}"
        for name, number in message.settled
    ]


def assigned(message: Message, values: Mapping[str, Member], owner: str) -> list[str]:
    """Statements that give members of ``owner`` what the message states."""
    return [
        f"{owner}{member(name)} = {_literal(values[name].number, number)};"
        for name, number in message.settled
    ]


def _literal(kind: Scalar, number: int) -> str:
    if kind.meaning == "bool":
        return "true" if number else "false"
    return literal(number, kind.bits, signed=kind.signed)
