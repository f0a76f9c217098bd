"""``qlinkgen simulate``: simulated nodes on a port that any program can open."""

from __future__ import annotations

from typing import Literal

import click
from click.core import ParameterSource

from qlinkgen.cli.arguments import protocol_argument
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import crc_option, load_protocol
from qlinkgen.cli.kinds import BUS, HOST, RING, Belongs, Kind, check_options, kind_of
from qlinkgen.cli.simulating import plan_of
from qlinkgen.cli.tracing import record_option, trace_option
from qlinkgen.cli.wire_options import seconds
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.protocols.registry import support_of, supported

BELONGS: Belongs = {
    **dict.fromkeys(("nodes", "echo", "refuse", "tap", "traced"), (BUS,)),
    **dict.fromkeys(("value", "file", "memory", "delay"), (BUS, HOST)),
    **dict.fromkeys(("ring", "programs", "keys", "closed", "length", "pointed"), (RING,)),
    "crc": (BUS, RING),
}

#: Options of rings with programs and keypads.
_WRITTEN = frozenset({"programs", "keys", "closed", "length", "pointed"})


@click.command("simulate")
@protocol_argument
@click.option("--nodes", metavar="LIST", help="Nodes of a bus: 3, 1-16 or 1,3,5-7; one node by default.")
@click.option(
    "--value",
    multiple=True,
    metavar="COMMAND.FIELD=VALUE",
    help="A value of the answers of a bus; for numbers also ramp:0..100:5s or noise:21:0.5.",
)
@click.option(
    "--values",
    "file",
    type=click.Path(),
    metavar="FILE",
    help="A YAML file with values, delay, refuse, memory and tables.",
)
@click.option("--memory", is_flag=True, help="Answer with what requests have set, by the names of fields.")
@click.option(
    "--delay",
    multiple=True,
    metavar="COMMAND=SECONDS",
    help="Answer a command so much later.",
)
@click.option(
    "--refuse", multiple=True, metavar="COMMAND=PROBABILITY", help="Refuse a command, 1 for every time."
)
@click.option(
    "--ring",
    metavar="LIST",
    help="Nodes of a ring in order: coordinator, keypad, passive; one coordinator by default.",
)
@click.option(
    "--program",
    "programs",
    multiple=True,
    metavar="N=FILE",
    help="Run a Trio BASIC program on the coordinator with address N.",
)
@click.option(
    "--point-format",
    "pointed",
    type=click.Choice(["before", "width"]),
    help="The 6 of PRINT #10,x[6.1]: the places before the point (default), or the width.",
)
@click.option(
    "--keys",
    multiple=True,
    metavar="N=KEYS",
    help="Press keys on the keypad with address N: 1 5 enter 0.5s + 42.",
)
@click.option("--closed", is_flag=True, help="Connect the last node of a ring to the first: no port.")
@click.option("--seconds", "length", callback=seconds, metavar="SECONDS", help="End a ring after this time.")
@click.option("--link", type=click.Path(), metavar="PATH", help="Create a symbolic link to the port.")
@click.option(
    "--listen",
    metavar="tcp:PORT",
    help="Listen on a TCP port in place of a pty, 0 for a free one; tcp:HOST:PORT, 127.0.0.1 by default.",
)
@click.option(
    "--tap",
    type=click.Path(),
    metavar="PATH",
    help="Create a link to a second port, where all bytes of a bus can be read.",
)
@trace_option
@record_option
@click.option("--faults", metavar="SPEC", help="Faults: drop=0.01,late=0.02:0.05-0.2 or all=0.05.")
@click.option("--seed", type=int, metavar="N", help="Seed of faults, noise and refusals.")
@click.option(
    "--baud",
    type=click.IntRange(1, 100_000_000),
    metavar="N",
    help="Simulate this baud rate; without it, responses are immediate.",
)
@click.option("--echo", is_flag=True, help="Echo the bytes sent, as two-wire adapters do.")
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    nodes: str | None,
    value: tuple[str, ...],
    file: str | None,
    memory: bool,
    delay: tuple[str, ...],
    refuse: tuple[str, ...],
    ring: str | None,
    programs: tuple[str, ...],
    pointed: Literal["before", "width"] | None,
    keys: tuple[str, ...],
    closed: bool,
    length: float | None,
    link: str | None,
    listen: str | None,
    tap: str | None,
    traced: bool,
    record: str | None,
    faults: str | None,
    seed: int | None,
    baud: int | None,
    echo: bool,
    crc: Replacement | None,
) -> None:
    """Simulate nodes on a new port (a pty, or TCP) until Ctrl-C or SIGTERM.

    The first line on standard output is {"port": "/dev/pts/N"}, once the port is ready. All other output goes
    to standard error, including a final summary of requests, responses and faults.

    Nodes of qlink behave as documented: FIFO, motor, inputs and outputs, program store; they consume path
    words after a node_start. Nodes of another PROTOCOL with a master send the defaults of each response, or
    the values given, with echoed fields copied from the request. COMMAND is a command or the full name of an
    answer, VALUE as for encode; --memory answers with the latest value that any request has had for a field
    of the same name and kind.

    trio is a ring: PORT is an additional place between the last node and the first, which then has address 1.
    Coordinators keep the data they receive, and run the network words of a BASIC program given by --program.
    A keypad forwards nothing before it has its offset. On a terminal the displays of keypads are drawn, and
    keys are typed; with --keys or --program they are otherwise printed as {"at", "address", "display"}.
    With --closed the ring has no port, and "port" is null; without a keyboard its time is simulated and
    passes at once, until nothing more can happen or 10 s after the last key.

    Nodes of another ring forward messages, and print those to them as decode does, with "at" and "node".

    mc1231a is a chip set with two moving axes. The device of another host answers as nodes do.

    Faults are drop, flip, truncate, delay, late, duplicate, stray, noise and silent, each with a probability
    from 0 to 1 and, after a colon, its extent; all=0.05 spreads 5 % over those not listed; to=slaves or
    to=master restricts them to one direction. On a ring they occur on every fibre.

    \b
    qlinkgen simulate qlink --nodes 1-16 --link /tmp/qlink
    qlinkgen simulate qlink --listen tcp:5000
    qlinkgen simulate qlink --nodes 1,3 --baud 115200 --faults drop=0.02,flip=0.01 --seed 7
    qlinkgen simulate thermostat.yaml --nodes 1-4 --value get_zones.temperatures=250,251
    qlinkgen simulate trio --ring coordinator,keypad,coordinator --link /tmp/ring
    qlinkgen simulate trio --ring coordinator,keypad --closed --program 1=main.bas
    qlinkgen simulate mc1231a --link /tmp/chip
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    kind = _kind(protocol, crc)
    plan = plan_of(faults, seed)
    if kind is RING and not support_of(load_protocol(protocol, crc)).simulated:
        from qlinkgen.cli.simulate_nodes import simulate_nodes  # noqa: PLC0415

        simulate_nodes(protocol, ring, link=link, listen=listen, baud=baud, plan=plan, crc=crc, record=record)
    elif kind is RING:
        from qlinkgen.cli.simulate_ring import simulate_ring  # noqa: PLC0415  # only for rings

        simulate_ring(
            ring,
            link=link,
            listen=listen,
            baud=baud,
            plan=plan,
            crc=crc,
            programs=programs,
            pointed=pointed,
            keys=keys,
            closed=closed,
            seconds=length,
            record=record,
        )
    elif kind is HOST:
        from qlinkgen.cli.behaviour import Behaviour  # noqa: PLC0415
        from qlinkgen.cli.simulate_host import simulate_host  # noqa: PLC0415

        simulate_host(
            protocol,
            link=link,
            listen=listen,
            baud=baud,
            plan=plan,
            behaviour=Behaviour(value, file, delay, refuse, memory, seed),
            record=record,
        )
    else:
        from qlinkgen.cli.behaviour import Behaviour  # noqa: PLC0415
        from qlinkgen.cli.simulate_bus import simulate_bus  # noqa: PLC0415

        behaviour = Behaviour(value, file, delay, refuse, memory, seed)
        simulate_bus(
            protocol,
            nodes,
            link=link,
            listen=listen,
            baud=baud,
            plan=plan,
            echo=echo,
            crc=crc,
            behaviour=behaviour,
            tap=tap,
            traced=traced,
            record=record,
        )


def _kind(name: str, crc: Replacement | None) -> Kind:
    """Return the kind of a protocol; refuse kinds that cannot be simulated, and options of other kinds."""
    protocol = load_protocol(name, crc)
    kind = kind_of(protocol)
    check_options(protocol.name, kind, BELONGS)
    if kind is RING and not support_of(protocol).simulated:
        _check_written(protocol)
    if kind is BUS and not protocol.commands:
        raise Failure(
            f"{protocol.name} has no commands, only messages, so its nodes have nothing to answer; "
            "use `qlinkgen send` to send its messages"
        )
    return kind


def _check_written(protocol: Protocol) -> None:
    """Refuse options of rings that need behaviour written by hand."""
    context = click.get_current_context()
    for parameter in context.command.params:
        name = parameter.name or ""
        given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if given and name in _WRITTEN:
            known = " and ".join(supported(protocol.bus.kind))
            raise Failure(
                f"{parameter.opts[-1]} is for {known}; nodes of {protocol.name} are passive: omit it"
            )
