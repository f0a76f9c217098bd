"""Who asks, what answers, how long to wait, what may be repeated."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from types import MappingProxyType
from typing import Literal

from qlinkgen.model.message import Message
from qlinkgen.model.texts import Labels, Text

#: "node": one node; "broadcast": all; "either": one or all, an answer comes from one node alone if at all;
#: "answered_broadcast": one or all, and a broadcast is answered too, so only one node may be there;
#: "none": the frame has no address.
Addressing = Literal["node", "broadcast", "either", "answered_broadcast", "none"]
BusKind = Literal["master_slave", "ring", "host"]


@dataclass(frozen=True, slots=True)
class Allowance:
    """Time that the answering side may take: ``byte_times`` at the bus's speed plus ``seconds``."""

    byte_times: Fraction = Fraction(0)
    seconds: Fraction = Fraction(0)


@dataclass(frozen=True, slots=True)
class Repeat:
    """Whether a request may be sent again when no answer came."""

    #: Repeating the request does no harm.
    safe: bool
    #: Field that tells the slave a repeat from a new request, "" where there is none.
    counter: str = ""


@dataclass(frozen=True, slots=True)
class Command:
    """A transaction: a request and its response, or None where nothing answers."""

    name: str
    id: int
    request: Message
    response: Message | None
    addressing: Addressing
    response_within: Allowance
    repeat: Repeat
    #: Requests that may be under way at once.
    in_flight: int = 1
    doc: Text = ""
    section: Text = ""
    confirmed: bool = True
    #: What this protocol alone says of its commands; names and values are declared in the schema.
    attributes: Labels = field(default_factory=lambda: MappingProxyType({}))

    @property
    def echoes(self) -> tuple[str, ...]:
        """Values of the response that repeat the value of the same name of the request."""
        values = self.response.values if self.response else ()
        return tuple(value.name for value in values if value.field.echo)


@dataclass(frozen=True, slots=True)
class Bus:
    """The line and who is on it. ``nodes`` is the (first, last) address, None where frames have none."""

    kind: BusKind
    nodes: tuple[int, int] | None
    broadcast: int | None
    #: Usual speed of the line, None where the document names none.
    baud: int | None
    bits_per_byte: int
    response_within: Allowance
    section: Text = ""
