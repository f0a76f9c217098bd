"""Hypothesis strategies from the model: legal values of any field, and the fields of any message.

Values are native, as described in qlinkgen.model.values: those of generated Python and construct.
"""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from qlinkgen.model.frame import DelimitedFrame
from qlinkgen.model.message import Message, Value
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Array, Blob, Enum, Flags, Scalar
from qlinkgen.model.values import native_from_raw


def raw_values(scalar: Scalar) -> st.SearchStrategy[int]:
    """Legal raw integers, including bounds and bytes that are critical in frames."""
    if isinstance(scalar.meaning, Flags) and scalar.meaning.reserved_zero:
        bits = [1 << member.value for member in scalar.meaning.members]
        return st.lists(st.sampled_from(bits), unique=True).map(sum)
    likely = [scalar.minimum, scalar.maximum, scalar.default, 0, 1, -1]
    likely += [
        int.from_bytes(bytes((byte,)) * 8, "big") & ((1 << scalar.bits) - 1) for byte in (0xA5, 0x7E, 0xFF)
    ]
    if isinstance(scalar.meaning, Enum):
        likely += [member.value for member in scalar.meaning.members]
    known = sorted({value for value in likely if scalar.minimum <= value <= scalar.maximum})
    return st.one_of(st.sampled_from(known), st.integers(scalar.minimum, scalar.maximum))


def native_values(value: Value) -> st.SearchStrategy[Any]:
    """Legal values of a field."""
    kind = value.type
    if isinstance(kind, Array):
        item, length = raw_values(kind.item), kind.length
        return st.lists(item, min_size=length.minimum, max_size=length.maximum)
    if isinstance(kind, Blob):
        return texts(kind) if kind.text else octets(kind)
    assert isinstance(kind, Scalar)
    return raw_values(kind).map(lambda raw: native_from_raw(kind, raw))


def texts(kind: Blob) -> st.SearchStrategy[str]:
    """Text of seven-bit characters, control characters included."""
    characters = st.characters(max_codepoint=0x7F)
    return st.text(characters, min_size=kind.length.minimum, max_size=kind.length.maximum)


def octets(kind: Blob) -> st.SearchStrategy[bytes]:
    """Byte strings, often with bytes that are critical in frames."""
    byte = st.one_of(st.sampled_from([0xA5, 0x00, 0xFF, 0xFD, 0x7E]), st.integers(0, 255))
    return st.lists(byte, min_size=kind.length.minimum, max_size=kind.length.maximum).map(bytes)


def fields(message: Message) -> st.SearchStrategy[dict[str, Any]]:
    """Legal values of every field of a message, by name."""
    return st.fixed_dictionaries({value.name: native_values(value) for value in message.values})


def addresses(message: Message) -> st.SearchStrategy[int]:
    """Legal addresses of a message."""
    return st.one_of(*(st.integers(low, high) for low, high in message.addresses))


#: By identity of protocol and message, which are kept with the strategy: making one takes longer than a draw.
_known: dict[tuple[int, int], tuple[Protocol, Message, st.SearchStrategy[dict[str, Any]]]] = {}


def arguments(protocol: Protocol, message: Message) -> st.SearchStrategy[dict[str, Any]]:
    """Fields and address of a message, as arguments of its generated class."""
    found = _known.get((id(protocol), id(message)))
    if found is None:
        found = _known[id(protocol), id(message)] = protocol, message, _arguments(protocol, message)
    return found[2]


def _arguments(protocol: Protocol, message: Message) -> st.SearchStrategy[dict[str, Any]]:
    if not message.addresses or protocol.address_name is None:
        return fields(message)
    address = st.fixed_dictionaries({protocol.address_name: addresses(message)})
    return st.tuples(fields(message), address).map(lambda both: both[0] | both[1])


def messages(protocol: Protocol, direction: str = "") -> st.SearchStrategy[tuple[Message, dict[str, Any]]]:
    """Any message of a direction (default: all) with its arguments."""
    chosen = [m for m in protocol.messages if not direction or m.direction in (direction, "message")]
    return st.sampled_from(chosen).flatmap(lambda m: st.tuples(st.just(m), arguments(protocol, m)))


def junk(protocol: Protocol) -> st.SearchStrategy[bytes]:
    """Bytes, many of them significant in frames of the protocol."""
    special = [0x00, 0x01, 0x04, 0xFF]
    special += [message.id for message in protocol.messages if message.id < 256][:20]
    frame = protocol.frame
    if isinstance(frame, DelimitedFrame):
        special += [*frame.preamble, *(frame.stuffing.after if frame.stuffing else b"")]
        special += [frame.stuffing.insert] if frame.stuffing else []
    byte = st.one_of(st.sampled_from(sorted(set(special))), st.integers(0, 255))
    return st.lists(byte, max_size=80).map(bytes)
