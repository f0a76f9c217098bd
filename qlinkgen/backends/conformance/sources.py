"""Inputs of the kit in addition to the plan; arguments, because back-ends do not depend on each other."""

from __future__ import annotations

import typing
from collections.abc import Mapping
from typing import Any

from qlinkgen._dataclass import dataclass
from qlinkgen.model.message import Field, Message
from qlinkgen.model.types import Scalar
from qlinkgen.plan.payload import Holder, PayloadPlan, Presence, RunStep

#: A document of vectors or one line of it.
JsonObject = Mapping[str, Any]  # the entries depend on the message


class Header(typing.Protocol):
    """The interface of the header under test: names and properties of its frame."""

    @property
    def prefix(self) -> str:
        """Prefix of functions and types."""
        ...

    @property
    def upper(self) -> str:
        """Prefix of macros."""
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
        """Member of the frame that holds the address, "" if there is none."""
        ...

    @property
    def address_bits(self) -> int:
        """Width of its C type, 0 if there is none."""
        ...

    @property
    def directed(self) -> bool:
        """Whether decoding and receiving frames need the expected direction."""
        ...

    @property
    def unpacks(self) -> bool:
        """Whether decoding a frame needs a buffer."""
        ...

    @property
    def listener(self) -> str:
        """Name of the struct that receives messages, "" if there is none."""
        ...

    @property
    def sum_bits(self) -> int:
        """Width of the sum of a request in the check value of its response, 0 if there is none."""
        ...

    @property
    def check_bits(self) -> int:
        """Width of the functions of the check value, 0 if there are none."""
        ...

    def stem(self, message: Message) -> str:
        """The part of names that identifies a message."""
        ...

    def function(self, message: Message) -> str:
        """Prefix of the functions and the struct of a message."""
        ...

    def constant(self, message: Message) -> str:
        """Prefix of the macros of a message."""
        ...

    def record(self, name: str) -> str:
        """Prefix of the struct of a record."""
        ...

    def count_member(self, field: Field) -> str:
        """The struct member with the number of items of a field of variable size."""
        ...

    def slave_member(self, message: Message) -> str:
        """The member of the slave struct that handles a request."""
        ...

    def callback_member(self, message: Message) -> str:
        """The member of the listener struct that handles a message."""
        ...

    def width(self, scalar: Scalar) -> int:
        """Size of the struct member of an integer."""
        ...

    def member(self, step: Holder) -> str:
        """The path of the struct member of a value."""
        ...

    def counting(self, run: RunStep) -> str:
        """The path of the struct member with the number of items of a run of variable size."""
        ...

    def test(self, payload: PayloadPlan, presence: Presence, inside: str, parts: str) -> str:
        """The expression that is true if a struct has a field; ``inside`` precedes its members.

        ``parts`` precedes those of the values of its frame.
        """
        ...

    def count_width(self, most: int) -> int:
        """Size of the struct member that counts up to ``most``."""
        ...


@dataclass(frozen=True, slots=True)
class Sources:
    """The vectors and the header of a kit.

    Attributes:
        header: the header.
        generated: vectors as the target `vectors` writes them: ``vectors`` and ``faults``.
        by_hand: vectors worked out by hand, in the format of schemas/vectors; {} if there are none.
    """

    header: Header
    generated: JsonObject
    by_hand: JsonObject
