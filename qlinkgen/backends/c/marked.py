"""Frames whose header and end carry a bit that no byte between them has."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from qlinkgen.backends.c.names import Names, unsigned_type
from qlinkgen.backends.c.parts import any_of, differs, in_hex, put_check
from qlinkgen.backends.c.views import common_view
from qlinkgen.model.integer import Chunk
from qlinkgen.plan.framing import ByMark, MarkPart
from qlinkgen.plan.tree import MessagePlan, Plan


def marked_view(plan: Plan) -> dict[str, Any]:
    """What the templates of marked frames place."""
    end, check = plan.frame.end, plan.frame.check
    assert isinstance(end, ByMark)
    assert end.end.end_id is not None
    header, size = end.header, check.size if check else 0
    most = plan.frame.max_payload + size
    view = common_view(plan)
    return view | {
        "tailed": False,
        "header": 1,
        "overhead": 2,
        "seal_checked": bool(check),
        "marker": in_hex(header.marker),
        "address_mask": in_hex(header.address.mask << header.address.shift),
        "head_byte": _byte(header, view["address"], view["id"]),
        "end_byte": _byte(header, view["address"], in_hex(end.end.end_id) if end.end.end_id else ""),
        "id_of_byte": _taken(header.id),
        "address_of_byte": _taken(header.address),
        "end_id": in_hex(end.end.end_id),
        "check_size": size,
        "put_check": put_check(check, "end", 0, "value") if check else [],
        "check_differs": differs(check, "end", 0, "value") if check else "",
        "buffer_size": most,
        "count_type": unsigned_type(max(8, most.bit_length())),
    }


def _byte(header: MarkPart, address: str, number: str) -> str:
    fields = [(address, header.address), *([(number, header.id)] if number else [])]
    return " | ".join([in_hex(header.marker), *(_placed(value, bits) for value, bits in fields)])


def _placed(value: str, bits: Chunk) -> str:
    return f"((unsigned){value} << {bits.shift})" if bits.shift else f"(unsigned){value}"


def _taken(bits: Chunk) -> str:
    shifted = f"((unsigned)byte >> {bits.shift})" if bits.shift else "byte"
    return f"(uint8_t)({shifted} & {in_hex(bits.mask)})"


def shapes(names: Names, messages: Sequence[MessagePlan]) -> list[dict[str, Any]]:
    """For each message: whether a check value is sent, and whether ``count`` bytes are as many as it has."""
    return [
        {
            "constant": names.constant(message.message),
            "checked": "true" if message.checked else "false",
            "fits": _fits(message),
        }
        for message in messages
    ]


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
