"""Packets: no frame at all, an answer is checked over the request it belongs to."""

from __future__ import annotations

from typing import Any

from qlinkgen.backends.c.delimited import differs
from qlinkgen.backends.c.framing import struct_parameter
from qlinkgen.backends.c.names import Names, grouped, unsigned, unsigned_type
from qlinkgen.errors import GenerationError
from qlinkgen.model.checksum import Sum
from qlinkgen.model.frame import Checksum, PacketFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol


def packet_view(protocol: Protocol, frame: PacketFrame) -> dict[str, Any]:
    """What the templates of packets place."""
    prefix = protocol.name
    view: dict[str, Any] = {
        "address": "",
        "id": "id",
        "id_type": "uint8_t",
        "needs_direction": False,
        "reports_runs": False,
        "needs_extent": False,
        "buffer_size": max(1, frame.payload_max),
        "reject": f"{prefix}_reject_" if frame.rejected is not None and frame.checksum else "",
        "has_check": frame.checksum is not None,
        "slave_arguments": f"{prefix}_frame_sum(frame), " if frame.checksum else "",
        "check_name": "request_check",
        "count_type": unsigned_type(max(8, frame.payload_max.bit_length())),
    }
    return view | (_check(frame, frame.checksum) if frame.checksum else {})


def _check(frame: PacketFrame, checksum: Checksum) -> dict[str, Any]:
    algorithm, chunks = checksum.algorithm, checksum.chunks
    if not isinstance(algorithm, Sum):
        raise GenerationError(f"{algorithm.name}: the check value of a packet is a sum")
    kind = unsigned_type(algorithm.width)
    rejected = frame.rejected
    return {
        "sum_type": kind,
        "word_type": unsigned_type(max(algorithm.width, 8 * frame.word_size)),
        "word_size": frame.word_size,
        "finished": f"({kind})~sum" if algorithm.complement else "sum",
        "check_size": len(chunks),
        "put_check": [
            f"{_byte(index)} = (uint8_t)({f'value >> {chunk.shift}' if chunk.shift else 'value'});"
            for index, chunk in enumerate(chunks)
        ],
        "check_differs": differs(checksum, "end", 0, "value"),
        "has_rejected": rejected is not None,
        "rejected": unsigned(rejected or 0, algorithm.width),
        "refused": differs(checksum, "end", 0, "refused"),
    }


def _byte(index: int) -> str:
    return f"end[{index}]"


def packet_from_frame(names: Names, message: Message, view: dict[str, Any]) -> dict[str, Any]:
    """The function that takes an answer apart."""
    struct = struct_parameter(names, message, const=False)
    parameters = struct + (f"{view['sum_type']} request_sum, " if view["has_check"] else "")
    lines = []
    if view["has_check"]:
        check = f"{names.prefix}_open_(request_sum, wire, size, {names.constant(message)}_MIN_SIZE)"
        lines += [
            f"const int status = {check};",
            f"if (status != {names.upper}_OK) {{",
            "    return status;",
            "}",
        ]
        payload_size = f"size - {view['check_size']}U"
    else:
        payload_size = "size"
    if message.fields:
        call = "message, " if struct else ""
        lines.append(f"return {names.function(message)}_decode({call}wire, {payload_size});")
    else:
        lines += [] if view["has_check"] else ["(void)wire;"]
        lines.append(
            f"return ({grouped(payload_size)} == 0U) ? {names.upper}_OK : {names.upper}_ERROR_LENGTH;"
        )
    return {"parameters": parameters, "lines": lines}


def sizes_by_value(names: Names, messages: tuple[Message, ...]) -> list[dict[str, Any]]:
    """Requests grouped by the size of their payload."""
    groups: dict[int, list[str]] = {}
    for message in messages:
        if not message.fixed:
            raise GenerationError(
                f"{message.name}: a packet of variable size has no end that a slave could find"
            )
        groups.setdefault(message.max_size, []).append(names.constant(message))
    return [{"size": size, "constants": constants} for size, constants in sorted(groups.items())]
