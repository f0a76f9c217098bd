"""``qlinkgen send``: one transaction on a port."""

from __future__ import annotations

from typing import Any

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import crc_option, load_protocol, warn
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.encode import address_option, compose, json_option
from qlinkgen.cli.wire_options import (
    attempts_option,
    baud_option,
    check_master_slave,
    echo_mode,
    echo_option,
    line_of,
    matching,
    open_line,
    parity_option,
    slack_option,
    speed,
    stop_bits_option,
)
from qlinkgen.errors import LinkError
from qlinkgen.link.events import Event, Stray
from qlinkgen.link.master import MasterEngine, Reply
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.conversation import timing_of


@click.command("send")
@click.argument("port")
@click.argument("protocol")
@click.argument("message", required=False)
@click.argument("assignments", metavar="[FIELD=VALUE]...", nargs=-1)
@address_option
@json_option
@baud_option
@attempts_option
@slack_option
@echo_option
@parity_option
@stop_bits_option
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    port: str,
    protocol: str,
    message: str | None,
    assignments: tuple[str, ...],
    addresses: tuple[str, ...],
    object_: str | None,
    baud: int | None,
    attempts: int,
    slack: float | None,
    echo: str | None,
    parity: str,
    stop_bits: str,
    crc: str | None,
) -> None:
    """Send a request on PORT and print the answer as decode does: one JSON object.

    PORT is a device such as /dev/ttyUSB0 or COM3, or a URL such as socket://HOST:PORT. MESSAGE and values are
    written as for encode. A request that nobody answers prints nothing. One that must not be repeated is sent
    once, whatever --attempts says. The counter of a motion is the one that is given.

    Exit code 1 if no answer or a wrong one came, or if the port is missing, busy or lost; 2 if the request
    cannot be sent, before a byte is.

    \b
    qlinkgen send /dev/ttyUSB0 qlink motor_position --node 3
    qlinkgen send /dev/ttyUSB0 qlink motion --node 3 counter=1 outputs=0x0F segments=100,200
    qlinkgen send /dev/ttyUSB0 qlink node_start --node 0
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc)
    check_master_slave(loaded, "send")
    codec, found, request = compose(loaded, message, assignments, addresses, object_)
    _check_request(loaded, found)
    try:
        request.to_frame()
    except codec.EncodeError as error:
        raise Failure(str(error)) from None
    with open_line(port, speed(loaded, baud), line_of(parity, stop_bits)) as opened:
        engine = MasterEngine(
            codec,
            timing_of(codec, opened, slack=slack, attempts=attempts),
            echo=echo_mode(loaded, echo),
            accepts=matching(protocol),
        )
        reply = _transact(loaded, BlockingMaster(engine, opened), request)
    if reply.response is not None:
        click.echo(jsonlines.line(message_record(loaded, reply.response)))


def _check_request(protocol: Protocol, message: Message) -> None:
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
