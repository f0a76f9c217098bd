"""``qlinkgen show``: print a protocol or a message."""

from __future__ import annotations

import click

from qlinkgen.cli import bitmap, describe
from qlinkgen.cli.arguments import message_argument, protocol_argument
from qlinkgen.cli.common import find_message, load_protocol, version_option, warn_unconfirmed
from qlinkgen.cli.layout import UNCONFIRMED, show_enum, show_flags, show_message
from qlinkgen.cli.plan_text import envelopes, parts_table, show_frame_plan, show_message_plan
from qlinkgen.cli.tables import Table, heading, paragraph
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Command
from qlinkgen.plan import Plan, plan_of
from qlinkgen.plan.describe import id_text, span_text, transparency_text
from qlinkgen.plan.ends import ByMark


@click.command("show")
@protocol_argument
@message_argument
@click.option("--plan", "planned", is_flag=True, help="Show how it is built and decoded; see docs/plan.md.")
@version_option
def command(protocol: str, message: str | None, *, planned: bool, version: str | None) -> None:
    """Show a protocol: its frame, bus and transactions. With MESSAGE: layout, sizes, values.

    With --plan, show how code builds and decodes it: the parts of a frame, the coverage of the check value,
    stuffing, how a receiver finds frames; with MESSAGE the steps of its payload.

    MESSAGE is a message (motion.response), or a command (motion) for request and response together. Sizes
    are in bytes; `on the wire` is the size of the frame with worst-case stuffing.
    """
    shown = load_protocol(protocol, version=version)
    plan = plan_of(shown)
    if message is None:
        show_frame_plan(plan) if planned else _protocol(plan)
        return
    for each in _messages(shown, message):
        if planned:
            show_message_plan(plan, plan.message(each.name))
        else:
            show_message(plan, plan.message(each.name))
            warn_unconfirmed(shown, each)


def _messages(protocol: Protocol, name: str) -> list[Message]:
    command = next((each for each in protocol.commands if each.name == name), None)
    if command is None:
        return [find_message(protocol, name)]
    return list(command.messages)


def _protocol(plan: Plan) -> None:
    protocol = plan.protocol
    heading(f"{protocol.title} ({protocol.name}), revision {protocol.revision}")
    paragraph([protocol.source, protocol.doc])
    _frame(plan)
    _bus(protocol)
    _commands(plan)
    _replies(plan)
    _loose_messages(plan)
    _named(protocol)


def _frame(plan: Plan) -> None:
    frame = plan.frame
    if isinstance(frame.end, ByMark):
        heading("Header byte; the end byte is alike, with the number of the end")
        paragraph(bitmap.diagram(8, bitmap.runs_of_header(frame.end.header, frame.end.end.end_id)))
    for title, envelope in envelopes(plan):
        parts_table(frame, envelope, title, plan.protocol.part_sections).show()
    facts = [f"Sent: {transparency_text(frame)}"]
    if frame.needs_request and frame.check:
        facts.append("The host need not read the check value")
        if frame.check.rejected is not None:
            facts.append(f"A check value of {frame.check.rejected} means an unknown command")
    paragraph([*facts, f"Longest frame on the wire: {plan.max_wire_size} bytes"])


def _bus(protocol: Protocol) -> None:
    bus, master = protocol.bus, protocol.master
    facts = [
        bus.kind.replace("_", "/"),
        f"{protocol.address_name or 'nodes'} {span_text(*bus.nodes)}" if bus.nodes else "",
        "" if bus.broadcast is None else f"broadcast {bus.broadcast}",
        f"master {master.type.default}" if master and master.type else "",
        f"{bus.baud} baud, {bus.bits_per_byte} bits per byte" if bus.baud else "",
    ]
    answer = describe.time_text(bus.response_within)
    facts.append(f"answers within {answer}" if answer else "")
    paragraph([f"Bus: {', '.join(fact for fact in facts if fact)}"])


def _commands(plan: Plan) -> None:
    protocol = plan.protocol
    columns = ["id", "command", "request", "response", "on the wire", "addressing", "answer within", "repeat"]
    attributes = list(dict.fromkeys(name for each in protocol.commands for name in each.attributes))
    table = Table(
        [*columns, *attributes, "section", "note"], "Commands (payload bytes of request and response)"
    )
    for each in protocol.commands:
        table.add(
            *_command_cells(plan, each),
            *(_attribute(each.attributes.get(name, "")) for name in attributes),
            each.section,
            _note(each),
        )
    table.show()


def _command_cells(plan: Plan, command: Command) -> list[str]:
    request, response = command.request, command.response
    wire = [plan.message(message.name).wire_size for message in (request, response) if message]
    return [
        id_text(plan.frame, request.id),
        command.name,
        span_text(request.min_size, request.max_size),
        span_text(response.min_size, response.max_size) if response else "none",
        " + ".join(map(str, wire)),
        describe.ADDRESSING[command.addressing],
        describe.time_text(command.response_within) if response else "",
        describe.repeat_text(command),
    ]


def _attribute(value: str | int | bool) -> str:
    return ("yes" if value else "no") if isinstance(value, bool) else str(value)


def _note(command: Command) -> str:
    messages = command.messages
    weak = not command.confirmed or any(not message.confirmed for message in messages)
    return UNCONFIRMED if weak or any(not field.confirmed for m in messages for field in m.fields) else ""


def _replies(plan: Plan) -> None:
    """Print the answers other than responses."""
    table = Table(["id", "reply", "payload", "on the wire", "means", "section", "note"], "Other answers")
    for name, reply in plan.protocol.replies.items():
        message = reply.message
        table.add(
            id_text(plan.frame, message.id),
            name,
            span_text(message.min_size, message.max_size),
            plan.message(name).wire_size,
            describe.means_text(reply),
            message.section,
            "" if message.confirmed else UNCONFIRMED,
        )
    table.show()


def _loose_messages(plan: Plan) -> None:
    """Print the messages outside transactions."""
    protocol = plan.protocol
    alone = (message for message in protocol.messages if message.command == message.name)
    loose = [message for message in alone if message.name not in protocol.replies]
    table = Table(["id", "message", "payload", "on the wire", "addresses", "section", "note"], "Messages")
    for message in loose:
        table.add(
            id_text(plan.frame, message.id),
            message.name,
            span_text(message.min_size, message.max_size),
            plan.message(message.name).wire_size,
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
