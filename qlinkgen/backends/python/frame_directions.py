"""What is decoded in each direction, and the answer to an unknown request."""

from __future__ import annotations

from collections.abc import Sequence

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python import pieces
from qlinkgen.backends.python.layout import in_hex
from qlinkgen.backends.python.names import attribute, class_name
from qlinkgen.backends.python.ways import Ways
from qlinkgen.model.message import Direction
from qlinkgen.model.naming import address_attribute
from qlinkgen.plan.ends import ByMessage
from qlinkgen.plan.tree import MessagePlan, Plan


@dataclass(frozen=True)
class DecodedDirection:
    """A decoded direction: its function, its word in texts, and the names of its tables.

    ``asking`` is the parameter of the function for the request, "" if no answer needs it.
    """

    direction: Direction
    function: str
    words: str
    classes: str
    readers: str
    asking: str
    by_id: str
    readers_by_id: str
    #: The function that decodes one frame, and what the decoder of a stream uses.
    decode: str = "_decode"
    #: The table of its kinds of frame, "" if both directions have the same.
    kinds: str = ""
    ways: Sequence[str] = ()


@dataclass(frozen=True)
class UnknownView:
    """The reply to a request with an unknown number: its class, and the arguments of that.

    Attributes:
        number: the number in ``frame``.
        address: the address in it, "" if there is none.
        added: what the number of the reply adds to that of the request, None if it has one of its own.
        most: the greatest number.
        by_message: the message tells the end of a frame, so a silence tells that of an unknown one.
    """

    reply: str
    arguments: str
    number: str
    address: str
    added: int | None
    most: str
    by_message: bool


def unknown_view(plan: Plan) -> UnknownView | None:
    """The reply to a request with an unknown number, None if the decoder is not one of requests."""
    unknown = plan.protocol.to_unknown
    if (
        unknown is None
        or "request" not in plan.received_directions
        or unknown.message.name not in plan.by_name
    ):
        return None
    frame = plan.frames["request"]
    envelope, address = frame.envelope.inner, plan.frame.address
    arguments = [f"{address_attribute(address)}=node or 0"] if address else []
    arguments += [f"{attribute(name)}={raw}" for name, raw in unknown.raws]
    return UnknownView(
        reply=class_name(plan.by_name[unknown.message.name]),
        arguments=", ".join(arguments),
        number=pieces.number(envelope, envelope.id, "frame"),
        address=pieces.number(envelope, envelope.address, "frame") if envelope.address else "",
        added=unknown.added,
        most=in_hex((1 << sum(each.bits for each in envelope.id)) - 1),
        by_message=isinstance(frame.end, ByMessage),
    )


def decoded_directions(plan: Plan, ways: Ways) -> list[DecodedDirection]:
    """Functions and tables for each decoded direction."""
    return [_decoded_direction(plan, direction, ways) for direction in plan.received_directions]


def _decoded_direction(plan: Plan, direction: Direction, ways: Ways) -> DecodedDirection:
    messages = plan.received(direction)
    whole = direction == "message"
    upper = "" if whole else f"_{direction.upper()}"
    return DecodedDirection(
        direction=direction,
        function="decode" if whole else f"decode_{direction}",
        words="" if whole else f"{direction} ",
        classes="_MESSAGES" if whole else f"{upper}S",
        readers=f"{upper}_READERS",
        asking=", request: Message | None = None" if direction == "response" and plan.asked else "",
        by_id=by_id(messages),
        readers_by_id=by_id(messages, ".from_checked"),
        decode=ways.of("_decode", direction),
        kinds=f"_KINDS{upper}" if plan.parted else "",
        ways=[ways.of(name, direction) for name in ("_split", "_judge", "_MAX_FRAME", "_whole")],
    )


def by_id(messages: Sequence[MessagePlan], attribute: str = "") -> str:
    """A dict of message classes, or of one of their attributes, by message id."""
    rows = (f"{in_hex(each.id)}: {class_name(each)}{attribute}" for each in messages)
    return f"{{{', '.join(rows)}}}"
