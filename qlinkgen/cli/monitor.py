"""``qlinkgen monitor``: what goes over a bus that is only listened to."""

from __future__ import annotations

import math

import click

from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import crc_option, load_protocol
from qlinkgen.cli.kinds import BUS, HOST, RING, Belongs, check_options, kind_of
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.wire_options import (
    Parity,
    baud_option,
    line_of,
    matching,
    open_free,
    open_usual,
    parity_option,
    seconds,
    slack_option,
    stop_bits_option,
)

BELONGS: Belongs = {"slack": (BUS,)}


@click.command("monitor")
@click.argument("port")
@click.option(
    "--protocol", default="qlink", show_default=True, metavar="PROTOCOL", help="What is spoken on the line."
)
@click.option("--json", "as_json", is_flag=True, help="One object a line instead of text.")
@click.option("--raw", is_flag=True, help="Add the bytes of each frame.")
@click.option("--count", type=click.IntRange(1), metavar="N", help="End after N frames, damaged ones too.")
@click.option("--seconds", "length", callback=seconds, metavar="SECONDS", help="End after this time.")
@baud_option
@slack_option
@parity_option
@stop_bits_option
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    port: str,
    protocol: str,
    as_json: bool,
    raw: bool,
    count: int | None,
    length: float | None,
    baud: int | None,
    slack: float | None,
    parity: Parity,
    stop_bits: str,
    crc: str | None,
) -> None:
    """Listen to a bus and print who asks whom and what is answered, until Ctrl-C. Nothing is ever sent.

    A line has seconds since the start, who spoke to whom, message, fields, and in brackets how long an answer
    took, or what is not as usual: repeat, late, not answered, a second answer, one to nothing. The times are
    those at which this computer got the bytes; --slack is what an answer may be late by for that.

    On a ring this is a listener on one fibre: it prints messages with the address that they have there. Of
    mc1231a, host and chip set have a line each, and an answer makes sense beside its request alone: it
    cannot be monitored.

    With --json a frame is an object as decode prints it, with "at", "from" and "to"; requests have "repeat",
    answers "delay" and "late", frames that answer nothing "stray". {"at", "unanswered": {...}} is a request
    without an answer, {"at", "asked", "error": {...}} a damaged frame, with the node that was being asked.

    \b
    qlinkgen monitor /dev/ttyUSB1
    qlinkgen monitor /dev/ttyUSB1 --json --count 1000 > traffic.jsonl
    qlinkgen monitor /dev/ttyUSB1 --protocol trio --baud 38400
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc)
    kind = kind_of(loaded)
    if kind is HOST:
        raise Failure(
            f"{loaded.name} cannot be monitored: host and device have a line each, and an answer makes sense "
            "beside its request alone; what the host says is shown by "
            f"`qlinkgen decode {loaded.name} --direction request --raw < {port}`"
        )
    check_options(loaded.name, kind, BELONGS)
    codec = load_codec(loaded)
    line = line_of(parity, stop_bits)
    opener = open_free if kind is RING else open_usual
    with StopSignals() as signals, opener(loaded, port, baud, line) as opened:
        end = math.inf if length is None else opened.now() + length
        click.echo(f"qlinkgen: listening to {loaded.name} on {port}; Ctrl-C ends it", err=True)
        if kind is RING:
            from qlinkgen.cli.monitor_ring import monitor_ring  # noqa: PLC0415  # each kind loads its own

            monitor_ring(loaded, codec, opened, signals, as_json=as_json, raw=raw, count=count, end=end)
        else:
            from qlinkgen.cli.monitor_bus import monitor_bus  # noqa: PLC0415

            monitor_bus(
                loaded, codec, opened, signals, as_json=as_json, raw=raw, count=count, end=end, slack=slack,
                accepts=matching(protocol),
            )  # fmt: skip
