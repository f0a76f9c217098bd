"""The model in words: types, ranges, times, checksums, as `show` and `explain` print them."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

from qlinkgen.model.frame import Checksum, DelimitedFrame, MarkedFrame, Part, Stuffing
from qlinkgen.model.message import Field, Message, Value
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Allowance, Command
from qlinkgen.model.types import Array, Bits, Blob, Enum, FieldType, Flags, Length, Number, Scalar
from qlinkgen.model.values import default_of, to_json

ADDRESSING = {
    "node": "one node",
    "broadcast": "broadcast only",
    "either": "one node or broadcast",
    "answered_broadcast": "one node, or an answered broadcast",
    "none": "",
}


def type_text(kind: FieldType) -> str:
    """A type as a schema would name it: u16, i32 little, text[1..256], u16[0..12]."""
    if isinstance(kind, Blob):
        return f"{'text' if kind.text else 'bytes'}[{length_text(kind.length)}]"
    if isinstance(kind, Array):
        return f"{_integer(kind.item)}[{length_text(kind.length)}]"
    if isinstance(kind, Bits):
        return f"{_integer(kind.container)} bits"
    if isinstance(kind.meaning, Enum | Flags):
        what = "enum" if isinstance(kind.meaning, Enum) else "flags"
        return f"{kind.meaning.name} ({what}, {_integer(kind)})"
    return "bool" if kind.meaning == "bool" else _integer(kind)


def _integer(scalar: Scalar) -> str:
    base = f"{'i' if scalar.signed else 'u'}{scalar.bits}"
    if scalar.size <= 1:
        return base
    if scalar.byteorder:
        return f"{base} {scalar.byteorder}"
    groups = " ".join(f"{chunk.shift}-{chunk.shift + chunk.bits - 1}" for chunk in scalar.chunks)
    return f"{base} in groups: bits {groups}"


def length_text(length: Length) -> str:
    """``4``, ``0..12``, or ``0..12, by count``."""
    span = span_text(length.minimum, length.maximum)
    return f"{span}, by {length.counted_by}" if length.counted_by else span


def span_text(low: object, high: object) -> str:
    """``low..high``, or one number where they are the same."""
    return str(low) if low == high else f"{low}..{high}"


def bytes_text(low: int, high: int) -> str:
    """``1 byte``, ``0..12 bytes``."""
    return f"{span_text(low, high)} byte{'' if low == high == 1 else 's'}"


def number_text(value: Number | Fraction) -> str:
    """A number without an exponent or needless digits."""
    if isinstance(value, Decimal):
        return f"{value:f}"
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def range_text(scalar: Scalar) -> str:
    """Legal values in the unit; "" for a bool, an enum or flags that may hold anything."""
    if scalar.constant:
        return f"always {number_text(scalar.physical(scalar.default))}"
    if scalar.reserved:
        return "reserved"
    if scalar.meaning is not None and scalar.full_range:
        return ""
    low, high = sorted((scalar.physical(scalar.minimum), scalar.physical(scalar.maximum)))
    return f"{number_text(low)}..{number_text(high)}"


def step_text(scalar: Scalar) -> str:
    """What one step is worth: ``1/10``, ``1/2^16``, with the offset if there is one."""
    if scalar.scaling is None:
        return ""
    scale, offset = scalar.scaling.scale, scalar.scaling.offset
    base = scale.denominator.bit_length() - 1
    power = base >= 8 and scale.denominator == 1 << base
    step = f"{scale.numerator}/2^{base}" if power else str(scale)
    return f"{step}, from {offset}" if offset else step


def default_text(value: Value) -> str:
    """The default as the command line takes it, or that there is none."""
    if value.required:
        return "required"
    shown = to_json(value, default_of(value))
    if isinstance(shown, list):
        return "none" if not shown else ",".join(map(str, shown))
    if isinstance(shown, bool):
        return str(shown).lower()
    return (shown or "empty") if isinstance(shown, str) else number_text(shown)


def size_text(field: Field) -> str:
    """Bytes of a field."""
    return span_text(field.min_size, field.max_size)


def id_text(message: Message, protocol: Protocol) -> str:
    """A message id as its frame carries it."""
    return str(message.id) if isinstance(protocol.frame, MarkedFrame) else f"0x{message.id:02X}"


def addresses_text(message: Message) -> str:
    """The addresses that a message may carry."""
    return ", ".join(span_text(first, last) for first, last in message.addresses)


def time_text(allowance: Allowance) -> str:
    """How long an answer may take."""
    parts = []
    if allowance.byte_times:
        parts.append(f"{number_text(allowance.byte_times)} byte times")
    if allowance.seconds:
        parts.append(f"{number_text(float(allowance.seconds * 1000))} ms")
    return " + ".join(parts)


def repeat_text(command: Command) -> str:
    """Whether a request may be sent again."""
    if command.repeat.counter:
        return f"by {command.repeat.counter}"
    return "safe" if command.repeat.safe else "unsafe"


def checksum_text(checksum: Checksum) -> str:
    """Algorithm and coverage."""
    return f"{checksum.algorithm.name} over {', '.join(checksum.over)}"


def stuffing_text(stuffing: Stuffing) -> str:
    """The rule of the stuffing in a sentence."""
    after, exempt = stuffing.after.hex(" ").upper(), ", ".join(stuffing.exempt)
    when = "before" if stuffing.before_checksum else "after"
    rule = f"a byte {stuffing.insert:02X} is inserted behind every {after}, {when} the checksum is computed"
    return f"{rule}; not in {exempt}" if exempt else rule


def part_text(part: Part, frame: DelimitedFrame) -> str:
    """What a part of a frame holds."""
    if part.role == "constant":
        return part.constant.hex(" ").upper()
    if part.role == "length":
        bias = f" + {frame.length_bias}" if frame.length_bias else ""
        return f"bytes of {', '.join(part.counts)} = payload{bias}"
    if part.checksum:
        return checksum_text(part.checksum)
    return {"message": "message id", "address": "address", "payload": "the message's fields"}[part.role]
