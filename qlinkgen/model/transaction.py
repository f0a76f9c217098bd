"""Transactions: request, response, timing and repetition."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from types import MappingProxyType
from typing import Literal

from qlinkgen.model.message import Message
from qlinkgen.model.texts import Labels, Text

#: "node": one node; "broadcast": all nodes; "either": one or all, and only requests to one node are answered;
#: "answered_broadcast": one or all, and a broadcast is answered too, so that only one node may be on the bus;
#: "none": the frame has no address.
Addressing = Literal["node", "broadcast", "either", "answered_broadcast", "none"]
BusKind = Literal["master_slave", "ring", "host"]


@dataclass(frozen=True, slots=True)
class Allowance:
    """Response time limit: ``byte_times`` at the speed of the bus plus ``seconds``."""

    byte_times: Fraction = Fraction(0)
    seconds: Fraction = Fraction(0)


@dataclass(frozen=True, slots=True)
class Repeat:
    """Whether a request may be repeated after a missing response."""

    #: Repeating the request is harmless.
    safe: bool
    #: Field by which the slave distinguishes a repeat from a new request, "" if there is none.
    counter: str = ""


@dataclass(frozen=True, slots=True)
class Command:
    """A transaction: a request and its response, None if it is not answered."""

    name: str
    id: int
    request: Message
    response: Message | None
    addressing: Addressing
    response_within: Allowance
    repeat: Repeat
    #: Maximum number of outstanding requests.
    in_flight: int = 1
    doc: Text = ""
    section: Text = ""
    confirmed: bool = True
    #: Protocol-specific attributes; names and values are declared in the schema.
    attributes: Labels = field(default_factory=lambda: MappingProxyType({}))

    @property
    def echoes(self) -> tuple[str, ...]:
        """Values of the response that repeat the value of the same name in the request."""
        values = self.response.values if self.response else ()
        return tuple(value.name for value in values if value.field.echo)


@dataclass(frozen=True, slots=True)
class Bus:
    """The line and its nodes. ``nodes`` is the (first, last) address, None if frames have no address."""

    kind: BusKind
    nodes: tuple[int, int] | None
    broadcast: int | None
    #: Usual speed of the line in bit/s, None if the document does not state it.
    baud: int | None
    bits_per_byte: int
    response_within: Allowance
    section: Text = ""
