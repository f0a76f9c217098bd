"""``qlinkgen simulate``: nodes that are not there, on a port that any program can open."""

from __future__ import annotations

import json
from collections.abc import Iterable

import click

from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import crc_option, load_protocol
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.wire_options import check_master_slave, counted, is_qlink, parse_nodes, select_crc
from qlinkgen.link.codec import Codec
from qlinkgen.link.slave import SlaveEngine, Station
from qlinkgen.sim import FaultPlan, FaultPlanError, Wire

#: Byte times from a request to its answer on a line that takes its time, so that the asker can stop sending.
TURNAROUND = 1


@click.command("simulate")
@click.argument("protocol")
@click.option(
    "--nodes", metavar="LIST", help="Numbers of the nodes: 3, 1-16 or 1,3,5-7; one node unless given."
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

    Faults are drop, flip, truncate, delay, late, duplicate, stray, noise and silent, each with its chance
    from 0 to 1 and, behind a colon, its extent; all=0.05 spreads 5 % over those not named; to=slaves or
    to=master keeps to one direction.

    \b
    qlinkgen simulate qlink --nodes 1-16 --link /tmp/qlink
    qlinkgen simulate qlink --nodes 1,3 --baud 115200 --faults drop=0.02,flip=0.01 --seed 7
    qlinkgen simulate thermostat.yaml --nodes 1-4
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    plan = _plan(faults, seed)
    codec, stations = _stations(protocol, nodes, crc)
    bits = codec.BUS.bits_per_byte
    # Byte by byte is how a line delivers; without a speed there is nothing to deliver in between.
    wire = Wire(
        baud=baud, bits_per_byte=bits, faults=plan, echo=echo, chunks="byte" if baud is not None else "frame"
    )
    turnaround = TURNAROUND * bits / baud if baud else 0.0
    engines = [SlaveEngine(codec, station, turnaround=turnaround) for station in stations]
    for engine in engines:
        wire.attach(engine, f"node {engine.station.number}")
    _run(wire, link, f"{counted(len(engines), 'node')} of {protocol}")
    click.echo(f"qlinkgen: {_summary(engines, plan)}", err=True)


def _plan(text: str | None, seed: int | None) -> FaultPlan | None:
    if text is None:
        return None
    try:
        plan = FaultPlan.parse(text)
        if seed is None:
            return plan
        return FaultPlan.parse(f"{text},seed={seed}")
    except FaultPlanError as error:
        raise Failure(f"--faults {text}: {error}") from None


def _stations(name: str, nodes: str | None, crc: str | None) -> tuple[Codec, list[Station]]:
    if is_qlink(name):
        from qlinkgen_codecs import qlink  # noqa: PLC0415  # other protocols do without

        select_crc(crc)
        return qlink, _qlink_nodes(parse_nodes(nodes or "1", 1, 16))
    from qlinkgen.cli.codec import load_codec  # noqa: PLC0415  # Q.link does without the compiler
    from qlinkgen.sim.generic import GenericNode  # noqa: PLC0415

    protocol = load_protocol(name, crc)
    check_master_slave(protocol, "simulate")
    codec = load_codec(protocol)
    if protocol.bus.nodes is None or protocol.address_name is None:
        if nodes is not None:
            raise Failure(f"the frames of {protocol.name} have no address; leave out --nodes {nodes}")
        return codec, [GenericNode(codec)]
    first, last = protocol.bus.nodes
    numbers = parse_nodes(str(first) if nodes is None else nodes, first, last)
    return codec, [GenericNode(codec, number) for number in numbers]


def _qlink_nodes(numbers: Iterable[int]) -> list[Station]:
    from qlinkgen.protocols.qlink import VirtualNode  # noqa: PLC0415  # other protocols do without
    from qlinkgen_codecs.qlink import PositionType  # noqa: PLC0415

    kind = PositionType.JVL_MACTALK  # a node without one tells no position
    return [VirtualNode(number, position_type=kind, serial_number=1000 + number) for number in numbers]


def _run(wire: Wire, link: str | None, what: str) -> None:
    from qlinkgen.sim.pty_bus import PtyBus  # noqa: PLC0415  # needs a system that has ptys

    bus = PtyBus(wire, link=link)
    try:
        with StopSignals(bus.request_stop):
            click.echo(json.dumps({"port": bus.path}))
            where = bus.path if link is None else f"{bus.path}, linked as {link}"
            click.echo(f"qlinkgen: {what} on {where}; Ctrl-C ends it", err=True)
            bus.run()
    finally:
        bus.close()


def _summary(engines: list[SlaveEngine], plan: FaultPlan | None) -> str:
    counters = [engine.counters for engine in engines]
    answers = counted(sum(each.answers for each in counters), "answer")
    requests = counted(sum(each.requests for each in counters), "request")
    broadcasts = counted(max(each.broadcasts for each in counters), "broadcast")
    text = f"{answers} to {requests}, {broadcasts}"
    if plan is None:
        return text
    kinds = ", ".join(f"{kind} {plan.counts[kind]}" for kind in plan.rates if plan.counts[kind])
    return f"{text}, {counted(plan.counts.total, 'fault')}{kinds and f' ({kinds})'}; seed {plan.seed}"
