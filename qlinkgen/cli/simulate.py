"""``qlinkgen simulate``: nodes that are not there, on a port that any program can open."""

from __future__ import annotations

import click

from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import crc_option, load_protocol
from qlinkgen.cli.kinds import BUS, HOST, RING, Belongs, Kind, check_options, kind_of, shipped_kind
from qlinkgen.cli.simulating import plan_of

BELONGS: Belongs = {"nodes": (BUS,), "echo": (BUS,), "ring": (RING,), "crc": (BUS, RING)}


@click.command("simulate")
@click.argument("protocol")
@click.option(
    "--nodes", metavar="LIST", help="Numbers of nodes on a bus: 3, 1-16 or 1,3,5-7; one node unless given."
)
@click.option(
    "--ring",
    metavar="LIST",
    help="Nodes of a ring in their order, of coordinator, keypad and passive; one coordinator unless given.",
)
@click.option(
    "--link", type=click.Path(), metavar="PATH", help="Make a symbolic link to the port, under this name."
)
@click.option("--faults", metavar="SPEC", help="What goes wrong: drop=0.01,late=0.02:0.05-0.2 or all=0.05.")
@click.option("--seed", type=int, metavar="N", help="Seed of the faults; the same one, the same faults.")
@click.option(
    "--baud",
    type=click.IntRange(1, 100_000_000),
    metavar="N",
    help="Let bytes take their time; without it answers come at once.",
)
@click.option("--echo", is_flag=True, help="Hand back what is sent, as two-wire adapters do.")
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    nodes: str | None,
    ring: str | None,
    link: str | None,
    faults: str | None,
    seed: int | None,
    baud: int | None,
    echo: bool,
    crc: str | None,
) -> None:
    """Put simulated nodes on a new port (a pty) until Ctrl-C or SIGTERM.

    The first line on standard output is {"port": "/dev/pts/N"}, when the port can be used. Everything else
    goes to standard error, at the end a summary of requests, answers and faults.

    Nodes of qlink behave as the document says: FIFO, motor, inputs and outputs, program store; they consume
    path words after a node_start. Nodes of another PROTOCOL where one master asks and nodes answer send the
    defaults of each response, and repeat what it has to repeat.

    trio is a ring: PORT is a place of its own between the last node and the first, which has address 1 then.
    No program runs on a coordinator; it keeps what it is sent. A keypad sends nothing on before it has its
    offset. mc1231a is a chip set with two axes that move.

    Faults are drop, flip, truncate, delay, late, duplicate, stray, noise and silent, each with its chance
    from 0 to 1 and, behind a colon, its extent; all=0.05 spreads 5 % over those not named; to=slaves or
    to=master keeps to one direction. On a ring they happen on every fibre.

    \b
    qlinkgen simulate qlink --nodes 1-16 --link /tmp/qlink
    qlinkgen simulate qlink --nodes 1,3 --baud 115200 --faults drop=0.02,flip=0.01 --seed 7
    qlinkgen simulate thermostat.yaml --nodes 1-4
    qlinkgen simulate trio --ring coordinator,keypad,coordinator --link /tmp/ring
    qlinkgen simulate mc1231a --link /tmp/chip
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    kind = _kind(protocol, crc)
    plan = plan_of(faults, seed)
    if kind is RING:
        from qlinkgen.cli.simulate_ring import simulate_ring  # noqa: PLC0415  # each kind loads its own

        simulate_ring(ring, link=link, baud=baud, plan=plan, crc=crc)
    elif kind is HOST:
        from qlinkgen.cli.simulate_host import simulate_host  # noqa: PLC0415

        simulate_host(link=link, baud=baud, plan=plan)
    else:
        from qlinkgen.cli.simulate_bus import simulate_bus  # noqa: PLC0415

        simulate_bus(protocol, nodes, link=link, baud=baud, plan=plan, echo=echo, crc=crc)


def _kind(name: str, crc: str | None) -> Kind:
    """The kind of a protocol that can be simulated, and the options are those of this kind."""
    shipped = shipped_kind(name)
    if shipped is not None:
        check_options(*shipped, BELONGS)
        return shipped[1]
    protocol = load_protocol(name, crc)
    kind = kind_of(protocol)
    if kind is not BUS:
        known = "trio" if kind is RING else "mc1231a"
        raise Failure(
            f"{protocol.name}: of a schema of your own, `qlinkgen simulate` has nodes where one master "
            f"asks and nodes answer (bus kind master_slave); of a {kind.value} it has {known} alone"
        )
    check_options(protocol.name, kind, BELONGS)
    if not protocol.commands:
        raise Failure(
            f"{protocol.name} has no commands, only messages, so its nodes have nothing to answer; "
            "`qlinkgen send` puts its messages on a line"
        )
    return kind
