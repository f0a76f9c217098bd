"""Selects the messages of an output by role and name."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Literal

from qlinkgen._dataclass import dataclass
from qlinkgen.model.fields import Layout, layouts_of
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import ByCommand, ByReply, Command
from qlinkgen.model.types import Array, Enum, Flags, Scalar

Role = Literal["both", "master", "slave"]

#: The only role that sends messages of a direction, "" if both do.
_SENDERS: dict[Direction, str] = {"request": "master", "response": "slave", "message": ""}


@dataclass(frozen=True, slots=True)
class Options:
    """Selects the messages of the output and the folder of the Python package.

    Attributes:
        role: the role that the output is for; targets may omit code that only the other role needs.
        only: names of the selected commands or messages; empty for all.
        package: folder of the Python package, below the output folder.
    """

    role: Role = "both"
    only: tuple[str, ...] = ()
    package: str = "python/codecs"


def kept(protocol: Protocol, options: Options) -> tuple[Message, ...]:
    """The selected messages, in schema order."""
    wanted = set(options.only)
    commands = [command for command in protocol.commands if command.name in wanted or _asks(command, wanted)]
    wanted |= {command.stopped.command for command in commands if command.stopped}
    wanted |= {message.name for command in commands for message in command.messages}
    if any(protocol.is_asked(m) and m.name in wanted for m in protocol.messages):
        wanted |= {message.name for message in protocol.messages if message.carries}
    return tuple(m for m in protocol.messages if not wanted or {m.name, m.command} & wanted)


def _asks(command: Command, wanted: Collection[str]) -> bool:
    """Whether only its request is selected, but a master cannot send it without knowing what follows."""
    follows = bool(command.steps) or isinstance(command.many, ByReply | ByCommand)
    return follows and command.request.name in wanted


def encoded(message: Message, role: Role) -> bool:
    """Whether the role sends the message."""
    return role in ("both", _SENDERS[message.direction]) or message.direction == "message"


def decoded(message: Message, role: Role) -> bool:
    """Whether the role receives the message."""
    return role != _SENDERS[message.direction]


def received_directions(protocol: Protocol, role: Role) -> tuple[Direction, ...]:
    """The directions that the role receives."""
    if protocol.directions == ("message",):
        return ("message",)
    by_role: dict[Role, tuple[Direction, ...]] = {
        "both": ("request", "response"),
        "master": ("response",),
        "slave": ("request",),
    }
    return by_role[role]


def named(messages: tuple[Message, ...], beside: Iterable[Scalar]) -> frozenset[str]:
    """Names of the enums and flags that the messages use, or the values of every frame."""
    fields = [field for message in messages for field in message.fields]
    owners: list[Message | Layout] = [*messages, *layouts_of(fields)]
    types = (value.type for owner in owners for value in owner.values)
    scalars = (each.item if isinstance(each, Array) else each for each in (*types, *beside))
    meanings = (scalar.meaning for scalar in scalars if isinstance(scalar, Scalar))
    return frozenset(each.name for each in meanings if isinstance(each, Enum | Flags))
