"""What an output is for: the role of its user, and the messages that are kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Enum, Flags, Scalar

Role = Literal["both", "master", "slave"]

#: The role that sends messages of a direction alone, "" where both do.
_SENDERS: dict[Direction, str] = {"request": "master", "response": "slave", "message": ""}


@dataclass(frozen=True, slots=True)
class Options:
    """What is left out of the output, and where the Python package goes.

    Attributes:
        role: side that the output is for; what the other side alone needs is left out where a target can.
        only: commands or messages that are kept, all where it is empty.
        package: folder of the Python package, below the output folder.
    """

    role: Role = "both"
    only: tuple[str, ...] = ()
    package: str = "python/codecs"


def kept(protocol: Protocol, options: Options) -> tuple[Message, ...]:
    """The messages that are kept, in schema order."""
    wanted = set(options.only)
    return tuple(m for m in protocol.messages if not wanted or {m.name, m.command} & wanted)


def encoded(message: Message, role: Role) -> bool:
    """The role sends the message."""
    return role in ("both", _SENDERS[message.direction]) or message.direction == "message"


def decoded(message: Message, role: Role) -> bool:
    """The role receives the message."""
    return role != _SENDERS[message.direction]


def heard(protocol: Protocol, role: Role) -> tuple[Direction, ...]:
    """The directions that the role receives."""
    if protocol.directions == ("message",):
        return ("message",)
    heard: dict[Role, tuple[Direction, ...]] = {
        "both": ("request", "response"),
        "master": ("response",),
        "slave": ("request",),
    }
    return heard[role]


def named(messages: tuple[Message, ...]) -> frozenset[str]:
    """Names of the enums and flags that values of the messages have."""
    scalars = (value.type for message in messages for value in message.values)
    meanings = (scalar.meaning for scalar in scalars if isinstance(scalar, Scalar))
    return frozenset(each.name for each in meanings if isinstance(each, Enum | Flags))
