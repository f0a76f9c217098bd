"""``qlinkgen send`` where one master asks: one transaction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import warn
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.wire_options import Line, echo_mode, open_line, speed
from qlinkgen.errors import LinkError
from qlinkgen.link.events import Event, Stray
from qlinkgen.link.master import MasterEngine
from qlinkgen.link.transaction import Accepts, Reply
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.conversation import timing_of


def send_on_bus(
    protocol: Protocol,
    codec: Any,
    request: Any,
    port: str,
    *,
    baud: int | None,
    line: Line,
    attempts: int,
    slack: float | None,
    echo: str | None,
    accepts: Mapping[str, Accepts] | None,
) -> None:
    """Ask, and print the answer."""
    with open_line(port, speed(protocol, baud), line) as opened:
        timing = timing_of(codec, opened, slack=slack, attempts=attempts)
        engine = MasterEngine(codec, timing, echo=echo_mode(protocol, echo), accepts=accepts)
        reply = _transact(protocol, BlockingMaster(engine, opened), request)
    if reply.response is not None:
        click.echo(jsonlines.line(message_record(protocol, reply.response)))


def check_request(protocol: Protocol, message: Message) -> None:
    """Refuse a message that asks nothing."""
    requests = {command.request.name: command.name for command in protocol.commands}
    if message.name in requests:
        return
    if message.command in requests.values():
        raise Failure(f"{message.name} is what a node answers; send its request, {message.command}")
    raise Failure(
        f"{message.name} belongs to no command, so nothing says what answers it; "
        f"`qlinkgen show {protocol.name}` lists the commands"
    )


def _transact(protocol: Protocol, master: BlockingMaster, request: Any) -> Reply:
    """Ask; where that fails, show the good frames that came and were no answer."""
    strays: list[Any] = []

    def note(event: Event) -> None:
        if isinstance(event, Stray):
            strays.append(event.message)

    master.on_event = note
    try:
        return master.transact(request)
    except LinkError:
        for stray in strays:
            warn(f"this came, and is no answer: {jsonlines.line(message_record(protocol, stray))}")
        raise
