"""What the kit is made of beside the plan: arguments all, as back-ends do not know each other."""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from qlinkgen.model.message import Field, Message
from qlinkgen.model.types import Scalar

#: A document of vectors or one line of it. Any: what an entry holds depends on its message.
JsonObject = Mapping[str, Any]


class Header(typing.Protocol):
    """The header that the kit is compiled with: its names, and the habits of its frame."""

    @property
    def prefix(self) -> str:
        """What functions and types begin with."""
        ...

    @property
    def upper(self) -> str:
        """What macros begin with."""
        ...

    @property
    def id(self) -> str:
        """Member of the frame that holds the message id."""
        ...

    @property
    def id_bits(self) -> int:
        """Width of its C type."""
        ...

    @property
    def address(self) -> str:
        """Member of the frame that holds the address, "" where there is none."""
        ...

    @property
    def address_bits(self) -> int:
        """Width of its C type, 0 where there is none."""
        ...

    @property
    def directed(self) -> bool:
        """Taking frames apart and receiving are told which direction is expected."""
        ...

    @property
    def unpacks(self) -> bool:
        """Taking a frame apart needs a buffer."""
        ...

    @property
    def listener(self) -> str:
        """What the struct is called that is told of messages, "" where there is none."""
        ...

    @property
    def sum_bits(self) -> int:
        """Width of the part of an answer's check value that its request makes, 0 where there is none."""
        ...

    @property
    def check_bits(self) -> int:
        """Width of the check value's functions, 0 where there are none."""
        ...

    def stem(self, message: Message) -> str:
        """A message's part of a name."""
        ...

    def function(self, message: Message) -> str:
        """What a message's functions and its struct begin with."""
        ...

    def constant(self, message: Message) -> str:
        """What a message's macros begin with."""
        ...

    def count_member(self, field: Field) -> str:
        """The struct member that says how much of a field of variable size there is."""
        ...

    def slave_member(self, message: Message) -> str:
        """The member of the slave's struct that handles a request."""
        ...

    def told_member(self, message: Message) -> str:
        """The member of the listener's struct that is told of a message."""
        ...

    def width(self, scalar: Scalar) -> int:
        """Bytes of the struct member of an integer."""
        ...

    def count_width(self, most: int) -> int:
        """Bytes of the struct member that counts up to ``most``."""
        ...


@dataclass(frozen=True, slots=True)
class Sources:
    """Everything that the kit states, and what it is written against.

    Attributes:
        header: the header.
        generated: vectors as the target `vectors` writes them: ``vectors`` and ``faults``.
        by_hand: vectors that people worked out, in the form of schemas/vectors; {} where there are none.
    """

    header: Header
    generated: JsonObject
    by_hand: JsonObject
