"""Enums, flags and the transaction table of a module."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction

from qlinkgen.backends import python_text
from qlinkgen.backends.python.classes import class_name
from qlinkgen.backends.python.place import in_hex, wrapped
from qlinkgen.model.message import Message
from qlinkgen.model.naming import pascal
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.texts import one_line
from qlinkgen.model.transaction import Bus, Command
from qlinkgen.model.types import Constant, Enum, Flags


@dataclass(frozen=True)
class Member:
    """A constant of an enum or flags class."""

    name: str
    value: str
    doc: list[str]


@dataclass(frozen=True)
class ConstantsModel:
    """An enum or flags class."""

    name: str
    doc: list[str]
    members: list[Member]


def constant_classes(protocol: Protocol, taken: Iterable[str]) -> Mapping[str, str]:
    """Class of each enum and flags; one whose name a message has is told apart by what it is."""
    names = set(taken)
    found = {}
    for group, suffix in ((protocol.enums, "Enum"), (protocol.flags, "Flags")):
        for each in group:
            name = pascal(each.name)
            found[each.name] = f"{name}{suffix}" if name in names else name
    return found


def enum_model(enum: Enum, name: str) -> ConstantsModel:
    """Render model of an enum."""
    members = [Member(each.name.upper(), str(each.value), _comment(each)) for each in enum.members]
    return ConstantsModel(
        name, _doc(enum.doc, enum.section, "Numbers without a name are kept as they are."), members
    )


def flags_model(flags: Flags, name: str) -> ConstantsModel:
    """Render model of flags."""
    digits = (flags.bits + 3) // 4 + 2
    members = [
        Member(each.name.upper(), f"{1 << each.value:#0{digits}x}", _comment(each)) for each in flags.members
    ]
    rest = "Other bits must be zero." if flags.reserved_zero else "Other bits are kept as they are."
    return ConstantsModel(name, _doc(flags.doc, flags.section, f"Masks. {rest}"), members)


def _comment(constant: Constant) -> list[str]:
    return python_text.comment(constant.doc, 100)


def _doc(doc: str, section: str, more: str) -> list[str]:
    where = f" ({'section ' if section[:1].isdigit() else ''}{section})" if section else ""
    text = one_line(f"{doc.rstrip('.')}{where}.") if doc else ""
    first, _, rest = text.partition(". ")
    lines = [f"{first}.", "", rest, more] if rest else [text, "", more]
    if not text:
        return python_text.docstring([more])
    return python_text.docstring(part for line in lines for part in (textwrap.wrap(line, 102) or [""]))


def bus(line: Bus) -> str:
    """The call that makes the description of the bus; what the schema does not say is left out."""
    facts = [("broadcast", line.broadcast), ("baud", line.baud), ("bits_per_byte", line.bits_per_byte)]
    if line.nodes:
        facts = [("first_node", line.nodes[0]), ("last_node", line.nodes[1]), *facts]
    given = [f"{name}={value}" for name, value in facts if value is not None]
    return f'Bus("{line.kind}", {", ".join(given)})'


def command_rows(commands: Iterable[Command], kept: Mapping[str, Message]) -> list[str]:
    """The rows of the transaction table, over one line or several."""
    return [_row(command, kept) for command in commands if command.request.name in kept]


def _row(command: Command, kept: Mapping[str, Message]) -> str:
    response = class_name(command.response) if command.response and command.response.name in kept else "None"
    arguments = [f'"{command.name}"', in_hex(command.id), class_name(command.request), response]
    if command.addressing != "none":
        arguments.append(f'addressing="{command.addressing}"')
    within = command.response_within
    if within.byte_times:
        arguments.append(f"response_byte_times={_number(within.byte_times)}")
    if within.seconds:
        arguments.append(f"response_seconds={_number(within.seconds)}")
    arguments += _repetition(command)
    if command.in_flight != 1:
        arguments.append(f"in_flight={command.in_flight}")
    if command.section:
        arguments.append(f"section={python_text.literal(command.section)}")
    if not command.confirmed:
        arguments.append("confirmed=False")
    if command.attributes:
        pairs = ", ".join(f'"{key}": {_literal(value)}' for key, value in command.attributes.items())
        arguments.append(f"attributes={{{pairs}}}")
    return "\n".join(wrapped(f'"{command.name}": Command(', arguments, "),", 4))


def _repetition(command: Command) -> list[str]:
    """What may be sent again, and what comes back as it was sent."""
    names = "".join(f'"{name}", ' for name in command.echoes)
    facts = {
        "repeat_safe=True": command.repeat.safe,
        f'repeat_counter="{command.repeat.counter}"': command.repeat.counter,
        f"echoes=({names.rstrip(' ' if len(command.echoes) == 1 else ', ')})": names,
    }
    return [argument for argument, given in facts.items() if given]


def _number(value: Fraction) -> str:
    return str(value.numerator) if value.denominator == 1 else repr(float(value))


def _literal(value: str | int | bool) -> str:
    return python_text.literal(value) if isinstance(value, str) else repr(value)
