"""Marked frames: header and end byte carry a bit that no byte between them has."""

from __future__ import annotations

from typing import Any

from qlinkgen.backends.c.delimited import differs
from qlinkgen.backends.c.names import Names, unsigned, unsigned_type
from qlinkgen.model import sizes
from qlinkgen.model.frame import MarkedFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Chunk


def marked_view(protocol: Protocol, frame: MarkedFrame) -> dict[str, Any]:
    """What the templates of marked frames place."""
    check = len(frame.checksum.chunks) if frame.checksum else 0
    directed = len(protocol.directions) > 1
    prefix = protocol.name
    return {
        "address": frame.address_name,
        "address_type": "uint8_t",
        "id": "id",
        "id_type": "uint8_t",
        "parameters": f"uint8_t id, uint8_t {frame.address_name}",
        "arguments": f"id, {frame.address_name}",
        "tailed": False,
        "header": 1,
        "overhead": 2,
        "seal_checked": bool(check),
        "needs_direction": directed,
        "reports_runs": False,
        "needs_extent": False,
        "scan_direction": f"{prefix}_direction_t direction, " if directed else "",
        "init_direction": f", {prefix}_direction_t direction" if directed else "",
        "pass_direction": "receiver->direction, " if directed else "",
        "fit_direction": "direction, " if directed else "",
        "marker": _byte(frame.marker),
        "address_mask": _byte(frame.address_bits.mask << frame.address_bits.shift),
        "head_byte": _head(frame, "id"),
        "end_byte": _head(frame, _byte(frame.end_id)),
        "id_of_byte": _taken("byte", frame.id_bits),
        "address_of_byte": _taken("byte", frame.address_bits),
        "end_id": _byte(frame.end_id),
        "check_size": check,
        "put_check": _put_check(frame),
        "check_differs": differs(frame.checksum, "end", 0, "value") if frame.checksum else "",
        "check_differs_buffer": differs(frame.checksum, "check", 0, "value") if frame.checksum else "",
        "buffer_size": frame.payload_max + check,
        "count_type": unsigned_type(max(8, (frame.payload_max + check).bit_length())),
        "max_wire": sizes.protocol_max_wire_size(protocol),
        "check_name": "message_check" if not directed else "request_check or _response_check",
    }


def _head(frame: MarkedFrame, message: str) -> str:
    address = _placed(frame.address_name, frame.address_bits)
    return " | ".join(
        part for part in (_byte(frame.marker), address, _placed(message, frame.id_bits)) if part
    )


def _placed(value: str, bits: Chunk) -> str:
    return (
        ""
        if value == "0x00U"
        else f"((unsigned){value} << {bits.shift})"
        if bits.shift
        else f"(unsigned){value}"
    )


def _taken(value: str, bits: Chunk) -> str:
    shifted = f"((unsigned){value} >> {bits.shift})" if bits.shift else value
    return f"(uint8_t)({shifted} & {_byte(bits.mask)})"


def _put_check(frame: MarkedFrame) -> list[str]:
    if frame.checksum is None:
        return []
    values = [f"(value >> {chunk.shift})" if chunk.shift else "value" for chunk in frame.checksum.chunks]
    masks = [_byte(chunk.mask) for chunk in frame.checksum.chunks]
    return [
        f"wire[at + {index}U] = (uint8_t)({value} & {mask});"
        for index, (value, mask) in enumerate(zip(values, masks, strict=True))
    ]


def shapes(names: Names, messages: tuple[Message, ...], frame: MarkedFrame) -> list[dict[str, Any]]:
    """Fewest and most bytes of each message, and whether it carries a check value."""
    return [
        {
            "constant": names.constant(message),
            "least": f"{0 if message.empty_is_default else message.min_size}U",
            "most": f"{message.max_size}U",
            "checked": "true" if message.checksum and frame.checksum else "false",
        }
        for message in messages
    ]


def _byte(value: int) -> str:
    return unsigned(value, 8, hexadecimal=True)
