"""Comments that describe messages, so that firmware can be written without the specification."""

from __future__ import annotations

from fractions import Fraction
from typing import assert_never

from qlinkgen.backends import c_text
from qlinkgen.model.digits import Digits
from qlinkgen.model.fields import Layout, Value
from qlinkgen.model.integer import Integer
from qlinkgen.model.message import Message
from qlinkgen.model.transaction import Command
from qlinkgen.model.types import Characters, Enum, Flags, Float, Length, Scalar
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ConstantStep,
    CountStep,
    Equal,
    FilledStep,
    Holder,
    ItemsStep,
    Member,
    PayloadPlan,
    RecordsStep,
    RecordStep,
    ReservedStep,
    Step,
    ValueStep,
)

#: Length of a comment line.
WIDTH = 100


def message_head(command: Command | None, message: Message) -> list[str]:
    """The first lines of the comment of a message: name, id, section, purpose, warnings."""
    section = message.section or (command.section if command else "")
    doc = message.doc or (command.doc if command else "")
    title = f"{message.name}, id 0x{message.id:02X}" + (f" (section {section})" if section else "")
    lines = [title + (f": {doc}" if doc else "")]
    if not message.confirmed or (command and not command.confirmed):
        lines.append("NOT CONFIRMED: its source is weak; check it on the device.")
    if message.empty_is_default:
        lines.append("An empty payload is decoded as the defaults.")
    return [piece for line in lines for piece in c_text.comment(line, WIDTH)]


def record_head(layout: Layout) -> list[str]:
    """The comment of a record, without its layout."""
    section = f" (section {layout.section})" if layout.section else ""
    doc = f": {layout.doc}" if layout.doc else ""
    return c_text.comment(f"Record {layout.name}{section}{doc}", WIDTH)


def field_rows(payload: PayloadPlan) -> list[str]:
    """The layout: offset, type and name of each field, in wire order."""
    rows: list[tuple[str, str, str]] = []
    moving = [step for segment in payload.segments[1:] for step in segment.steps]
    for step in payload.steps:
        offset = step.place.offset
        place = "..." if offset is None or step in moving else str(offset)
        if isinstance(step, BitsStep):
            rows.append((place, _wire_type(step), ""))
            rows += [("", f"  bits {m.shift}..{m.shift + m.bits - 1}", m.name) for m in step.members]
        else:
            rows.append((place, _wire_type(step), step.name))
    width = max((len(kind) for _, kind, _ in rows), default=0)
    return [f"{place:>4}  {kind:<{width}}  {name}".rstrip() for place, kind, name in rows]


def _wire_type(step: Step) -> str:
    match step:
        case BytesStep():
            pad = f" padded with {step.pad.hex().upper()}" if step.pad else ""
            end = f" ended by {step.terminator.hex().upper()}" if step.terminator else ""
            return f"{'text' if step.text else 'bytes'}[{_length(step.length)}]{pad}{end}"
        case ItemsStep():
            order = f" in a row, {step.packed} first" if step.packed else _order(step.item)
            return f"{step.item.notation}[{_length(step.length)}]{order}"
        case RecordStep():
            return step.record.name
        case RecordsStep():
            return f"{step.record.name}[{_length(step.length)}]"
        case ValueStep() | BitsStep():
            role = ""
        case ConstantStep():
            role = " const"
        case ReservedStep():
            role = " reserved"
        case CountStep():
            role = " count"
        case FilledStep():
            role = " derived" if isinstance(step.rule, Equal) else " check"
        case _:
            assert_never(step)
    return f"{step.integer.notation}{_order(step.integer)}{role}"


def _length(length: Length) -> str:
    return str(length.maximum) if length.minimum == length.maximum else f"{length.minimum}..{length.maximum}"


def _order(integer: Integer) -> str:
    if integer.size == 1 or integer.text:
        return ""
    return {"big": " be", "little": " le", None: f" in {integer.size} groups"}[integer.byteorder]


def member_note(value: Value, step: Holder) -> str:
    """The comment of a struct member: purpose, unit, range, meaning."""
    parts = [value.doc] if value.doc else []
    match step:
        case ValueStep() | Member() | ItemsStep():
            parts += _facts(step.number)
        case BytesStep():
            parts += ["7-bit characters"] if step.text else []
            parts += [f"filled up with 0x{step.pad.hex().upper()}"] if step.pad else []
        case RecordStep() | RecordsStep():
            pass
        case _:
            assert_never(step)
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
    digits = scalar.bcd or isinstance(scalar.text, Digits)
    if (not scalar.full_range and scalar.meaning != "bool") or digits:
        facts.append(f"{scalar.minimum}..{scalar.maximum}")
    match scalar.meaning:
        case Enum() | Flags():
            facts.append(f"{scalar.meaning.kind} {scalar.meaning.name}")
        case Float():
            facts.append(f"bits of an {scalar.meaning.name}")
            facts += ["{}..{}".format(*scalar.meaning.bounds)] if scalar.meaning.bounds else []
        case Characters():
            facts.append("7-bit characters")
        case "bool" | None:
            pass
        case _:
            assert_never(scalar.meaning)
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
