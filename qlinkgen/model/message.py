"""A message: its fields in wire order, and the limits of its payload."""

from __future__ import annotations

from functools import cached_property
from typing import Literal

from qlinkgen._dataclass import dataclass
from qlinkgen.model.fields import Field, Value, docs_of, greatest_size, separated_size, values_of
from qlinkgen.model.texts import Text

__all__ = ["Direction", "Field", "Message", "Value"]

#: "request": master to slave; "response": slave to master; "message": from any node, without a response.
Direction = Literal["request", "response", "message"]
#: Name of the message that carries the answers which only their request tells apart.
CARRIER = "unasked"


@dataclass(frozen=True, slots=True)
class Example:
    """A frame of the source document, with the full name of its message.

    ``after`` is the request that it answers, b"" if its meaning does not depend on one.
    """

    message: str
    wire: bytes
    after: bytes = b""
    #: It is legal, but an encoder sends other bytes.
    decode_only: bool = False


@dataclass(frozen=True)
class Message:
    """One message in one direction.

    ``addresses`` are the (first, last) ranges of legal addresses, () if the frame has no address.
    """

    name: str
    command: str
    direction: Direction
    id: int
    fields: tuple[Field, ...]
    doc: Text = ""
    section: Text = ""
    confirmed: bool = True
    #: An empty payload means that every field has its default.
    empty_is_default: bool = False
    #: The frame's checksum is sent with this message.
    checksum: bool = True
    addresses: tuple[tuple[int, int], ...] = ()
    default_address: int = 0
    #: Values of the frame that an answer repeats.
    echoed: tuple[str, ...] = ()
    #: Values of its frame that are the same in each of its frames, and their numbers.
    settled: tuple[tuple[str, int], ...] = ()
    #: Bytes of attributes that check values cover, by their names in ``over``.
    seeds: tuple[tuple[str, bytes], ...] = ()
    #: It carries the answers with its number, which only their request tells apart.
    carries: bool = False
    #: The byte between fields, which are texts; b"" if there is none.
    separator: bytes = b""
    #: It precedes the first field too.
    leading: bool = False
    #: Values of its frame that conditions of its fields test.
    decided_by: tuple[Value, ...] = ()
    #: Its id, if payloads begin with ids of several lengths; None for others. Its first field is this text.
    text: bytes | None = None
    #: Letters of either case are received in it.
    folded: bool = False
    #: What the frame allows, where all records together may be larger than that; None for others.
    limit: int | None = None

    @cached_property
    def min_size(self) -> int:
        """Minimum size of the payload, without regard to ``empty_is_default``."""
        if self.separator:
            return separated_size(self.fields, leading=self.leading)[0]
        return sum(field.min_size for field in self.fields)

    @property
    def usual_size(self) -> int:
        """Size of the payload of a new message, not between separators."""
        return sum(field.usual_size for field in self.fields)

    @cached_property
    def max_size(self) -> int:
        """Maximum size of the payload."""
        size = greatest_size(self.fields)
        if self.separator:
            size = separated_size(self.fields, leading=self.leading)[1]
        return size if self.limit is None else min(size, self.limit)

    @property
    def fixed(self) -> bool:
        """Whether the size of the payload is constant."""
        return not self.separator and all(field.fixed for field in self.fields)

    @cached_property
    def variable(self) -> tuple[Field, ...]:
        """Fields of variable size, in wire order."""
        return tuple(field for field in self.fields if not field.fixed)

    @cached_property
    def values(self) -> tuple[Value, ...]:
        """Values in wire order; constants, reserved bytes and counts are not values."""
        return tuple(values_of(self.fields))

    @property
    def opened(self) -> bool:
        """Whether its first field is its id."""
        return bool(self.text)

    @property
    def echoes(self) -> tuple[str, ...]:
        """Values that repeat something of the request, or prove it."""
        found = (each.name for each in self.values if each.field.repeats or each.field.proves)
        return (*self.echoed, *found)

    @property
    def docs(self) -> dict[str, str]:
        """Descriptions of fields and of the values inside them, by name."""
        return docs_of(self.fields)
