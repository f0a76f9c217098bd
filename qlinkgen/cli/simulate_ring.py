"""``qlinkgen simulate trio``: nodes of a ring, with the port between the last and the first."""

from __future__ import annotations

from typing import assert_never

from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.simulating import run_bus, say
from qlinkgen.cli.wire_options import counted, with_crc
from qlinkgen.link.ring import RingCodec, RingNode
from qlinkgen.protocols.trio.client import Node, engine_of
from qlinkgen.protocols.trio.coordinator_node import CoordinatorNode
from qlinkgen.protocols.trio.keypad_node import KeypadNode
from qlinkgen.sim import FaultPlan, SimulationError

#: Default nodes of the ring.
RING = "coordinator"


def simulate_ring(
    ring: str | None, *, link: str | None, baud: int | None, plan: FaultPlan | None, crc: str | None
) -> None:
    """Run the ring on a pty until a signal."""
    from qlinkgen.codecs import trio  # noqa: PLC0415  # only for Trio
    from qlinkgen.sim.port_ring import ring_bus  # noqa: PLC0415  # needs a system that has ptys

    if plan is not None and plan.to != "both":
        raise Failure(f"--faults to={plan.to}: a ring has neither master nor slaves; omit to={plan.to}")
    codec: RingCodec = with_crc(trio, trio.Codec, crc)
    given = RING if ring is None else ring
    try:
        bus = ring_bus(given, link=link, baud=baud, faults=plan, codec=codec)
    except SimulationError as error:
        raise Failure(f"--ring {given}: {error}") from None
    run_bus(bus, link, f"{counted(len(bus.nodes), 'node')} of trio")
    for place, node in enumerate(bus.nodes, 1):
        say(f"address {place}, {_account(node)}", None)
    say(_summary(bus.nodes), plan)


def _account(node: Node) -> str:
    """Return the counters and the state of a node as text."""
    engine = engine_of(node)
    counters = engine.counters
    seen = f"{counters.taken} taken, {counters.passed} forwarded, NETSTAT {int(engine.netstat)}"
    match node:
        case CoordinatorNode():
            return f"coordinator: {seen}{_received(node)}{_variables(node)}"
        case KeypadNode():
            return f"keypad: {seen}{_state(node)}"
        case RingNode():
            return f"passive: {seen}"
        case _:
            assert_never(node)


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
