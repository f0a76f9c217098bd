"""``qlinkgen show``: a protocol or a message, as a person wants to read it."""

from __future__ import annotations

import click

from qlinkgen.cli import bitmap, describe
from qlinkgen.cli.common import find_message, load_protocol, warn_unconfirmed
from qlinkgen.cli.layout import UNCONFIRMED, show_enum, show_flags, show_message
from qlinkgen.cli.tables import Table, heading, paragraph
from qlinkgen.model.frame import DelimitedFrame, MarkedFrame, PacketFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.sizes import max_wire_size, protocol_max_wire_size
from qlinkgen.model.transaction import Command


@click.command("show")
@click.argument("protocol")
@click.argument("message", required=False)
def command(protocol: str, message: str | None) -> None:
    """Show a protocol: its frame, bus and transactions. With MESSAGE: layout, sizes, values.

    MESSAGE is a message (motion.response), or a command (motion) for request and response together. Sizes
    are bytes; `on the wire` counts the frame and the worst case of stuffing.
    """
    shown = load_protocol(protocol)
    if message is None:
        _protocol(shown)
        return
    for each in _messages(shown, message):
        show_message(shown, each)
        warn_unconfirmed(shown, each)


def _messages(protocol: Protocol, name: str) -> list[Message]:
    command = next((each for each in protocol.commands if each.name == name), None)
    if command is None:
        return [find_message(protocol, name)]
    return [message for message in (command.request, command.response) if message]


def _protocol(protocol: Protocol) -> None:
    heading(f"{protocol.title} ({protocol.name}), revision {protocol.revision}")
    paragraph([protocol.source, protocol.doc])
    _frame(protocol)
    _bus(protocol)
    _commands(protocol)
    _loose_messages(protocol)
    _named(protocol)


def _frame(protocol: Protocol) -> None:
    frame = protocol.frame
    if isinstance(frame, DelimitedFrame):
        _delimited(frame)
    elif isinstance(frame, MarkedFrame):
        heading("Header byte; the end byte is the same with the end's number")
        paragraph(bitmap.diagram(8, bitmap.runs_of_header(frame)))
        paragraph(_marked_facts(frame))
    else:
        paragraph(_packet_facts(frame))
    paragraph([f"Most bytes on the wire: {protocol_max_wire_size(protocol)}"])


def _delimited(frame: DelimitedFrame) -> None:
    table = Table(["offset", "part", "bytes", "holds", "section"], "Frame", frozenset({"offset", "bytes"}))
    behind = False
    for part in frame.parts:
        offset = f"{frame.offset(part.name)}+n" if behind else frame.offset(part.name)
        size = describe.span_text(part.min_size, part.max_size) if part.role == "payload" else part.size
        table.add(offset, part.name, size, describe.part_text(part, frame), part.section)
        behind = behind or part.role == "payload"
    table.show()
    if frame.stuffing:
        paragraph([f"Stuffing: {describe.stuffing_text(frame.stuffing)}"])


def _marked_facts(frame: MarkedFrame) -> list[str]:
    facts = [f"Payload: 0..{frame.payload_max} bytes without the marker bit"]
    if frame.checksum:
        bits = ", ".join(f"{chunk.shift}..{chunk.shift + chunk.bits - 1}" for chunk in frame.checksum.chunks)
        facts.append(f"Checksum: {describe.checksum_text(frame.checksum)}; bits {bits} are sent")
    return facts


def _packet_facts(frame: PacketFrame) -> list[str]:
    facts = [
        f"Request: {frame.id_name} byte, up to {frame.payload_max} bytes written",
        f"Response: up to {frame.payload_max} bytes read, and the check value if the host wants it",
    ]
    if frame.checksum:
        facts.append(
            f"Check value: {frame.checksum.algorithm.name} of {frame.id_name} and every word, written or read"
        )
    if frame.rejected is not None:
        facts.append(f"A check value of {frame.rejected} says that the command is not known")
    return facts


def _bus(protocol: Protocol) -> None:
    bus = protocol.bus
    facts = [
        bus.kind.replace("_", "/"),
        f"{protocol.address_name or 'nodes'} {describe.span_text(*bus.nodes)}" if bus.nodes else "",
        "" if bus.broadcast is None else f"broadcast {bus.broadcast}",
        f"{bus.baud} baud, {bus.bits_per_byte} bits a byte" if bus.baud else "",
    ]
    answer = describe.time_text(bus.response_within)
    facts.append(f"answers within {answer}" if answer else "")
    paragraph([f"Bus: {', '.join(fact for fact in facts if fact)}"])


def _commands(protocol: Protocol) -> None:
    columns = ["id", "command", "request", "response", "on the wire", "addressing", "answer within", "repeat"]
    attributes = list(dict.fromkeys(name for each in protocol.commands for name in each.attributes))
    table = Table(
        [*columns, *attributes, "section", "note"], "Commands (payload bytes of request and response)"
    )
    for each in protocol.commands:
        table.add(
            *_command_cells(protocol, each),
            *(_attribute(each.attributes.get(name, "")) for name in attributes),
            each.section,
            _note(each),
        )
    table.show()


def _command_cells(protocol: Protocol, command: Command) -> list[str]:
    request, response = command.request, command.response
    wire = [max_wire_size(protocol.frame, message) for message in (request, response) if message]
    return [
        describe.id_text(request, protocol),
        command.name,
        describe.span_text(request.min_size, request.max_size),
        describe.span_text(response.min_size, response.max_size) if response else "none",
        " + ".join(map(str, wire)),
        describe.ADDRESSING[command.addressing],
        describe.time_text(command.response_within) if response else "",
        describe.repeat_text(command),
    ]


def _attribute(value: str | int | bool) -> str:
    return ("yes" if value else "no") if isinstance(value, bool) else str(value)


def _note(command: Command) -> str:
    messages = [message for message in (command.request, command.response) if message]
    weak = not command.confirmed or any(not message.confirmed for message in messages)
    return UNCONFIRMED if weak or any(not field.confirmed for m in messages for field in m.fields) else ""


def _loose_messages(protocol: Protocol) -> None:
    """Messages that are no part of a transaction."""
    loose = [message for message in protocol.messages if protocol.command_of(message) is None]
    table = Table(["id", "message", "payload", "on the wire", "addresses", "section", "note"], "Messages")
    for message in loose:
        table.add(
            describe.id_text(message, protocol),
            message.name,
            describe.span_text(message.min_size, message.max_size),
            max_wire_size(protocol.frame, message),
            describe.addresses_text(message),
            message.section,
            "" if message.confirmed else UNCONFIRMED,
        )
    table.show()


def _named(protocol: Protocol) -> None:
    for enum in protocol.enums:
        show_enum(enum)
    for flags in protocol.flags:
        show_flags(flags)
