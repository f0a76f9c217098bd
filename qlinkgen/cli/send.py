"""``qlinkgen send``: perform one transaction on a port, or send one message into a ring."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Literal

import click

from qlinkgen.cli.arguments import (
    assignments_argument,
    driven_protocol_argument,
    message_argument,
    port_argument,
)
from qlinkgen.cli.boundary import FINE, Failure
from qlinkgen.cli.common import crc_option, load_protocol
from qlinkgen.cli.encode import address_option, compose, json_option
from qlinkgen.cli.kinds import BUS, HOST, RING, Belongs, check_options, kind_of
from qlinkgen.cli.send_bus import check_request, further_of, send_on_bus
from qlinkgen.cli.tracing import record_option, trace_of, trace_option
from qlinkgen.cli.wire_options import (
    Parity,
    attempts_option,
    baud_option,
    echo_option,
    line_of,
    parity_option,
    seconds,
    slack_option,
    stop_bits_option,
)
from qlinkgen.model.replacement import Replacement
from qlinkgen.protocols.registry import codec_of, support_of

BELONGS: Belongs = {
    "attempts": (BUS, HOST),
    "slack": (BUS, HOST),
    "echo": (BUS,),
    "then": (BUS,),
    "axis": (HOST,),
    "checksum": (HOST,),
    "check": (HOST,),
    "stay": (RING,),
    "count": (RING, BUS),
    "every": (BUS,),
}


@click.command("send")
@driven_protocol_argument
@port_argument
@message_argument
@assignments_argument
@address_option
@json_option
@click.option(
    "--then",
    metavar="OBJECT",
    multiple=True,
    help="Values of the next frame of a dialogue as JSON; once for each frame after the request.",
)
@baud_option
@attempts_option
@slack_option
@echo_option
@parity_option
@stop_bits_option
@click.option(
    "--select",
    "--axis",
    "axis",
    type=click.IntRange(0),
    metavar="N",
    help="A host: the number of what the command acts on, such as an axis, which is selected first.",
)
@click.option(
    "--checksum",
    type=click.Choice(["always", "never"]),
    default="always",
    show_default=True,
    help="A host: whether to read the checksum after the response.",
)
@click.option(
    "--check", is_flag=True, help="mc1231a: then read the status word, and fail on a command error."
)
@click.option(
    "--seconds",
    "stay",
    callback=seconds,
    metavar="SECONDS",
    help="trio: time on the ring after the message.  [default: 0.2]",
)
@click.option(
    "--count",
    type=click.IntRange(1),
    metavar="N",
    help="trio: leave earlier, after N messages for this node. On a bus: end after N requests of --every, or "
    "endless answers.",
)
@click.option(
    "--every",
    callback=seconds,
    metavar="SECONDS",
    help="Send it again and again with this period, until Ctrl-C or --count.",
)
@trace_option
@record_option
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    port: str,
    message: str | None,
    assignments: tuple[str, ...],
    addresses: tuple[str, ...],
    object_: str | None,
    then: tuple[str, ...],
    baud: int | None,
    attempts: int,
    slack: float | None,
    echo: str | None,
    parity: Parity,
    stop_bits: str,
    axis: int | None,
    checksum: Literal["always", "never"],
    check: bool,
    stay: float | None,
    count: int | None,
    every: float | None,
    traced: bool,
    record: str | None,
    crc: Replacement | None,
) -> int:
    """Send a request on PORT and print the response like decode: one JSON object.

    PORT is a device such as /dev/ttyUSB0 or COM3, or a URL such as socket://HOST:PORT. MESSAGE and values are
    written as for encode. For a request without a response, nothing is printed. A request that is unsafe to
    repeat is sent once, regardless of --attempts; so is a message outside commands, which has no response.
    The counter of a motion is sent as given. Of a command with steps, --then gives the values of each frame
    after the request, and all answers are printed. Answers that another command stops are printed as they
    come, until Ctrl-C or --count; then that command is sent.

    With --every, each response is an object with "at", the seconds since the start, and a failure is {"at",
    "error": {"kind", "message"}}; a summary of response times and jitter goes to standard error. A turn
    is left out while the previous request is pending. Exit code 1 if no request is answered.

    On a ring, the command joins as an additional node: it forwards messages, prints those for this node, and
    leaves after --seconds, as soon as it forwards nothing. Delivery of the message is not confirmed. The
    host of a device selects --axis first if the schema says how; without it, the current one is used.

    Exit code 1 if the response is missing or wrong, if the node refuses (its reply is printed), or if the
    port is missing, busy or lost; 2 if the request is invalid, and nothing was sent.

    \b
    qlinkgen send qlink /dev/ttyUSB0 motor_position --node 3
    qlinkgen send qlink /dev/ttyUSB0 motion --node 3 counter=1 outputs=0x0F segments=100,200
    qlinkgen send qlink /dev/ttyUSB0 node_start --node 0
    qlinkgen send trio /dev/ttyUSB0 character_transfer --address 2 characters=HELLO --baud 38400
    qlinkgen send mc1231a /dev/ttyUSB0 set_vel value=2.75 --axis 2 --baud 57600
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc)
    kind = kind_of(loaded)
    check_options(loaded.name, kind, BELONGS)
    own = codec_of(loaded) if kind is HOST else None  # what is written by hand uses its classes
    codec, found, request = compose(loaded, message, assignments, addresses, object_, codec=own)
    if kind is not RING:
        check_request(loaded, found)
    try:
        request.to_frame()
    except codec.EncodeError as error:
        raise Failure(str(error)) from None
    with ExitStack() as ended:
        trace = trace_of(loaded, codec, port, ended, traced=traced, record=record)
        line = line_of(parity, stop_bits, trace.hear if trace else None)
        if kind is RING:
            from qlinkgen.cli.send_ring import send_into_ring  # noqa: PLC0415  # only for rings

            send_into_ring(loaded, codec, request, port, seconds=stay, count=count, baud=baud, line=line)
            return FINE
        if kind is HOST:
            from qlinkgen.cli.send_host import send_to_device  # noqa: PLC0415

            send_to_device(
                loaded, codec, request, port, axis=axis, checksum=checksum, check=check,
                attempts=attempts, slack=slack, baud=baud, line=line,
            )  # fmt: skip
            return FINE
        further = further_of(loaded, codec, found, addresses, then)
        return send_on_bus(
            loaded, codec, request, port, further=further, baud=baud, line=line,
            attempts=attempts, slack=slack, echo=echo, accepts=support_of(loaded).accepts(),
            count=count, every=every,
        )  # fmt: skip
