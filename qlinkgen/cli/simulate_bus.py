"""``qlinkgen simulate`` for a bus with a master: nodes that answer."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping

from qlinkgen.cli.behaviour import Behaviour, Nodes
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import load_protocol
from qlinkgen.cli.simulating import port_of, run_bus, say, watch_line
from qlinkgen.cli.wire_options import ANY_SPEED, counted, parse_nodes, with_crc
from qlinkgen.link.codec import Codec, Framed
from qlinkgen.link.many import has_endless
from qlinkgen.link.slave import Node, SlaveEngine
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.plan import plan_of
from qlinkgen.protocols.registry import codec_of, support_of
from qlinkgen.sim import FaultPlan, Wire
from qlinkgen.transport.conversation import OTHER_PROGRAM

#: Byte times from a request to its response on a paced line, so that the master can release the line.
TURNAROUND = 1


def simulate_bus(
    protocol: str,
    nodes: str | None,
    *,
    link: str | None,
    baud: int | None,
    plan: FaultPlan | None,
    echo: bool,
    crc: Replacement | None,
    behaviour: Behaviour,
    tap: str | None = None,
    traced: bool = False,
    record: str | None = None,
    listen: str | None = None,
) -> None:
    """Run the nodes on a pty until a signal."""
    from qlinkgen.sim.pty_bus import PtyBus  # noqa: PLC0415  # needs a system that has ptys
    from qlinkgen.transport.pty import open_pty  # noqa: PLC0415

    codec, numbered, delays = _nodes(protocol, nodes, crc, behaviour)
    bits = codec.BUS.bits_per_byte
    # A line delivers byte by byte; without a speed, whole frames are equivalent.
    wire = Wire(
        baud=baud,
        bits_per_byte=bits,
        faults=plan,
        echo=echo,
        collisions=not has_endless(codec),
        chunks="byte" if baud is not None else "frame",
    )
    turnaround = TURNAROUND * bits / baud if baud else 0.0
    engines = [SlaveEngine(codec, node, turnaround=turnaround, host_slack=OTHER_PROGRAM) for node in numbered]
    for engine in engines:
        engine.delays = delays
        wire.attach(engine, f"node {engine.node.number}")
    what = f"{counted(len(engines), 'node')} of {protocol}"
    with contextlib.ExitStack() as ended:
        if tap is not None:
            ear = ended.enter_context(open_pty(tap, baud=baud or ANY_SPEED))
            wire.taps.append(lambda _at, _source, data: ear.write(data))
        if traced or record is not None:
            loaded = load_protocol(protocol, crc)
            name = link or f"simulated {loaded.name}"
            watch_line(wire, loaded, load_codec(loaded), name, ended, traced=traced, record=record)
        run_bus(PtyBus(wire, link=link, port=port_of(listen, link, baud)), link, what)
    say(_summary(engines), plan)


def _nodes(
    name: str, nodes: str | None, crc: Replacement | None, behaviour: Behaviour
) -> tuple[Codec, list[Node], Mapping[type[Framed], float]]:
    protocol = load_protocol(name, crc)
    numbers = _numbers(protocol, nodes)
    written, packaged = support_of(protocol).nodes(numbers), codec_of(protocol)
    if written is not None and packaged is not None:
        if behaviour:
            raise Failure(
                f"nodes of {protocol.name} behave as documented, and take no values; omit --value, --values, "
                "--memory, --delay and --refuse"
            )
        return with_crc(packaged, packaged.Codec, crc), list(written), {}
    codec = load_codec(protocol)
    made = Nodes(protocol, codec, plan_of(protocol), behaviour)
    if not numbers:
        return codec, [made.node()], made.delays
    return codec, [made.node(number) for number in numbers], made.delays


def _numbers(protocol: Protocol, nodes: str | None) -> list[int]:
    """Return the addresses of the nodes, none if frames have no address."""
    if protocol.bus.nodes is None or protocol.address_name is None:
        if nodes is not None:
            raise Failure(f"the frames of {protocol.name} have no address; omit --nodes {nodes}")
        return []
    first, last = protocol.bus.nodes
    return parse_nodes(str(first) if nodes is None else nodes, first, last)


def _summary(engines: list[SlaveEngine]) -> str:
    counters = [engine.counters for engine in engines]
    answers = counted(sum(each.answers for each in counters), "answer")
    requests = counted(sum(each.requests for each in counters), "request")
    broadcasts = counted(max(each.broadcasts for each in counters), "broadcast")
    return f"{answers} to {requests}, {broadcasts}"
