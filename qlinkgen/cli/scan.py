"""``qlinkgen scan``: find the nodes of a Q.link bus."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.arguments import driven_protocol_argument, port_argument
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.common import crc_option, on_terminal, warn
from qlinkgen.cli.kinds import is_shipped
from qlinkgen.cli.tables import Table
from qlinkgen.cli.wire_options import (
    baud_option,
    echo_option,
    open_line,
    parse_nodes,
    slack_option,
    with_crc,
)
from qlinkgen.codecs import qlink
from qlinkgen.codecs.qlink import PositionType
from qlinkgen.link.echo import EchoMode
from qlinkgen.link.events import Sent
from qlinkgen.model.values import Json
from qlinkgen.protocols.qlink import Bus, Found
from qlinkgen.protocols.qlink.facts import BAUD, NODES


@click.command("scan")
@driven_protocol_argument
@port_argument
@click.option(
    "--nodes", default="1-16", show_default=True, metavar="LIST", help="Nodes to ask: 3, 1-16 or 1,3,5-7."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per line instead of a table.")
@baud_option
@slack_option
@echo_option
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    port: str,
    nodes: str,
    as_json: bool,
    baud: int | None,
    slack: float | None,
    echo: EchoMode | None,
    crc: str | None,
) -> int:
    """Ask every node of a Q.link bus for its identity, and print those that answer.

    Silent nodes are asked again after all others, and finally with loop_back: not every node supports
    node_info. The time is that from request to response. A node is garbled if the bytes received are not an
    answer: two nodes have its number, or the speed is wrong.

    Exit code 1 if no node answers clearly, or if the port is missing, busy or lost.

    \b
    qlinkgen scan qlink /dev/ttyUSB0
    qlinkgen scan qlink /dev/ttyUSB0 --nodes 1-4 --json
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    if not is_shipped(protocol, "qlink"):
        raise Failure(f"{protocol} cannot be scanned; qlink can")
    numbers = parse_nodes(nodes, NODES[0], NODES[-1])
    with_crc(qlink, qlink.Codec, crc)
    with open_line(port, baud or BAUD) as opened:
        bus = Bus(opened, echo=echo or "auto", health=None, slack=slack, crc=crc)
        with _progress() as show:
            bus.on_event = lambda event: show(event.node) if isinstance(event, Sent) else None
            found = bus.scan(numbers)
    if not found:
        look = f"`qlinkgen doctor {protocol} {port}`"
        warn(f"no node answers on {port}; check power, wiring and --baud, and {look}")
        return WRONG
    if as_json:
        click.echo("\n".join(jsonlines.line(_record(each)) for each in found))
    else:
        _table(found).show()
    return WRONG if all(each.garbled for each in found) else FINE


@contextlib.contextmanager
def _progress() -> Iterator[Callable[[int | None], None]]:
    """Show the current node on a terminal."""
    if not on_terminal(sys.stderr):
        yield lambda _: None
        return
    from rich.console import Console  # noqa: PLC0415  # only a terminal needs it

    with Console(stderr=True).status("looking for nodes") as status:
        yield lambda node: status.update(f"looking for nodes: {node}")


def _record(found: Found) -> dict[str, Json]:
    info = found.info
    return {
        "node": found.node,
        "version": None if info is None else _version(info),
        "product_id": None if info is None else info.product_id,
        "serial_number": None if info is None else info.serial_number,
        "t1_delay": None if info is None else info.t1_delay,
        "t2_delay": None if info is None else info.t2_delay,
        "position_type": None if info is None else _position_type(info.position_type),
        "seconds": round(found.seconds, 6),
        "garbled": found.garbled,
    }


def _version(info: qlink.NodeInfoResponse) -> str:
    return f"{info.version_major}.{info.version_minor}"


def _position_type(value: int) -> str | int:
    return PositionType(value).name.lower() or value


def _table(found: list[Found]) -> Table:
    table = Table(
        ["node", "version", "product", "serial", "answer time", "note"],
        right=frozenset({"node", "version", "product", "serial", "answer time"}),
    )
    for each in found:
        time, info = f"{each.seconds * 1000:.2f} ms", each.info
        if each.garbled:
            table.add(
                each.node, None, None, None, None, "garbled: two nodes with this number, or a wrong --baud"
            )
        elif info is None:
            table.add(each.node, None, None, None, time, "does not support node_info")
        else:
            table.add(each.node, _version(info), info.product_id, info.serial_number, time, None)
    return table
