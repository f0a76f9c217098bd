"""Names and values of the spans of a frame as text."""

from __future__ import annotations

from typing import assert_never

from qlinkgen.model.digits import Digits
from qlinkgen.plan.content import unpack_items
from qlinkgen.plan.describe import digits_text, filled_number, id_text, part_text, unread_text, value_text
from qlinkgen.plan.parts import (
    AddressPart,
    BlocksPart,
    CellPart,
    CheckPart,
    ConstantPart,
    EqualPart,
    IdPart,
    LengthPart,
    MarkPart,
    Part,
    PayloadPart,
)
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ConstantStep,
    CountStep,
    FilledStep,
    ItemsStep,
    Member,
    RecordsStep,
    RecordStep,
    ReservedStep,
    Step,
    ValueStep,
    value_name,
)
from qlinkgen.plan.spans import Around, Dissection, Span

_AROUND = {
    Around.BEFORE: ("(noise)", "before the frame"),
    Around.LOST: ("(preamble)", "rest of the preamble"),
    Around.INSERTED: ("(stuffing)", "inserted"),
    Around.UNCLEAR: ("(coded)", "cannot be decoded"),
    Around.SEPARATOR: ("(separator)", ""),
    Around.EXTRA: ("(extra)", "outside all fields"),
    Around.NEXT: ("(next frame)", "begins inside this one"),
    Around.AFTER: ("(after)", "not part of the frame"),
}


def value_of(found: Dissection, span: Span) -> tuple[str, str]:
    """Return the name of a span and its value."""
    of = span.of
    if isinstance(of, Around):
        return _AROUND[of]
    name = span.inside + (of.name if isinstance(of, Part) else value_name(of))
    # Other fields lack only zeros that were not sent.
    short = len(span.raw) < span.size and (isinstance(of, Part) or span.fault in ("length", "truncated"))
    if short:
        return name, f"{len(span.raw)} of {span.size} bytes received"
    if isinstance(of, Part):
        return name, _of_part(found, of, span)
    return name, _of_field(of, span)


def _of_part(found: Dissection, part: Part, span: Span) -> str:
    match part:
        case ConstantPart():
            first = part is found.frame.envelope.parts[0]
            return f"must be {part.data.hex(' ')}" if span.fault else "preamble" if first else ""
        case AddressPart(digits=Digits() as digits) if span.fault and span.number is None:
            return f"must be {digits_text(digits)}"
        case LengthPart() | AddressPart():
            return str(span.number)
        case IdPart():
            return _id(found)
        case CellPart() | EqualPart():
            return f"0x{span.number or 0:0{2 * part.size}X}, {part_text(part, found.frame)}"
        case MarkPart():
            return _mark(found, part, span)
        case PayloadPart():
            return "payload of an unknown message"
        case CheckPart():
            return _check(found, part, span)
        case BlocksPart():
            return "wrong" if span.fault else "right" if part.name not in found.expected else ""
        case _:
            assert_never(part)


def _of_field(field: Step | Member, span: Span) -> str:
    number, raw = span.number or 0, span.raw.ljust(span.size, b"\0")
    match field:
        case ConstantStep() | ReservedStep() | ValueStep() | Member():
            return (span.fault and unread_text(field, span.raw)) or value_text(field.number, number)
        case CountStep():
            return str(number)
        case FilledStep():
            return f"{filled_number(field, number)}{'' if span.fault else ', right'}"
        case BitsStep():
            return f"0x{number & field.integer.mask:0{2 * field.integer.size}X}"
        case BytesStep():
            text = repr(field.stripped(raw).decode("ascii", "backslashreplace"))
            return text if field.text else f"{len(raw)} bytes"
        case ItemsStep() if field.between:
            unread = unread_text(field, span.raw) if span.fault else ""
            return unread or value_text(field.number, field.item.unpack(raw))
        case ItemsStep():
            number = number if field.packed else len(raw) // field.item_size
            return ", ".join(map(str, unpack_items(field, raw, number)))
        case RecordStep() | RecordsStep():
            return f"{len(raw)} bytes"
        case _:
            assert_never(field)


def _id(found: Dissection) -> str:
    number = found.number or 0
    messages = [message for message in found.plan.messages if message.id == number]
    names = dict.fromkeys(message.message.command for message in messages)
    return f"{id_text(found.frame, number)} ({', '.join(names) or 'unknown'})"


def _mark(found: Dissection, part: MarkPart, span: Span) -> str:
    byte = span.raw[0]
    address = f"{part.address_name} {part.address_of(byte)}"
    if part.end_id is not None:
        return address
    name = f" ({found.message.name})" if found.message else ""
    return f"{address}, {part.id_name} {part.id_of(byte)}{name}"


def _check(found: Dissection, part: CheckPart, span: Span) -> str:
    received = check_number(part, span.number or 0)
    if part.name not in found.expected:
        return f"{received}, not checked"
    if span.fault:
        return f"{received}, computed {check_number(part, found.expected[part.name])}"
    return f"{received}, right" + ("" if part.check.complete else " (the bits that are sent)")


def check_number(part: CheckPart | BlocksPart, value: int) -> str:
    """Return a check value in hex, with all digits of its width."""
    return f"0x{value:0{(part.check.algorithm.width + 3) // 4}X}"
