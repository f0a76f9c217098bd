"""Frames that are wrong in one way each, and the word that every decoder has for it.

Only what every decoder must see alike is here. The kinds are those of decoding exactly one frame.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from qlinkgen.backends.vectors.reference import Good, Reference
from qlinkgen.model.frame import DelimitedFrame, Frame, MarkedFrame, PacketFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Blob, Scalar


@dataclass(frozen=True, slots=True)
class Bad:
    """One wrong frame."""

    kind: str
    what: str
    message: Message
    wire: bytes
    request: bytes = b""

    def entry(self) -> Mapping[str, Any]:
        """The line in the file."""
        request = {"request": self.request.hex()} if self.request else {}
        return {
            "kind": self.kind,
            "message": self.message.name,
            "what": self.what,
            "wire": self.wire.hex(),
            **request,
        }


def of_message(protocol: Protocol, reference: Reference, vectors: Mapping[str, Good]) -> Iterator[Bad]:
    """Faults of one message, made from its vectors by kind."""
    good = vectors["defaults"]
    yield from _out_of_range(reference, good)
    frame = protocol.frame
    if isinstance(frame, DelimitedFrame):
        yield from _delimited(frame, reference, vectors)
    elif isinstance(frame, MarkedFrame):
        yield from _marked(frame, reference, good)
    else:
        yield from _packet(frame, good)


def _out_of_range(reference: Reference, good: Good) -> Iterator[Bad]:
    """Each integer in front of the fields of variable size, one step past its range."""
    for field in good.message.fields:
        scalar, at = field.type, good.message.offset(field.name)
        if at is None:
            return
        if not isinstance(scalar, Scalar) or not scalar.settable or scalar.maximum == scalar.natural_maximum:
            continue
        number = scalar.maximum + 1
        patch = bytes(number >> chunk.shift & chunk.mask for chunk in scalar.chunks)
        payload = good.payload[:at] + patch + good.payload[at + len(patch) :]
        wire = reference.seal(good.message.name, payload, good.address or 0, good.request)
        yield Bad("range", f"{field.name} is {number}", good.message, wire, good.request)


def _unused_id(protocol: Protocol, message: Message, last: int, avoid: bytes = b"") -> int | None:
    both = (message.direction, "message")
    taken = {
        each.id for each in protocol.messages if message.direction == "message" or each.direction in both
    }
    return next(
        (number for number in range(1, last + 1) if number not in taken and number not in avoid), None
    )


# Frames between preamble and checksum


def _delimited(frame: DelimitedFrame, reference: Reference, vectors: Mapping[str, Good]) -> Iterator[Bad]:
    good = vectors["defaults"]
    message = good.message
    if frame.part("checksum") is not None and (wire := _bit_flipped(frame, good.wire)):
        yield Bad("crc", "a bit is flipped", message, wire)
    if frame.part("length") is not None:
        yield Bad("truncated", "the last two bytes are missing", message, good.wire[:-2])
        if message.fixed and message.max_size < frame.payload.max_size:
            wire = reference.seal(message.name, good.payload + b"\0", good.address or 0)
            yield Bad("length", "the payload has a byte too many", message, wire)
    # Without a preamble nothing but id and address tells a frame from noise.
    if frame.preamble and message.addresses and (outside := message.addresses[-1][1] + 1) <= 0xFF:
        yield Bad("range", f"sent to {outside}", message, reference.seal(message.name, good.payload, outside))
    stuffing = frame.stuffing
    if stuffing and not stuffing.before_checksum and (wire := _badly_stuffed(frame, vectors["a5"].wire)):
        yield Bad("stuffing", "an inserted byte is another one", message, wire)


def _bit_flipped(frame: DelimitedFrame, wire: bytes) -> bytes | None:
    """A bit of the last byte flipped, or of one in front of it where stuffing would be disturbed."""
    after = frame.stuffing.after if frame.stuffing else b""
    for at in range(len(wire) - 1, frame.header_size, -1):
        changed = wire[:at] + bytes([wire[at] ^ 1]) + wire[at + 1 :]
        if not after or (wire[at - 1] not in after and wire[at] not in after and changed[at] not in after):
            return changed
    return None


def _badly_stuffed(frame: DelimitedFrame, wire: bytes) -> bytes | None:
    assert frame.stuffing is not None
    at = wire.find(frame.stuffing.after + bytes([frame.stuffing.insert]), len(frame.preamble))
    if at < 0:
        return None
    place = at + len(frame.stuffing.after)
    return wire[:place] + bytes([frame.stuffing.insert ^ 1]) + wire[place + 1 :]


# Frames between marked bytes


def _marked(frame: MarkedFrame, reference: Reference, good: Good) -> Iterator[Bad]:
    wire, message = good.wire, good.message
    if frame.checksum is not None and message.checksum:
        yield Bad("crc", "a bit is flipped", message, wire[:-2] + bytes([wire[-2] ^ 1]) + wire[-1:])
    yield Bad("truncated", "the end is missing", message, wire[:-1])
    other = wire[-1] ^ 1 << frame.address_bits.shift
    yield Bad("frame", "the end has another address", message, wire[:-1] + bytes([other]))
    yield Bad(
        "frame",
        "the payload has a marked byte",
        message,
        wire[:1] + bytes([wire[1] | frame.marker]) + wire[2:],
    )
    if not any(isinstance(field.type, Blob) for field in message.fields):
        payload = good.payload + b"\0"
        yield Bad(
            "frame",
            "the payload has a byte too many",
            message,
            reference.seal(message.name, payload, good.address or 0),
        )


# Packets


def _packet(frame: PacketFrame, good: Good) -> Iterator[Bad]:
    message, wire = good.message, good.wire
    if message.direction == "request" or frame.checksum is None:
        return
    refusal = b""
    if frame.rejected is not None:
        refusal = bytes(frame.rejected >> chunk.shift & chunk.mask for chunk in frame.checksum.chunks)
    flipped = (wire[:-1] + bytes([wire[-1] ^ bit]) for bit in (1, 2))
    changed = next(each for each in flipped if not (refusal and each.endswith(refusal)))
    yield Bad("crc", "a bit is flipped", message, changed, good.request)
    if refusal and not wire.endswith(refusal):
        yield Bad("illegal", "the command is refused", message, good.payload + refusal, good.request)


def of_protocol(protocol: Protocol, reference: Reference, vectors: Mapping[str, Good]) -> Iterator[Bad]:
    """Faults that a protocol has once in each direction, made from a message's vectors by kind."""
    good, frame = vectors["defaults"], protocol.frame
    last = frame.id_bits.mask if isinstance(frame, MarkedFrame) else 0xFF
    stuffed = frame.stuffing.after if isinstance(frame, DelimitedFrame) and frame.stuffing else b""
    number = _unused_id(protocol, good.message, last, stuffed)
    if number is not None and _shows_id(frame, good.message):
        kind = "frame" if isinstance(frame, MarkedFrame) else "unknown"
        wire = reference.seal(good.message.name, good.payload, good.address or 0, good.request, number)
        yield Bad(kind, f"the id is {number:#04x}", good.message, wire, good.request)
    if isinstance(frame, DelimitedFrame):
        yield from _wrong_length(frame, good)


def _shows_id(frame: Frame, message: Message) -> bool:
    """An unknown id is seen to be one: the bytes are a frame beyond doubt, and carry an id at all."""
    if isinstance(frame, PacketFrame):
        return message.direction != "response"
    return not isinstance(frame, DelimitedFrame) or bool(frame.preamble)


def _wrong_length(frame: DelimitedFrame, good: Good) -> Iterator[Bad]:
    """Lengths that no frame can have; how long one can be that is stuffed first is not asked here."""
    part = frame.part("length")
    if part is None or part.scalar is None:
        return
    at, least, most = frame.offset(part.name), frame.payload.min_size, frame.payload.max_size
    claims = [frame.length_bias + least - 1]
    if frame.stuffing is None or not frame.stuffing.before_checksum:
        claims.append(frame.length_bias + most + 1)
    for claimed in claims:
        if 0 <= claimed <= part.scalar.maximum:
            patch = bytes(claimed >> chunk.shift & chunk.mask for chunk in part.scalar.chunks)
            wire = good.wire[:at] + patch + good.wire[at + part.size :]
            yield Bad("length", f"the length is {claimed}", good.message, wire)
