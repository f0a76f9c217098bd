"""``qlinkgen simulate trio``: nodes of a ring, with the port between the last and the first."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, assert_never

import click

from qlinkgen.bus.ring_status import engine_of
from qlinkgen.cli.boundary import WRONG, Failure
from qlinkgen.cli.common import load_protocol
from qlinkgen.cli.ring_console import Console
from qlinkgen.cli.ring_programs import programs_of, run_closed, run_open, scripts_of
from qlinkgen.cli.simulating import port_of, ring_tap, run_bus, say
from qlinkgen.cli.wire_options import counted, with_crc
from qlinkgen.link.ring import RingCodec, RingNode
from qlinkgen.model.replacement import Replacement
from qlinkgen.protocols.trio.basic import Pointed, ProgrammedNode
from qlinkgen.protocols.trio.client import Node
from qlinkgen.protocols.trio.coordinator_node import CoordinatorNode
from qlinkgen.protocols.trio.keypad_node import KeypadNode
from qlinkgen.sim import FaultPlan, SimulationError
from qlinkgen.sim.virtual_ring import VirtualRing

if TYPE_CHECKING:
    from qlinkgen.sim.port_ring import RingBus

#: Default nodes of the ring.
RING = "coordinator"


def simulate_ring(
    ring: str | None,
    *,
    link: str | None,
    listen: str | None = None,
    baud: int | None,
    plan: FaultPlan | None,
    crc: Replacement | None,
    programs: Sequence[str] = (),
    pointed: Pointed | None = None,
    keys: Sequence[str] = (),
    closed: bool = False,
    seconds: float | None = None,
    record: str | None = None,
) -> None:
    """Run the ring until a signal, on a pty unless it is closed."""
    from qlinkgen.codecs import trio  # noqa: PLC0415  # only for Trio

    if plan is not None and plan.to != "both":
        raise Failure(f"--faults to={plan.to}: a ring has neither master nor slaves; omit to={plan.to}")
    if closed and link is not None:
        raise Failure(f"--link {link}: a closed ring has no port; omit --closed or --link")
    if closed and listen is not None:
        raise Failure(f"--listen {listen}: a closed ring has no port; omit --closed or --listen")
    codec: RingCodec = with_crc(trio, trio.Codec, crc)
    given = RING if ring is None else ring
    kinds = [kind.strip() for kind in given.split(",")]
    loaded, scripts = programs_of(programs, kinds, pointed), scripts_of(keys, kinds)
    places = [
        ProgrammedNode(loaded[at], codec=codec, baud=baud) if at in loaded else kind
        for at, kind in enumerate(kinds, 1)
    ]
    what = f"{counted(len(kinds), 'node')} of trio"
    with ExitStack() as ended:
        taps = []
        if record is not None:
            clock = (lambda: 0.0) if closed else time.monotonic
            loaded_trio = load_protocol("trio", crc)
            taps.append(ring_tap(loaded_trio, trio, ended, record=record, baud=baud, clock=clock))
        try:
            made = (
                VirtualRing(places, baud=baud, faults=plan, taps=taps, codec=codec)
                if closed
                else _with_port(places, link=link, listen=listen, baud=baud, plan=plan, codec=codec)
            )
        except SimulationError as error:
            raise Failure(f"--ring {given}: {error}") from None
        console = Console(made.wire, made.nodes, scripts)
        if isinstance(made, VirtualRing):
            run_closed(made, console, what=what, seconds=seconds)
        else:
            made.wire.taps += taps
            if loaded or scripts or console.drawn or seconds is not None:
                run_open(made, console, link=link, what=what, seconds=seconds)
            else:
                run_bus(made, link, what)
    for place, node in enumerate(made.nodes, 1):
        say(f"address {place}, {_account(node)}", None)
    say(_summary(made.nodes), plan)
    if console.failed:
        raise click.exceptions.Exit(WRONG)


def _with_port(
    places: Sequence[str | Node],
    *,
    link: str | None,
    listen: str | None,
    baud: int | None,
    plan: FaultPlan | None,
    codec: RingCodec,
) -> RingBus:
    from qlinkgen.sim.port_ring import ring_bus  # noqa: PLC0415  # needs a system that has ptys

    with ExitStack() as opened:  # closes the port if the ring cannot be made
        port = port_of(listen, link, baud)
        if port is not None:
            opened.callback(port.close)
        made = ring_bus(places, link=link, port=port, baud=baud, faults=plan, codec=codec)
        opened.pop_all()
        return made


def _account(node: Node) -> str:
    """Return the counters and the state of a node as text."""
    engine = engine_of(node)
    counters = engine.counters
    seen = f"{counters.taken} taken, {counters.passed} forwarded, NETSTAT {int(engine.netstat)}"
    match node:
        case CoordinatorNode():
            return f"coordinator: {seen}{_program(node)}{_received(node)}{_variables(node)}"
        case KeypadNode():
            return f"keypad: {seen}{_state(node)}"
        case RingNode():
            return f"passive: {seen}"
        case _:
            assert_never(node)


def _program(node: CoordinatorNode) -> str:
    if not isinstance(node, ProgrammedNode):
        return ""
    machine = node.machine
    if machine.failure is not None:
        return f"; program failed at {machine.failure.place}"
    return "; program ended" if machine.place is None else f"; program at {machine.place}"


def _received(node: CoordinatorNode) -> str:
    return f"; received {''.join(node.received)!r}" if node.received else ""


def _variables(node: CoordinatorNode) -> str:
    changed = [f"; VR({number}) = {value:g}" for number, value in enumerate(node.vr) if value]
    return "".join(changed)


def _state(node: KeypadNode) -> str:
    if node.offset is None:
        return f"; without offset, so it discarded {counted(node.link.counters.blocked, 'message')}"
    rows = [row for row in node.display.lines if row.strip()]
    shown = f"; display {' / '.join(map(repr, rows))}" if rows else ""
    return f"; offset {node.offset}{shown}"


def _summary(nodes: list[Node]) -> str:
    counters = [engine_of(node).counters for node in nodes]
    taken = counted(sum(each.taken for each in counters), "message")
    damaged = sum(each.total_faults for each in counters)
    return f"total: {taken} taken, {damaged} damaged"
