"""``qlinkgen monitor``: listen passively to a bus."""

from __future__ import annotations

import math
from contextlib import ExitStack
from types import ModuleType

import click

from qlinkgen.cli.arguments import driven_protocol_argument, optional_port_argument
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import crc_option, load_protocol
from qlinkgen.cli.kinds import BUS, HOST, RING, Belongs, check_options, kind_of
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.tracing import Listener, record_option
from qlinkgen.cli.wire_options import (
    Parity,
    baud_option,
    line_of,
    open_free,
    open_usual,
    parity_option,
    seconds,
    slack_option,
    stop_bits_option,
)
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.protocols.registry import support_of

BELONGS: Belongs = {"slack": (BUS,)}


@click.command("monitor")
@driven_protocol_argument
@optional_port_argument
@click.option("--capture", metavar="FILE", help="Listen to the traffic of a capture instead of a port.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per line instead of text.")
@click.option("--raw", is_flag=True, help="Add the bytes of each frame.")
@click.option("--count", type=click.IntRange(1), metavar="N", help="End after N frames, damaged ones too.")
@click.option("--seconds", "length", callback=seconds, metavar="SECONDS", help="End after this time.")
@record_option
@baud_option
@slack_option
@parity_option
@stop_bits_option
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    port: str | None,
    capture: str | None,
    as_json: bool,
    raw: bool,
    count: int | None,
    length: float | None,
    record: str | None,
    baud: int | None,
    slack: float | None,
    parity: Parity,
    stop_bits: str,
    crc: Replacement | None,
) -> int | None:
    """Listen to a bus and print requests and responses, until Ctrl-C. Nothing is sent.

    A line has seconds since the start, sender and receiver, message, fields, and in brackets the delay of a
    response or irregularities: repeat, late, not answered, second answer, stray response. Times are those
    at which this computer received the bytes; --slack is the delay that this may add to a response.

    With --capture, this tells what it would have heard of the traffic of a file as of decode, with the times
    of the file.

    On a ring, this listens to one fibre and prints messages with their address on that fibre. mc1231a cannot
    be monitored: host and chip set have separate lines, and a response has a meaning only with its request.

    With --json, a frame is an object as printed by decode, with "at", "from" and "to"; requests have
    "repeat", responses "delay" and "late", stray frames "stray". {"at", "unanswered": {...}} is a request
    without a response, {"at", "asked", "error": {...}} a damaged frame, with the node of the pending request.

    \b
    qlinkgen monitor qlink /dev/ttyUSB1
    qlinkgen monitor qlink /dev/ttyUSB1 --json --count 1000 > traffic.jsonl
    qlinkgen monitor qlink --capture line.pcapng
    qlinkgen monitor trio /dev/ttyUSB1 --baud 38400
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    if (port is None) is (capture is None):
        raise Failure("give a PORT, or --capture FILE in place of it")
    loaded = load_protocol(protocol, crc)
    kind = kind_of(loaded)
    if kind is HOST:
        raise Failure(
            f"{loaded.name} cannot be monitored: host and device have separate lines, and a response has a "
            "meaning only with its request; to see the requests, use "
            f"`qlinkgen decode {loaded.name} --direction request --raw < {port}`"
        )
    check_options(loaded.name, kind, BELONGS)
    codec = load_codec(loaded)
    if capture is not None:
        return _of_capture(
            loaded, codec, capture, as_json=as_json, raw=raw, count=count, baud=baud, slack=slack
        )
    assert port is not None  # one of both is given
    line = line_of(parity, stop_bits)
    opener = open_free if kind is RING else open_usual
    with ExitStack() as ended, StopSignals() as signals, opener(loaded, port, baud, line) as opened:
        listener = None if record is None else Listener(ended, record, port, opened, codec)
        end = math.inf if length is None else opened.now() + length
        click.echo(f"qlinkgen: listening to {loaded.name} on {port}; press Ctrl-C to stop", err=True)
        if kind is RING:
            from qlinkgen.cli.monitor_ring import monitor_ring  # noqa: PLC0415  # only for rings

            monitor_ring(
                loaded, codec, opened, signals, as_json=as_json, raw=raw, count=count, end=end,
                listener=listener,
            )  # fmt: skip
        else:
            from qlinkgen.cli.monitor_bus import monitor_bus  # noqa: PLC0415

            monitor_bus(
                loaded, codec, opened, signals, as_json=as_json, raw=raw, count=count, end=end, slack=slack,
                accepts=support_of(loaded).accepts(), listener=listener,
            )  # fmt: skip
    return None


def _of_capture(
    protocol: Protocol,
    codec: ModuleType,
    capture: str,
    *,
    as_json: bool,
    raw: bool,
    count: int | None,
    baud: int | None,
    slack: float | None,
) -> int:
    if not protocol.commands:
        raise Failure(
            f"{protocol.name} has no answers that a monitor matches to requests; to see the messages, use "
            f"`qlinkgen decode {protocol.name} {capture}`"
        )
    speed = baud or protocol.bus.baud
    if speed is None:
        raise Failure(f"the schema of {protocol.name} states no speed; give --baud")
    from qlinkgen.cli.monitor_capture import monitor_capture  # noqa: PLC0415  # only for captures

    return monitor_capture(
        protocol, codec, capture, as_json=as_json, raw=raw, count=count, baud=speed, slack=slack,
        accepts=support_of(protocol).accepts(),
    )  # fmt: skip
