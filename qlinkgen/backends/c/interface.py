"""What a program written against a header has to know of it: its names, and the habits of its frame."""

from __future__ import annotations

from dataclasses import dataclass

from qlinkgen.backends.c.dispatch import handler_name, told_name
from qlinkgen.backends.c.frames import frame_section
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import Names, count_type, scalar_type, storage, unsigned_type
from qlinkgen.backends.c.types import Types
from qlinkgen.model.message import Field, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Scalar
from qlinkgen.plan import plan_of

__all__ = ["Interface", "count_member", "interface"]


@dataclass(frozen=True)
class Interface:
    """The header of one protocol, as its user sees it.

    Attributes:
        prefix: what functions and types begin with; ``upper`` is that of macros.
        id: member of the frame that holds the message id.
        id_bits: width of the id's C type.
        address: member of the frame that holds the address, "" if there is none.
        address_bits: width of the address's C type, 0 if there is none.
        directed: taking frames apart and receiving are told which direction is expected.
        unpacks: taking a frame apart needs a buffer.
        rescans: one byte can bring several events, and the end of a stream some more.
        packets: an answer is taken apart by its message's own function, and nothing receives it.
        listener: what the struct is called that is told of messages, "" where there is none.
        sum_bits: width of the part of an answer's check value that its request makes, 0 if there is none.
        check_bits: width of the check value's functions, 0 if there are none.
    """

    names: Names
    types: Types
    id: str
    id_bits: int
    address: str
    address_bits: int
    directed: bool
    unpacks: bool
    rescans: bool
    packets: bool
    listener: str
    sum_bits: int
    check_bits: int

    @property
    def prefix(self) -> str:
        """The protocol's name."""
        return self.names.prefix

    @property
    def upper(self) -> str:
        """The protocol's name in macros."""
        return self.names.upper

    def stem(self, message: Message) -> str:
        """A message's part of a name."""
        return self.names.stem(message)

    def function(self, message: Message) -> str:
        """What a message's functions and its struct begin with."""
        return self.names.function(message)

    def constant(self, message: Message) -> str:
        """What a message's macros begin with."""
        return self.names.constant(message)

    def count_member(self, field: Field) -> str:
        """The struct member that says how much of a field of variable size there is."""
        return count_member(field)

    def conversions(self, message: Message, value: str, number: Scalar) -> str:
        """What the names of the functions begin with that convert a scaled value."""
        kind = self.types.conversions(message, value, number)
        return kind.stem if kind else ""

    def slave_member(self, message: Message) -> str:
        """The member of the slave's struct that handles a request."""
        return handler_name(self.names, message)

    def told_member(self, message: Message) -> str:
        """The member of the listener's struct that is told of a message."""
        return told_name(self.names, message)

    def width(self, scalar: Scalar) -> int:
        """Bytes of the struct member of an integer."""
        return 1 if scalar_type(scalar) == "bool" else storage(scalar.bits) // 8

    def count_width(self, most: int) -> int:
        """Bytes of the struct member that counts up to ``most``."""
        return _bits(count_type(most)) // 8


def count_member(field: Field) -> str:
    """The struct member that says how much of a field of variable size there is."""
    return f"{field.name}_{field.quantity}"


def interface(protocol: Protocol) -> Interface:
    """Describe the header of a protocol."""
    plan, names = plan_of(protocol), Names(protocol)
    section = frame_section(plan, Layouts(protocol.name))
    view = section.view
    return Interface(
        names=names,
        types=Types(plan, names),
        id=view.id,
        id_bits=_bits(view.id_type),
        address=view.address,
        address_bits=_bits(view.address_type),
        directed=view.needs_direction,
        unpacks=bool(view.body_size),
        rescans=section.rescans,
        packets=section.slave_only,
        listener="" if section.slave_only else section.dispatch.listener,
        sum_bits=_bits(section.request_sum),
        check_bits=_bits(unsigned_type(section.check.width)) if section.check else 0,
    )


def _bits(kind: str) -> int:
    return int(kind.removeprefix("u").removeprefix("int").removesuffix("_t")) if kind else 0
