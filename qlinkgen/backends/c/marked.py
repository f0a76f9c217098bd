"""Frames whose header and end have a marker bit."""

from __future__ import annotations

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.check_values import differs, put_check
from qlinkgen.backends.c.names import Names, unsigned_type
from qlinkgen.backends.c.places import any_of, in_hex, sender_of
from qlinkgen.backends.c.views import PlaceView
from qlinkgen.model.integer import Chunk
from qlinkgen.plan.ends import ByMark
from qlinkgen.plan.parts import MarkPart
from qlinkgen.plan.tree import MessagePlan, Plan


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkedView:
    """Variables of the templates of marked frames."""

    marker: str
    address_mask: str
    head_byte: str
    end_byte: str
    id_of_byte: str
    address_of_byte: str
    end_id: str
    check_size: int
    put_check: list[str]
    check_differs: str
    buffer_size: int
    count_type: str


@dataclass(frozen=True, slots=True)
class Shape:
    """A message: whether it has a check value, and the condition for a legal ``count`` of bytes."""

    constant: str
    checked: str
    fits: str


@dataclass(frozen=True, slots=True)
class Shapes:
    """The messages of a direction."""

    direction: str
    messages: list[Shape]


#: One byte precedes the payload of a marked frame, and one follows it.
PLACE = PlaceView(tailed=False, tail=1, header=1, overhead=2)


def marked_view(plan: Plan) -> MarkedView:
    """The view of marked frames."""
    end, check = plan.frame.end, plan.frame.check
    assert isinstance(end, ByMark)
    assert end.end.end_id is not None
    header, size, sender = end.header, check.size if check else 0, sender_of(plan.frame, plan.protocol.name)
    most = plan.frame.max_payload + size
    return MarkedView(
        marker=in_hex(header.marker),
        address_mask=in_hex(header.address.mask << header.address.shift),
        head_byte=_byte(header, sender.address, sender.id),
        end_byte=_byte(header, sender.address, in_hex(end.end.end_id) if end.end.end_id else ""),
        id_of_byte=_taken(header.id),
        address_of_byte=_taken(header.address),
        end_id=in_hex(end.end.end_id),
        check_size=size,
        put_check=put_check(check, "end", 0, "value") if check else [],
        check_differs=differs(check, "end", 0, "value") if check else "",
        buffer_size=most,
        count_type=unsigned_type(max(8, most.bit_length())),
    )


def _byte(header: MarkPart, address: str, number: str) -> str:
    fields = [(address, header.address), *([(number, header.id)] if number else [])]
    return " | ".join([in_hex(header.marker), *(_placed(value, bits) for value, bits in fields)])


def _placed(value: str, bits: Chunk) -> str:
    return f"((unsigned){value} << {bits.shift})" if bits.shift else f"(unsigned){value}"


def _taken(bits: Chunk) -> str:
    shifted = f"((unsigned)byte >> {bits.shift})" if bits.shift else "byte"
    return f"(uint8_t)({shifted} & {in_hex(bits.mask)})"


def shape(names: Names, message: MessagePlan) -> Shape:
    """The view of a message for the receiver."""
    checked = "true" if message.checked else "false"
    return Shape(names.constant(message.message), checked, _fits(message))


def _fits(message: MessagePlan) -> str:
    more = message.envelope.check.size if message.envelope.check else 0
    payload = message.payload
    ranges = [(0, 0)] if payload.empty_is_default and payload.least else []
    ranges.append((payload.least, payload.most))
    return any_of([_within(least + more, most + more) for least, most in ranges])


def _within(least: int, most: int) -> str:
    if least == most:
        return f"count == {least}U"
    upper = f"count <= {most}U"
    return f"(count >= {least}U) && ({upper})" if least else upper
