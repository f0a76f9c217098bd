"""Macros for limits of a protocol, enums and flags."""

from __future__ import annotations

from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import c_text
from qlinkgen.backends.c.names import Names, bracketed, integer_type, literal, unsigned
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Enum, Flags, NamedValue
from qlinkgen.plan import Plan


def limits(whole: Plan, kept: Plan) -> list[tuple[str, str]]:
    """Names and values of limits of the whole protocol, regardless of selected messages."""
    bus, most = whole.protocol.bus, whole.frame.max_payload
    longest = max(message.frame_size for message in whole.messages)
    values = [
        ("MAX_PAYLOAD_SIZE", f"{most}U"),
        ("MAX_FRAME_SIZE", f"{max(longest, most + whole.messages[0].envelope.overhead)}U"),
        ("MAX_WIRE_SIZE", f"{kept.max_wire_size}U"),
    ]
    if bus.nodes:
        values += [("FIRST_NODE", f"{bus.nodes[0]}U"), ("LAST_NODE", f"{bus.nodes[1]}U")]
    if bus.broadcast is not None:
        values.append(("BROADCAST", f"{bus.broadcast}U"))
    if bus.baud is not None:
        values.append(("BAUD", f"{bus.baud}UL"))
    return [*values, ("BITS_PER_BYTE", f"{bus.bits_per_byte}U")]


@dataclass(frozen=True, slots=True)
class ConstantView:
    """A named value."""

    name: str
    constant: str
    value: str
    doc: str


@dataclass(frozen=True, slots=True)
class EnumView:
    """An enum or flags."""

    name: str
    is_enum: bool
    type: str
    title: str
    members: list[ConstantView]


def enum_views(protocol: Protocol, names: Names) -> list[EnumView]:
    """Enums and flags for the template."""
    return [_view(each, names) for each in _all(protocol)]


def _all(protocol: Protocol) -> list[Enum | Flags]:
    return [*protocol.enums, *protocol.flags]


def _view(each: Enum | Flags, names: Names) -> EnumView:
    signed = _is_signed(each)
    section = f" (section {each.section})" if each.section else ""
    doc = f": {each.doc}" if each.doc else ""
    return EnumView(
        name=names.constants(each),
        is_enum=each.kind == "enum",
        type=constant_type(each),
        title=c_text.comment_line(f"{each.kind.capitalize()} {each.name}{section}{doc}"),
        members=[
            ConstantView(
                name=member.name,
                constant=f"{names.upper}_{names.constants(each).upper()}_{member.name.upper()}",
                value=_number(member, each, signed=signed),
                doc=c_text.comment_line(_note(member, each)),
            )
            for member in each.members
        ],
    )


def _note(member: NamedValue, each: Enum | Flags) -> str:
    """Its description, and the word that is sent."""
    words = each.words if isinstance(each, Enum) else None
    sent = f"sent as {words.text(member.value).decode()}" if words else ""
    return "; ".join(filter(None, (member.doc, sent)))


def constant_type(each: Enum | Flags) -> str:
    """The C type of the values of an enum or flags."""
    return integer_type(each.bits, signed=_is_signed(each))


def _is_signed(each: Enum | Flags) -> bool:
    return any(member.value < 0 for member in each.members)  # the bit of a flag has no sign


def _number(member: NamedValue, each: Enum | Flags, *, signed: bool) -> str:
    match each:
        case Flags():
            return unsigned(1 << member.value, each.bits, hexadecimal=True)
        case Enum():
            return bracketed(literal(member.value, each.bits, signed=signed))
        case _:
            assert_never(each)
