"""Comments: what a firmware engineer wants to know of a message without opening its specification."""

from __future__ import annotations

from fractions import Fraction

from qlinkgen.backends import c_text
from qlinkgen.model.message import Field, Message, Value
from qlinkgen.model.transaction import Command
from qlinkgen.model.types import (
    Array,
    Bits,
    Blob,
    Constant,
    Count,
    Enum,
    Flags,
    Reserved,
    Role,
    Scalar,
    Settable,
)

#: Characters of a line of a comment.
WIDTH = 100


def message_head(command: Command | None, message: Message) -> list[str]:
    """The first lines of a message's comment: name, id, section, purpose, warnings."""
    section = message.section or (command.section if command else "")
    doc = message.doc or (command.doc if command else "")
    title = f"{message.name}, id 0x{message.id:02X}" + (f" (section {section})" if section else "")
    lines = [title + (f": {doc}" if doc else "")]
    if not message.confirmed or (command and not command.confirmed):
        lines.append("NOT CONFIRMED: its source is weak; check it at the device.")
    if message.empty_is_default:
        lines.append("A payload of no bytes is decoded as the defaults.")
    return [piece for line in lines for piece in c_text.comment(line, WIDTH)]


def field_rows(message: Message) -> list[str]:
    """The layout: offset, type and name of each field, in wire order."""
    rows: list[tuple[str, str, str]] = []
    for field in message.fields:
        offset = message.offset(field.name)
        place = "..." if offset is None else str(offset)
        rows.append((place, _wire_type(field), field.name if not isinstance(field.type, Bits) else ""))
        if isinstance(field.type, Bits):
            rows += [
                ("", f"  bits {m.shift}..{m.shift + m.type.bits - 1}", m.name) for m in field.type.members
            ]
    width = max((len(kind) for _, kind, _ in rows), default=0)
    return [f"{place:>4}  {kind:<{width}}  {name}".rstrip() for place, kind, name in rows]


_ROLES: dict[type[Role], str] = {Settable: "", Constant: " const", Reserved: " reserved", Count: " count"}


def _wire_type(field: Field) -> str:
    kind = field.type
    if isinstance(kind, Blob):
        return f"{'text' if kind.text else 'bytes'}[{_length(kind)}]"
    if isinstance(kind, Array):
        return f"{_integer(kind.item)}[{_length(kind)}]{_order(kind.item)}"
    if isinstance(kind, Bits):
        return f"{_integer(kind.container)}{_order(kind.container)}"
    role = _ROLES[type(kind.role)]
    return f"{_integer(kind)}{_order(kind)}{role}"


def _length(kind: Blob | Array) -> str:
    length = kind.length
    return str(length.maximum) if length.minimum == length.maximum else f"{length.minimum}..{length.maximum}"


def _integer(scalar: Scalar) -> str:
    return f"{'i' if scalar.signed else 'u'}{scalar.bits}"


def _order(scalar: Scalar) -> str:
    if scalar.size == 1:
        return ""
    return {"big": " be", "little": " le", None: f" in {scalar.size} groups"}[scalar.byteorder]


def member_note(value: Value) -> str:
    """What stands behind a struct member: purpose, unit, range, meaning."""
    parts = [value.doc] if value.doc else []
    kind = value.type
    scalar = kind.item if isinstance(kind, Array) else kind
    if isinstance(scalar, Scalar):
        parts += _facts(scalar)
    elif scalar.text:
        parts.append("7-bit characters")
    if not value.field.confirmed:
        parts.append("not confirmed")
    return c_text.comment_line("; ".join(parts))


def _facts(scalar: Scalar) -> list[str]:
    facts = []
    if scalar.scaling:
        facts.append(
            f"in steps of {_number(scalar.scaling.scale)}{_unit(scalar)}{_offset(scalar.scaling.offset)}"
        )
    elif scalar.unit:
        facts.append(f"in {scalar.unit}")
    if not scalar.full_range and scalar.meaning != "bool":
        facts.append(f"{scalar.minimum}..{scalar.maximum}")
    if isinstance(scalar.meaning, Enum | Flags):
        facts.append(f"{'enum' if isinstance(scalar.meaning, Enum) else 'flags'} {scalar.meaning.name}")
    return facts


def _unit(scalar: Scalar) -> str:
    return f" {scalar.unit}" if scalar.unit else ""


def _offset(offset: Fraction) -> str:
    return f", 0 is {_number(offset)}" if offset else ""


def _number(value: Fraction) -> str:
    denominator = value.denominator
    if denominator > 1000 and denominator & (denominator - 1) == 0:
        return f"{value.numerator}/2^{denominator.bit_length() - 1}"
    return str(value)
