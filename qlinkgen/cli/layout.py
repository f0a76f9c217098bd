"""Prints a message: its properties, its fields by offset, and their bits."""

from __future__ import annotations

from collections.abc import Mapping

from qlinkgen.cli import bitmap, describe
from qlinkgen.cli.tables import Table, heading, paragraph
from qlinkgen.model.fields import Layout, Value, layouts_of
from qlinkgen.model.message import Message
from qlinkgen.model.types import Enum, Flags
from qlinkgen.plan.describe import (
    bytes_text,
    holds_text,
    id_text,
    number_of,
    presence_text,
    scale_text,
    size_text,
    span_text,
    type_text,
)
from qlinkgen.plan.payload import BitsStep, Member, PayloadPlan, Step, value_name
from qlinkgen.plan.tree import MessagePlan, Plan

UNCONFIRMED = "unconfirmed"
COLUMNS = [
    "offset",
    "field",
    "bytes",
    "type",
    "range",
    "unit",
    "step",
    "default",
    "meaning",
    "section",
    "note",
]


def show_message(plan: Plan, planned: MessagePlan) -> None:
    """Print a message: properties, layout, bits and names."""
    message = planned.message
    heading(f"{message.name}, id {id_text(plan.frame, message.id)}")
    paragraph([message.doc, *_facts(plan, planned)])
    _layout("", message, planned.payload)
    _bits(planned.payload, message.docs)
    payloads, layouts = [planned.payload], {each.name: each for each in layouts_of(message.fields)}
    for record in planned.payload.records:
        layout = layouts[record.name]
        _layout(f"{record.name}: {layout.doc}".rstrip(": "), layout, record.payload)
        _bits(record.payload, layout.docs)
        payloads.append(record.payload)
    for meaning in dict.fromkeys(each for payload in payloads for each in _meanings(payload)):
        show_enum(meaning) if isinstance(meaning, Enum) else show_flags(meaning)
    examples = [each.wire for each in plan.protocol.examples if each.message == message.name]
    if examples:
        heading("Frames of the document")
        paragraph(wire.hex(" ").upper() for wire in examples)


def _bits(payload: PayloadPlan, docs: Mapping[str, str]) -> None:
    for step in payload.steps:
        if isinstance(step, BitsStep):
            heading(f"Bits of {step.name}")
            paragraph(bitmap.diagram(step.integer.bits, bitmap.runs_of_bits(step, docs)))


def _meanings(payload: PayloadPlan) -> list[Enum | Flags]:
    scalars = [number_of(each) for each in payload.settable]
    return [each.meaning for each in scalars if each and isinstance(each.meaning, Enum | Flags)]


def _facts(plan: Plan, planned: MessagePlan) -> list[str]:
    message, payload = planned.message, planned.payload
    low, high = planned.least_frame, planned.most_frame
    facts = [
        f"payload {bytes_text(payload.least, payload.most)}",
        f"frame {span_text(low, high)}",
        f"on the wire at most {planned.wire_size}",
    ]
    if message.addresses:
        facts.append(f"{plan.frame.address} {describe.addresses_text(message)}")
    lines = [", ".join(facts)]
    if (command := plan.protocol.command_of(message)) and message is command.request:
        within = describe.time_text(command.response_within)
        answer = f"answered within {within}" if within else "answered"
        answered = answer if command.response else "never answered"
        lines.extend([describe.many_text(command.many)] if command.many else [])
        lines.extend([describe.steps_text(command)] if command.steps else [])
        lines.append(f"{answered}; repeat: {describe.repeat_text(command)}")
    if reply := plan.protocol.replies.get(message.name):
        lines.append(f"means {describe.means_text(reply)}")
    if payload.empty_is_default:
        lines.append("an empty payload means every field at its default")
    if message.section:
        lines.append(f"section {message.section}")
    if not message.confirmed:
        lines.append(UNCONFIRMED)
    return lines


def _layout(title: str, stated: Message | Layout, payload: PayloadPlan) -> None:
    table = Table(COLUMNS, title, frozenset({"offset", "bytes"}))
    values = {each.name: value for value, each in zip(stated.values, payload.settable, strict=True)}
    docs = stated.docs
    moving = [step for segment in payload.segments[1:] for step in segment.steps]
    moving += payload.steps[1:] if payload.separator else []
    for field, step in zip(stated.fields, payload.steps, strict=True):
        offset = step.place.offset
        notes = [f"= request.{field.repeats}"] if field.repeats else []
        covered = ", ".join(f"request.{each}" for each in field.proves)
        notes += [f"check value of {covered} and the bytes before it"] if covered else []
        notes += [] if field.confirmed else [UNCONFIRMED]
        if step.presence:
            notes.append("empty if absent" if payload.separator else presence_text(step.presence))
        if step in moving:
            offset = None
        table.add(
            ("..." if payload.walked else size_text(step.place.front)) if offset is None else offset,
            value_name(step),
            span_text(field.min_size, field.max_size),
            *_about(step, values.get(step.name)),
            field.doc,
            field.section,
            ", ".join(notes),
        )
        for member in step.members if isinstance(step, BitsStep) else ():
            value = values.get(member.name)
            cells = _about(member, value)
            table.add(
                f".{member.shift}",
                member.name,
                f"{member.bits} bit",
                *cells,
                docs[member.name],
                "",
                "",
            )
    table.show()


def _about(step: Step | Member, value: Value | None) -> list[str]:
    """Return type, range, unit, step and default."""
    number = number_of(step)
    unit, scale = (number.unit, scale_text(number)) if number else ("", "")
    default = describe.default_text(value) if value else ""
    return [type_text(step), holds_text(step), unit, scale, default]


def show_enum(enum: Enum) -> None:
    """Print the names of an enum."""
    column = "word" if enum.words else "number"
    table = Table([column, "name", "meaning"], f"{enum.name}: {enum.doc}".rstrip(": "), frozenset({"number"}))
    for member in enum.members:
        sent = enum.words.text(member.value).decode() if enum.words else member.value
        table.add(sent, member.name, member.doc)
    table.show()


def show_flags(flags: Flags) -> None:
    """Print the bits of flags as a diagram."""
    heading(f"{flags.name}: {flags.doc}".rstrip(": "))
    paragraph(bitmap.diagram(flags.bits, bitmap.runs_of_flags(flags)))
