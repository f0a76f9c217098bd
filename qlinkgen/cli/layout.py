"""One message for people: its facts, its fields by offset, and the bits inside them."""

from __future__ import annotations

from qlinkgen.cli import bitmap, describe
from qlinkgen.cli.tables import Table, heading, paragraph
from qlinkgen.model.message import Field, Message, Value
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.sizes import frame_size, max_wire_size
from qlinkgen.model.types import Array, Bits, Blob, Enum, Flags, Scalar

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


def show_message(protocol: Protocol, message: Message) -> None:
    """Print a message: facts, layout, bits and names."""
    heading(f"{message.name}, id {describe.id_text(message, protocol)}")
    paragraph([message.doc, *_facts(protocol, message)])
    _layout(message)
    for field in message.fields:
        if isinstance(field.type, Bits):
            heading(f"Bits of {field.name}")
            paragraph(bitmap.diagram(field.type.container.bits, bitmap.runs_of_bits(field.type)))
    for meaning in dict.fromkeys(_meanings(message)):
        show_enum(meaning) if isinstance(meaning, Enum) else show_flags(meaning)


def _meanings(message: Message) -> list[Enum | Flags]:
    scalars = [value.type for value in message.values if isinstance(value.type, Scalar)]
    return [scalar.meaning for scalar in scalars if isinstance(scalar.meaning, Enum | Flags)]


def _facts(protocol: Protocol, message: Message) -> list[str]:
    low, high = (frame_size(protocol.frame, message, size) for size in (message.min_size, message.max_size))
    facts = [
        f"payload {describe.bytes_text(message.min_size, message.max_size)}",
        f"frame {describe.span_text(low, high)}",
        f"on the wire at most {max_wire_size(protocol.frame, message)}",
    ]
    if message.addresses:
        facts.append(f"{protocol.address_name} {describe.addresses_text(message)}")
    lines = [", ".join(facts)]
    if (command := protocol.command_of(message)) and message is command.request:
        within = describe.time_text(command.response_within)
        answer = f"answered within {within}" if within else "answered"
        answered = answer if command.response else "never answered"
        lines.append(f"{answered}; repeat: {describe.repeat_text(command)}")
    if message.empty_is_default:
        lines.append("a payload of no bytes is taken as one with every default")
    if message.section:
        lines.append(f"section {message.section}")
    if not message.confirmed:
        lines.append(UNCONFIRMED)
    return lines


def _layout(message: Message) -> None:
    table = Table(COLUMNS, "", frozenset({"offset", "bytes"}))
    values = {value.name: value for value in message.values}
    for field in message.fields:
        offset = message.offset(field.name)
        place = "behind" if offset is None else offset
        notes = ["echo"] if field.echo else []
        notes += [] if field.confirmed else [UNCONFIRMED]
        table.add(
            place,
            field.name,
            describe.size_text(field),
            *_about(field, values.get(field.name)),
            field.section,
            ", ".join(notes),
        )
        if isinstance(field.type, Bits):
            for member in field.type.members:
                table.add(
                    f".{member.shift}", member.name, f"{member.type.bits} bit",
                    *_scalar(member.type, values.get(member.name)), member.doc, "", "",
                )  # fmt: skip
    table.show()


def _about(field: Field, value: Value | None) -> list[str]:
    kind = field.type
    if isinstance(kind, Blob):
        return [
            describe.type_text(kind),
            "",
            "",
            "",
            describe.default_text(value) if value else "",
            field.doc,
        ]
    if isinstance(kind, Array):
        shown = describe.default_text(value) if value else ""
        return [
            describe.type_text(kind),
            describe.range_text(kind.item),
            kind.item.unit,
            "",
            shown,
            field.doc,
        ]
    return [*_scalar(kind.container if isinstance(kind, Bits) else kind, value), field.doc]


def _scalar(kind: Scalar, value: Value | None) -> list[str]:
    counted = f"{kind.counts_unit} of {kind.counts}" if kind.counts else ""
    shown = counted or describe.range_text(kind)
    default = describe.default_text(value) if value else ""
    return [describe.type_text(kind), shown, kind.unit, describe.step_text(kind), default]


def show_enum(enum: Enum) -> None:
    """Print the names of an enum."""
    table = Table(
        ["number", "name", "meaning"], f"{enum.name}: {enum.doc}".rstrip(": "), frozenset({"number"})
    )
    for member in enum.members:
        table.add(member.value, member.name, member.doc)
    table.show()


def show_flags(flags: Flags) -> None:
    """Print the bits of flags as a diagram."""
    heading(f"{flags.name}: {flags.doc}".rstrip(": "))
    paragraph(bitmap.diagram(flags.bits, bitmap.runs_of_flags(flags)))
