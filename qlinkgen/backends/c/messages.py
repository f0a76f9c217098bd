"""Everything that a header says of one message, as strings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from qlinkgen.backends import c_text
from qlinkgen.backends.c.decode import Decoder
from qlinkgen.backends.c.describe import field_rows, member_note, message_head
from qlinkgen.backends.c.encode import Encoder, count_member, size_terms
from qlinkgen.backends.c.framing import struct_parameter
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import (
    Names,
    bracketed,
    count_type,
    integer_type,
    scalar_literal,
    scalar_type,
    storage,
    unsigned,
)
from qlinkgen.model import sizes
from qlinkgen.model.message import Field, Message, Value
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Array, Bits, Blob, Scalar


@dataclass(frozen=True, slots=True)
class Member:
    """One line of a struct."""

    declaration: str
    note: str


class MessageWriter:
    """Lowers messages to what the template places."""

    def __init__(self, protocol: Protocol, names: Names, layouts: Layouts) -> None:
        """Names and layouts are shared by the whole header."""
        self._protocol = protocol
        self._names = names
        self._layouts = layouts

    def render(self, message: Message, *, encoded: bool, decoded: bool) -> dict[str, Any]:
        """The message for the template; only the directions that are kept have statements."""
        frame, head = self._protocol.frame, message_head(self._names.command_of(message), message)
        return {
            "name": message.name,
            "stem": self._names.stem(message),
            "function": self._names.function(message),
            "constant": self._names.constant(message),
            "head": head,
            "rows": field_rows(message),
            "id_text": f"0x{message.id:02X}",
            "min_size": message.min_size,
            "max_size": message.max_size,
            "max_frame_size": sizes.max_frame_size(frame, message),
            "max_wire_size": sizes.max_wire_size(frame, message),
            "has_struct": bool(message.values),
            "has_bytes": bool(message.fields),
            "members": [member for value in message.values for member in _members(value)],
            "initialiser": ", ".join(_initialiser(value) for value in message.values),
            "size_terms": size_terms(message) if message.variable else "",
            "encode": self._encode(message) if encoded else None,
            "decode": self._decode(message) if decoded else None,
            "scales": [scale for value in message.values if (scale := self._scale(message, value))],
            "early_id": False,
            "encode_parameters": struct_parameter(self._names, message, const=True),
            "decode_parameters": struct_parameter(self._names, message, const=False),
            "encoded_size": "(int)size"
            if message.variable
            else f"(int){self._names.constant(message)}_MAX_SIZE",
            "size_text": _size_text(message),
            "comment_ends_at_head": not message.fields and len(head) == 1,
            "to_frame": None,
            "from_frame": None,
        }

    def _encode(self, message: Message) -> dict[str, Any]:
        encoder = Encoder(message, self._names.prefix, self._layouts)
        statements = encoder.statements()
        return {
            "lines": statements,
            "counts": encoder.counts,
            "place": encoder.uses_place,
            "variable": bool(message.variable),
        }

    def _decode(self, message: Message) -> dict[str, Any]:
        decoder = Decoder(message, self._names.prefix, self._layouts)
        statements = decoder.statements()
        return {
            "lines": statements,
            "place": decoder.uses_place,
            "counters": decoder.counters,
            "rest": decoder.uses_rest,
            "empty_is_default": message.empty_is_default and message.min_size > 0,
            "defaults": self._defaults(message),
            "reads": decoder.reads,
        }

    def _defaults(self, message: Message) -> list[str]:
        """Statements that set a message to its defaults; only a list of items is copied as a whole."""
        lines = []
        for value in message.values:
            kind = value.type
            if isinstance(kind, Scalar):
                lines.append(f"message->{value.name} = {scalar_literal(kind, kind.default)};")
            elif kind.length.fixed or kind.default:
                kind_of_all, defaults = self._names.function(message), self._names.constant(message)
                return [f"const {kind_of_all}_t defaults = {defaults}_INIT;", "*message = defaults;"]
            else:
                lines.append(f"message->{count_member(value.field)} = 0U;")
        return lines

    def _scale(self, message: Message, value: Value) -> dict[str, Any] | None:
        scalar = value.type
        if not isinstance(scalar, Scalar) or scalar.scaling is None:
            return None
        return {
            "constant": f"{self._names.constant(message)}_{value.name.upper()}",
            "function": f"{self._names.function(message)}_{value.name}",
            "type": scalar_type(scalar),
            "helper": scalar_type(scalar).removesuffix("_t"),
            "text": c_text.comment_line(f"{value.name} = (raw * FACTOR + BIAS) / DIVISOR {scalar.unit}"),
            "factor": _whole(scalar.scaling.factor),
            "bias": _whole(scalar.scaling.bias),
            "divisor": _whole(scalar.scaling.divisor),
            "minimum": scalar_literal(scalar, scalar.minimum),
            "maximum": scalar_literal(scalar, scalar.maximum),
        }


def _whole(value: int) -> str:
    """An integer constant of the least type that holds it everywhere."""
    size = abs(value).bit_length()
    suffix = "" if size < 16 else "L" if size < 32 else "LL" if size < 64 else "ULL"
    return bracketed(f"{value}{suffix}")


def _members(value: Value) -> list[Member]:
    kind, note = value.type, member_note(value)
    if isinstance(kind, Scalar):
        return [Member(f"{scalar_type(kind)} {value.name};", note)]
    item = integer_type(kind.item.bits, signed=kind.item.signed) if isinstance(kind, Array) else "uint8_t"
    most = kind.length.maximum
    members = [Member(f"{item} {value.name}[{most}];", note)]
    if not kind.length.fixed:
        what = "items" if isinstance(kind, Array) else "bytes"
        number = Member(f"{count_type(most)} {count_member(value.field)};", f"{what} in {value.name}")
        members.insert(0, number)
    return members


def _initialiser(value: Value) -> str:
    kind = value.type
    if isinstance(kind, Scalar):
        return scalar_literal(kind, kind.default)
    items = (
        [scalar_literal(kind.item, item) for item in kind.default]
        if isinstance(kind, Array)
        else _bytes(kind)
    )
    zero = not any(kind.default)
    content = "{0}" if zero else f"{{{', '.join(items)}}}"
    return content if kind.length.fixed else f"{len(items)}U, {content}"


def _bytes(kind: Blob) -> list[str]:
    return [unsigned(byte, 8, hexadecimal=True) for byte in kind.default]


def _size_text(message: Message) -> str:
    least, most = message.min_size, message.max_size
    return f"{most} byte{'s' if most > 1 else ''}" if least == most else f"{least}..{most} bytes"


def extended_widths(messages: tuple[Message, ...]) -> list[int]:
    """Widths of the C types of signed integers that the wire has fewer bits for."""
    found = {
        storage(scalar.bits)
        for message in messages
        for each in message.fields
        for scalar in _scalars(each)
        if scalar.signed and scalar.bits != storage(scalar.bits)
    }
    return sorted(found)


def _scalars(each: Field) -> list[Scalar]:
    kind = each.type
    if isinstance(kind, Bits):
        return [member.type for member in kind.members]
    return [kind] if isinstance(kind, Scalar) else [kind.item] if isinstance(kind, Array) else []


def nearest_helpers(messages: tuple[Message, ...]) -> list[dict[str, str]]:
    """The C types that physical values are rounded to."""
    types = {
        scalar_type(value.type): None
        for message in messages
        for value in message.values
        if isinstance(value.type, Scalar) and value.type.scaling
    }
    return [
        {
            "name": kind.removesuffix("_t"),
            "type": kind,
            "zero": "0U" if kind.startswith("u") else "0",
            "one": "1U" if kind.startswith("u") else "1",
        }
        for kind in types
    ]
