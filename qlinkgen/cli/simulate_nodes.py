"""``qlinkgen simulate`` for a ring of one's own: nodes that forward, and print the messages to them."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import load_protocol
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.simulating import port_of, ring_tap, run_bus, say
from qlinkgen.cli.wire_options import counted
from qlinkgen.link.codec import Framed
from qlinkgen.link.ring import RingNode
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.sim import FaultPlan, SimulationError
from qlinkgen.sim.ring import RingWire

#: The only kind of node whose behaviour the schema tells.
_KIND = "passive"


def simulate_nodes(
    name: str,
    ring: str | None,
    *,
    link: str | None,
    listen: str | None,
    baud: int | None,
    plan: FaultPlan | None,
    crc: Replacement | None,
    record: str | None,
) -> None:
    """Run the nodes on a pty until a signal."""
    from qlinkgen.sim.pty_bus import PtyBus  # noqa: PLC0415  # needs a system that has ptys

    kinds = [kind.strip() for kind in (ring or _KIND).split(",")]
    if unknown := next((kind for kind in kinds if kind != _KIND), None):
        raise Failure(f"--ring {ring}: unknown kind of node {unknown!r}; nodes of {name} are {_KIND}")
    if plan is not None and plan.to != "both":
        raise Failure(f"--faults to={plan.to}: a ring has neither master nor slaves; omit to={plan.to}")
    protocol = load_protocol(name, crc)
    codec = load_codec(protocol)
    wire = RingWire(codec, baud=baud, faults=plan)
    start = time.monotonic()
    nodes = [RingNode(codec, _printer(protocol, place, start), baud=baud) for place, _ in enumerate(kinds, 1)]
    try:
        for place, node in enumerate(nodes, 1):
            wire.attach(node, f"node {place}")
    except SimulationError as error:
        raise Failure(f"--ring {ring}: {error}") from None
    port = port_of(listen, link, baud)
    with ExitStack() as ended:
        bus = PtyBus(wire, link=link, port=port)
        if record is not None:
            wire.taps.append(ring_tap(protocol, codec, ended, record=record, baud=baud, clock=time.monotonic))
        run_bus(bus, link, f"{counted(len(nodes), 'node')} of {name}")
    for place, node in enumerate(nodes, 1):
        seen = node.counters
        what = f"{seen.taken} taken, {seen.passed} forwarded, {seen.total_faults} damaged"
        say(f"address {place}: {what}", plan if place == len(nodes) else None)


def _printer(protocol: Protocol, place: int, start: float) -> Callable[[Framed, float], None]:
    """Return what prints the messages to the node at a place, with the seconds since the start."""

    def show(message: Framed, now: float) -> None:
        told = {"at": round(now - start, 6), "node": place, **message_record(protocol, message)}
        click.echo(jsonlines.line(told))

    return show
