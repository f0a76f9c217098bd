"""Whether a payload is one that a message can have: simple, slow, straight from the model."""

from __future__ import annotations

from qlinkgen.model.message import Message
from qlinkgen.model.types import Array, Bits, Blob, Flags, Scalar


class Wrong(Exception):
    """The payload is not right; the argument is the kind of fault."""


def payload_fault(message: Message, payload: bytes) -> str | None:
    """ "length", "range" or None."""
    if not payload and message.empty_is_default:
        return None
    try:
        _read(message, payload)
    except Wrong as fault:
        return str(fault)
    return None


def raw_of(scalar: Scalar, data: bytes) -> int:
    """The integer that bytes carry."""
    raw = 0
    for byte, chunk in zip(data, scalar.chunks, strict=True):
        if byte & ~chunk.mask:
            raise Wrong("range")
        raw |= byte << chunk.shift
    return raw - (1 << scalar.bits) if scalar.signed and raw >> (scalar.bits - 1) else raw


def _read(message: Message, payload: bytes) -> None:
    counts = _counts(message, payload)
    at = 0
    for field in message.fields:
        kind = field.type
        size = kind.size if isinstance(kind, Scalar | Bits) else counts[field.name] * kind.item_size
        _check(kind, payload[at : at + size])
        at += size


def _counts(message: Message, payload: bytes) -> dict[str, int]:
    """Items of every array, byte string and text; what the counts in the payload say must fit its size."""
    if not message.min_size <= len(payload) <= message.max_size:
        raise Wrong("length")
    counts: dict[str, int] = {}
    at = 0
    for field in message.fields:
        kind = field.type
        if isinstance(kind, Scalar) and kind.counts:
            counted = next(other for other in message.fields if other.name == kind.counts)
            assert isinstance(counted.type, Array | Blob)
            raw, unit = (
                raw_of(kind, payload[at : at + kind.size]),
                counted.type.item_size if kind.counts_unit == "bytes" else 1,
            )
            items = raw // unit
            if raw % unit or counts.setdefault(kind.counts, items) != items:
                raise Wrong("length")
        if isinstance(kind, Array | Blob):
            if field.name not in counts:
                counts[field.name] = (
                    kind.length.maximum if kind.length.fixed else _rest(message, payload, counts, field.name)
                )
            if not kind.length.minimum <= counts[field.name] <= kind.length.maximum:
                raise Wrong("length")
            at += counts[field.name] * kind.item_size
        else:
            at += kind.size
        if at > len(payload):
            raise Wrong("length")
    if at != len(payload):
        raise Wrong("length")
    return counts


def _rest(message: Message, payload: bytes, counts: dict[str, int], name: str) -> int:
    others = 0
    step = 1
    for field in message.fields:
        if isinstance(field.type, Scalar | Bits):
            others += field.type.size
        elif field.name == name:
            step = field.type.item_size
        else:
            number = field.type.length.maximum if field.fixed else counts[field.name]
            others += number * field.type.item_size
    left = len(payload) - others
    if left < 0 or left % step:
        raise Wrong("length")
    return left // step


def _check(kind: Scalar | Bits | Blob | Array, data: bytes) -> None:
    if isinstance(kind, Blob):
        if kind.text and any(byte > 0x7F for byte in data):
            raise Wrong("range")
    elif isinstance(kind, Array):
        for at in range(0, len(data), kind.item_size):
            _check_scalar(kind.item, raw_of(kind.item, data[at : at + kind.item_size]))
    elif isinstance(kind, Bits):
        container = raw_of(kind.container, data)
        for member in kind.members:
            raw = container >> member.shift & ((1 << member.type.bits) - 1)
            signed = member.type.signed and raw >> (member.type.bits - 1)
            _check_scalar(member.type, raw - (1 << member.type.bits) if signed else raw)
    elif not kind.reserved and not kind.counts:
        _check_scalar(kind, raw_of(kind, data))


def _check_scalar(scalar: Scalar, raw: int) -> None:
    if scalar.reserved:
        return
    if not scalar.minimum <= raw <= scalar.maximum or (scalar.constant and raw != scalar.default):
        raise Wrong("range")
    if scalar.meaning == "bool" and raw > 1:
        raise Wrong("range")
    flags = scalar.meaning
    if isinstance(flags, Flags) and flags.reserved_zero and raw & ~flags.mask:
        raise Wrong("range")
