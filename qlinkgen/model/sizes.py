"""Bytes on the wire: of a message in its frame, before and after worst-case stuffing."""

from __future__ import annotations

from typing import assert_never

from qlinkgen.model.frame import DelimitedFrame, Frame, MarkedFrame, PacketFrame, Part
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol


def frame_size(frame: Frame, message: Message, payload: int) -> int:
    """Bytes of a frame with ``payload`` payload bytes, before stuffing."""
    match frame:
        case DelimitedFrame():
            return frame.overhead + payload
        case MarkedFrame():
            return 2 + payload + _check_size(frame, message)
        case PacketFrame():
            return payload + (_check_size(frame, message) if message.direction == "response" else 1)
        case _:
            assert_never(frame)


def _check_size(frame: MarkedFrame | PacketFrame, message: Message) -> int:
    return len(frame.checksum.chunks) if frame.checksum and message.checksum else 0


def max_frame_size(frame: Frame, message: Message) -> int:
    """Most bytes of a message's frame, before stuffing."""
    return frame_size(frame, message, message.max_size)


def max_wire_size(frame: Frame, message: Message) -> int:
    """Most bytes that a message can take on the wire, stuffing included."""
    size = max_frame_size(frame, message)
    if not isinstance(frame, DelimitedFrame) or frame.stuffing is None:
        return size
    stuffing = frame.stuffing
    if stuffing.before_checksum:
        return size + message.max_size // len(stuffing.after)
    open_bytes = sum(
        _stuffable(frame, part, message) for part in frame.parts if part.name not in stuffing.exempt
    )
    return size + open_bytes // len(stuffing.after)


def _stuffable(frame: DelimitedFrame, part: Part, message: Message) -> int:
    """Bytes of a part that may be the stuffed byte; a value's known range leaves many of them out."""
    assert frame.stuffing is not None
    if part.role == "payload":
        return message.max_size
    if part.scalar is None or part.scalar.size > 1 or len(frame.stuffing.after) > 1:
        return part.size
    ranges = {
        "length": ((message.min_size + frame.length_bias, message.max_size + frame.length_bias),),
        "message": ((message.id, message.id),),
        "address": message.addresses,
    }[part.role]
    return int(any(first <= frame.stuffing.after[0] <= last for first, last in ranges))


def max_payload(protocol: Protocol) -> int:
    """Most payload bytes that the frame of a protocol allows."""
    frame = protocol.frame
    match frame:
        case DelimitedFrame():
            return frame.payload.max_size
        case MarkedFrame() | PacketFrame():
            return frame.payload_max
        case _:
            assert_never(frame)


def protocol_max_wire_size(protocol: Protocol) -> int:
    """Most bytes that any message of a protocol can take on the wire."""
    return max(max_wire_size(protocol.frame, message) for message in protocol.messages)
