"""Frames whose ends are marked by a bit, and bare packets, lowered for their templates."""

from __future__ import annotations

from typing import Any

from qlinkgen.backends.python.checks import check_bytes, checksum_definition
from qlinkgen.backends.python.place import in_hex
from qlinkgen.model.checksum import Sum
from qlinkgen.model.frame import MarkedFrame, PacketFrame
from qlinkgen.model.protocol import Protocol


def marked_model(protocol: Protocol) -> dict[str, Any]:
    """Numbers of a frame with a marked header and end."""
    frame = protocol.frame
    assert isinstance(frame, MarkedFrame)
    size = len(frame.checksum.chunks) if frame.checksum else 0
    model = {
        "address": frame.address_name,
        "default_address": protocol.bus.nodes[0] if protocol.bus.nodes else 0,
        "marker": in_hex(frame.marker),
        "address_shift": frame.address_bits.shift,
        "address_mask": in_hex(frame.address_bits.mask),
        "id_shift": frame.id_bits.shift,
        "id_mask": in_hex(frame.id_bits.mask),
        "end": frame.end_id,
        "most": frame.payload_max + size,
        "checksum": "",
    }
    if frame.checksum is None:
        return model
    return model | {
        "checksum": checksum_definition(frame.checksum),
        "check_size": size,
        "check_bytes": check_bytes(frame.checksum, "crc"),
        "checked_default": all(message.checksum for message in protocol.messages),
    }


def packet_model(protocol: Protocol, rows: dict[str, list[dict[str, str]]]) -> dict[str, Any]:
    """Numbers of bare packets; ``rows`` are ids and classes by direction."""
    frame = protocol.frame
    assert isinstance(frame, PacketFrame)
    model: dict[str, Any] = {
        "requests": rows["request"],
        "responses": rows["response"],
        "checksum": "",
        "rejected": "",
    }
    if frame.checksum is None:
        return model
    algorithm = frame.checksum.algorithm
    assert isinstance(algorithm, Sum)
    return model | {
        "checksum": algorithm.name,
        "check_mask": f"0x{algorithm.mask:X}",
        "check_size": len(frame.checksum.chunks),
        "check_bytes": check_bytes(frame.checksum, "check"),
        "word": frame.word_size,
        "total": "~total" if algorithm.complement else "total",
        "rejected": ""
        if frame.rejected is None
        else f"0x{frame.rejected:0{len(frame.checksum.chunks) * 2}X}",
    }
