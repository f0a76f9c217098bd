"""``qlinkgen send`` on a bus with a master: one transaction."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import cast

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import warn
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.wire_options import Line, echo_mode, open_line, speed
from qlinkgen.errors import LinkError, Refused
from qlinkgen.link.codec import Framed
from qlinkgen.link.events import Event, Stray
from qlinkgen.link.master import MasterEngine
from qlinkgen.link.transaction import Accepts, Reply
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.conversation import timing_of
from qlinkgen.transport.port import Ability, Port


def send_on_bus(
    protocol: Protocol,
    codec: ModuleType,
    request: Framed,
    port: str,
    *,
    baud: int | None,
    line: Line,
    attempts: int,
    slack: float | None,
    echo: str | None,
    accepts: Mapping[str, Accepts] | None,
) -> None:
    """Send a request and print the response; send a message outside commands without waiting."""
    with open_line(port, speed(protocol, baud), line) as opened:
        if request.NAME not in {command.request.name for command in protocol.commands}:
            _tell(opened, request.to_frame(), codec.BUS.bits_per_byte)
            click.echo(f"qlinkgen: {request.NAME} sent; it has no response", err=True)
            return
        timing = timing_of(codec, opened, slack=slack, attempts=attempts)
        engine = MasterEngine(codec, timing, echo=echo_mode(protocol, echo), accepts=accepts)
        try:
            reply = _transact(protocol, BlockingMaster(engine, opened), request)
        except Refused as refusal:
            click.echo(jsonlines.line(message_record(protocol, cast("Framed", refusal.reply))))
            raise
    answers = reply.response if isinstance(reply.response, list) else [reply.response]
    for answer in answers:
        if answer is not None:
            click.echo(jsonlines.line(message_record(protocol, answer)))


def _tell(port: Port, frame: bytes, bits_per_byte: int) -> None:
    """Send a frame, and wait until it is transmitted."""
    port.write(frame)
    if port.capabilities.paced is not Ability.NO:
        port.sleep(len(frame) * bits_per_byte / port.baud)


def check_request(protocol: Protocol, message: Message) -> None:
    """Refuse the answers of a command. Messages outside commands may be sent by any node."""
    command = protocol.command_of(message)
    if command is not None and message is not command.request:
        raise Failure(f"{message.name} is a response; send its request, {command.name}")


def _transact(protocol: Protocol, master: BlockingMaster, request: Framed) -> Reply:
    """Perform a transaction; if it fails, show valid frames received that are not the response."""
    strays: list[Framed] = []

    def note(event: Event) -> None:
        if isinstance(event, Stray):
            strays.append(event.message)

    master.on_event = note
    try:
        return master.transact(request)
    except LinkError:
        for stray in strays:
            warn(f"received, but not the response: {jsonlines.line(message_record(protocol, stray))}")
        raise
