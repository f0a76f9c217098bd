"""``qlinkgen doctor``: report the abilities of a port, its latency, and what to change."""

from __future__ import annotations

import json
from dataclasses import asdict
from enum import Enum

import click

from qlinkgen.cli.arguments import driven_protocol_argument, port_argument
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import load_protocol, on_terminal
from qlinkgen.cli.diagnosis import Advice, Cost, Echo, advise, cost, probe
from qlinkgen.cli.tables import Table
from qlinkgen.cli.wire_options import baud_option, echo_mode, open_free, seconds
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import Json
from qlinkgen.transport.conversation import ASSUMED_LATENCY, OTHER_PROGRAM, WAKE_UP
from qlinkgen.transport.port import Ability, Capabilities, Port

_MEANINGS = {
    "exclusive": {
        Ability.YES: "other programs cannot open it meanwhile",
        Ability.NO: "other programs may open it and send",
        Ability.UNKNOWN: "depends on the remote end",
    },
    "low_latency": {
        Ability.YES: "received bytes are delivered immediately",
        Ability.NO: "received bytes are buffered first",
        Ability.UNKNOWN: "received bytes may be buffered first",
    },
    "rs485": {
        Ability.YES: "the driver switches the transceiver",
        Ability.NO: "the adapter has to switch the transceiver",
        Ability.UNKNOWN: "the remote end has to switch the transceiver",
    },
    "paced": {
        Ability.YES: "bytes are transmitted at the baud rate",
        Ability.NO: "bytes arrive immediately, at any baud rate",
        Ability.UNKNOWN: "bytes may ignore the baud rate",
    },
}


@click.command("doctor")
@driven_protocol_argument
@port_argument
@baud_option
@click.option(
    "--probe", "probing", is_flag=True, help="Send one byte 00, which begins no frame, and listen for it."
)
@click.option(
    "--find-line",
    "finding",
    is_flag=True,
    help="Listen at one speed and parity after another until frames are valid; with --baud, at that speed.",
)
@click.option(
    "--seconds",
    "length",
    callback=seconds,
    default="1",
    show_default=True,
    metavar="SECONDS",
    help="Time to listen at each setting.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of text.")
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str, port: str, baud: int | None, probing: bool, finding: bool, length: float, as_json: bool
) -> int:
    """Open PORT and report what it can do, how its latency affects a transaction, and what to change.

    PORT is a device such as /dev/ttyUSB0 or COM3, or a URL such as socket://HOST:PORT. The transaction is the
    longest one of PROTOCOL; a ring has none. Nothing is sent without --probe.

    --find-line needs traffic on the line. A port does not check the parity of what it receives, so even and
    odd are often both found. Exit code 1 if no setting gives a valid frame.

    Exit code 1 if a line begins with fix, or if the port is missing, busy or lost.

    \b
    qlinkgen doctor qlink /dev/ttyUSB0
    qlinkgen doctor modbus_rtu /dev/ttyUSB0 --baud 9600 --json
    qlinkgen doctor modbus_rtu /dev/ttyUSB0 --find-line
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol)
    if finding:
        from qlinkgen.cli.line_search import find_line  # noqa: PLC0415  # only this option needs it

        return find_line(loaded, load_codec(loaded), port, baud, length=length, as_json=as_json)
    if probing and echo_mode(loaded, None) != "auto":
        raise Failure(f"--probe: a frame of {loaded.name} may begin with 00, the byte to send; omit it")
    with open_free(loaded, port, baud) as opened:
        echo = probe(opened) if probing else None
        advice = advise(opened, port, echo)
        show = _show_json if as_json else _show_text
        show(opened, _cost(opened, loaded), echo, advice)
    return WRONG if any(each.kind == "fix" for each in advice) else FINE


def _cost(port: Port, protocol: Protocol) -> Cost | None:
    """Return the cost of a transaction, None for a protocol without transactions."""
    return cost(port, load_codec(protocol)) if protocol.commands else None


def _show_json(port: Port, total: Cost | None, echo: Echo | None, advice: list[Advice]) -> None:
    found = {key: _plain(value) for key, value in asdict(port.capabilities).items()}
    answer = {
        "port": port.name,
        "baud": port.baud,
        **found,
        "transaction": None if total is None else asdict(total),
        "echo": None if echo is None else asdict(echo),
        "advice": [asdict(each) for each in advice],
    }
    click.echo(json.dumps(answer, indent=2))


def _plain(value: Json | Enum) -> Json:
    if isinstance(value, Enum):
        plain: Json = value.value
        return plain
    return value


def _show_text(port: Port, total: Cost | None, echo: Echo | None, advice: list[Advice]) -> None:
    _abilities(port, echo).show()
    if total is not None:
        _terms(port, total).show()
    for each in advice:
        colour = {"fix": "yellow", "note": "cyan"}[each.kind]
        kind = click.style(each.kind, fg=colour, bold=True) if on_terminal() else each.kind
        click.echo(f"{kind}: {each.text}")


def _abilities(port: Port, echo: Echo | None) -> Table:
    found = port.capabilities
    table = Table(["ability", "found", "meaning"], f"{port.name} at {port.baud} baud")
    table.add("driver", found.driver or "unknown", "")
    for key, meanings in _MEANINGS.items():
        ability: Ability = getattr(found, key)
        table.add(key.replace("_", " "), ability, meanings[ability])
    table.add("latency", _latency(found), found.latency_source)
    if echo is not None:
        table.add("local echo", *_echo(echo))
    return table


def _latency(found: Capabilities) -> str:
    return "unknown" if found.latency is None else _time(found.latency)


def _echo(echo: Echo) -> tuple[str, str]:
    if echo.heard is None:
        return "unknown", f"unexpected bytes: {echo.received[:32]}"
    if not echo.heard:
        return "no", "the port does not receive its own bytes"
    return "yes", f"the port receives its own bytes, after {_time(echo.seconds or 0.0)}"


def _terms(port: Port, total: Cost) -> Table:
    latency = port.capabilities.latency
    held = (
        f"an unknown latency, assumed to be {_time(ASSUMED_LATENCY)}"
        if latency is None
        else f"{_time(latency)} of latency"
    )
    table = Table(
        ["term", "time", "reason"], f"One {total.command}, the longest transaction", right=frozenset({"time"})
    )
    size = f"{total.longest} bytes, the longest request and response"
    table.add("on the wire", _time(total.on_wire), size)
    table.add("allowance", _time(total.allowance), "for the node to begin its response")
    other = f", {_time(OTHER_PROGRAM)} for the program at its other end" * (
        port.capabilities.paced is Ability.NO
    )
    woken = f"{held}{other}, and {_time(WAKE_UP)} to wake this program"
    table.add("host slack", _time(total.host_slack), woken)
    if total.frame_ends:
        table.add("silence", _time(total.frame_ends), "a silence or break that separates frames")
    table.add(
        "deadline", _time(total.deadline), "the sum; without a response until then, the request is repeated"
    )
    return table


def _time(seconds: float) -> str:
    return f"{seconds * 1e6:.0f} us" if seconds < 0.001 else f"{seconds * 1000:.2f} ms"
