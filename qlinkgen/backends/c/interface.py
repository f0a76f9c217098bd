"""The interface of a header for programs that use it: names and properties of its frame."""

from __future__ import annotations

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.conditions import condition, numbers_of, place_of
from qlinkgen.backends.c.dispatch import callback_name, handler_name
from qlinkgen.backends.c.frames import frame_section
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.members import count_of, member_of
from qlinkgen.backends.c.names import Names, count_type, scalar_type, storage, unsigned_type
from qlinkgen.backends.c.types import Types
from qlinkgen.model.message import Field, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Characters, Scalar
from qlinkgen.plan import plan_of
from qlinkgen.plan.payload import Holder, PayloadPlan, Presence, RunStep

__all__ = ["Interface", "count_member", "interface"]


@dataclass(frozen=True)
class Interface:
    """The interface of the header of one protocol.

    Attributes:
        prefix: prefix of functions and types; ``upper`` is that of macros.
        id: member of the frame that holds the message id.
        id_bits: width of the C type of the id.
        address: member of the frame that holds the address, "" if there is none.
        address_bits: width of the C type of the address, 0 if there is none.
        directed: decoding and receiving frames need the expected direction.
        unpacks: decoding a frame needs a buffer.
        rescans: one byte can produce several events, and the end of a stream more.
        gaps: only a silence ends a frame.
        packets: a response is decoded by the function of its message, and has no receiver.
        listener: name of the struct that receives messages, "" if there is none.
        sum_bits: width of the sum of a request in the check value of its response, 0 if there is none.
        check_bits: width of the functions of the check value, 0 if there are none.
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
    gaps: bool
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
        """The part of names that identifies a message."""
        return self.names.stem(message)

    def function(self, message: Message) -> str:
        """Prefix of the functions and the struct of a message."""
        return self.names.function(message)

    def constant(self, message: Message) -> str:
        """Prefix of the macros of a message."""
        return self.names.constant(message)

    def record(self, name: str) -> str:
        """Prefix of the struct of a record."""
        return self.names.record(name)

    def count_member(self, field: Field) -> str:
        """The struct member with the number of items of a field of variable size."""
        return count_member(field)

    def conversions(self, message: Message, value: str, number: Scalar) -> str:
        """Prefix of the conversion functions of a scaled value."""
        kind = self.types.conversions(self.function(message), value, number)
        return kind.stem if kind else ""

    def slave_member(self, message: Message) -> str:
        """The member of the slave struct that handles a request."""
        return handler_name(self.names, message)

    def callback_member(self, message: Message) -> str:
        """The member of the listener struct that handles a message."""
        return callback_name(self.names, message)

    def width(self, scalar: Scalar) -> int:
        """Size of the struct member of an integer."""
        if isinstance(scalar.meaning, Characters):
            return scalar.meaning.number
        return 1 if scalar_type(scalar) == "bool" else storage(scalar.bits) // 8

    @staticmethod
    def member(step: Holder) -> str:
        """The path of the struct member of a value."""
        return member_of(step)

    @staticmethod
    def counting(run: RunStep) -> str:
        """The path of the struct member with the number of items of a run of variable size."""
        return count_of(run)

    @staticmethod
    def test(payload: PayloadPlan, presence: Presence, inside: str, parts: str) -> str:
        """The expression that is true if a struct has a field; ``inside`` precedes its members.

        ``parts`` precedes those of the values of its frame.
        """
        return condition(presence.when, numbers_of(payload), place_of(payload, inside, parts))

    def count_width(self, most: int) -> int:
        """Size of the struct member that counts up to ``most``."""
        return _bits(count_type(most)) // 8


def count_member(field: Field) -> str:
    """The struct member with the number of items of a field of variable size."""
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
        gaps=section.gaps,
        packets=section.slave_only,
        listener="" if section.slave_only else section.dispatch.listener,
        sum_bits=_bits(section.request_sum),
        check_bits=_bits(unsigned_type(section.check.width)) if section.check else 0,
    )


def _bits(kind: str) -> int:
    return int(kind.removeprefix("u").removeprefix("int").removesuffix("_t")) if kind else 0
