"""Rings in real time: simulated nodes and ports, and one pty for the command line."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from decimal import Decimal
from pathlib import Path

import pytest

from qlinkgen.codecs import trio
from qlinkgen.protocols.trio import (
    CHR,
    CoordinatorNode,
    KeypadNode,
    MembraneKeypad,
    MotionCoordinator,
    PassiveNode,
)
from qlinkgen.sim import FaultPlan, SimulationError
from qlinkgen.sim.port_ring import PortRing, ring_bus
from qlinkgen.transport import memory_pair, open_port, open_pty

PATIENCE = 20.0


@pytest.fixture(autouse=True)
def nothing_is_left() -> Iterator[None]:
    threads, files = threading.active_count(), len(list(Path("/proc/self/fd").iterdir()))
    yield
    assert threading.active_count() == threads
    assert len(list(Path("/proc/self/fd").iterdir())) == files


def eventually(condition: Callable[[], object]) -> None:
    limit = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < limit, "it never got so"
        time.sleep(0.002)


def test_programs_join_at_ports_between_simulated_nodes() -> None:
    keypad = KeypadNode()
    with (
        PortRing(["port", keypad, "port", "coordinator"]) as ring,
        MotionCoordinator.open(ring.paths[0]) as first,
        MotionCoordinator.open(ring.paths[1]) as second,
    ):
        first.send(10, 2, 11)
        first.print_(10, CHR(12), "hello", end="")
        first.print_(11, "to second", end="")
        assert bytes(second.get(4, PATIENCE) for _ in range(9)) == b"to second"
        second.send(10, 1, 5, 2.5)
        node = ring.nodes[1]
        assert isinstance(node, CoordinatorNode)
        eventually(lambda: node.vr[5] == 2.5)
        assert keypad.display.lines[0] == "hello"
        second.print_(11, "back", end="")
        assert bytes(first.get(4, PATIENCE) for _ in range(4)) == b"back"


def test_a_ring_of_fifteen_programs() -> None:
    with PortRing(["port"] * 15) as ring:
        clients = [MotionCoordinator.open(path, patience=PATIENCE) for path in ring.paths]
        for place, client in enumerate(clients):
            client.print_(10 + place % 15, f"{place:02}", end="")
        for place, _ in enumerate(clients):
            target = clients[(2 * place + 1) % 15]
            assert bytes(target.get(4, PATIENCE) for _ in range(2)) == f"{place:02}".encode()
        assert sum(client.counters.taken for client in clients) == 15
        assert all(client.netstat == 0 for client in clients)
        for client in clients:
            client.close()


def test_baud_and_faults_on_a_hop() -> None:
    plan = FaultPlan(flip=(1.0, 1, 1), seed=1)
    with (
        PortRing(["port", "port"], baud=38400, faults={0: plan}) as ring,
        MotionCoordinator.open(ring.paths[0]) as first,
        MotionCoordinator.open(ring.paths[1]) as second,
    ):
        for number in range(30):
            first.send(10, 1, number, 1)
        eventually(lambda: second.counters.total_faults >= 20)
        assert not any(second.vr)
        assert second.netstat
        second.send(10, 1, 7, 1.5)
        first.wait_until(lambda: first.vr[7] == 1.5, PATIENCE)


def test_a_simulated_keypad_is_pressed_by_a_call() -> None:
    with ring_bus("keypad") as bus, MotionCoordinator.open(bus.path) as mc:
        keypad = bus.nodes[0]
        assert isinstance(keypad, KeypadNode)
        mc.send(10, 2, 10)
        eventually(lambda: keypad.offset)

        def press() -> None:
            keypad.press("4", bus.port.now())
            bus.wire.wake(keypad.link)

        bus.call(press)
        assert mc.get(4, PATIENCE) == ord("4")


def test_the_outside_is_between_the_last_node_and_the_first(tmp_path: Path) -> None:
    link = tmp_path / "ring"
    with ring_bus("coordinator,keypad,coordinator", link=link) as bus, PassiveNode.open(str(link)) as outside:
        assert [node.kind for node in bus.nodes if not hasattr(node, "codec")] == [
            "coordinator",
            "keypad",
            "coordinator",
        ]
        outside.transmit(trio.DirectVariableTransfer(address=1, number=1, value=Decimal(1)))
        outside.transmit(trio.KeypadOffset(address=2, offset=2))
        outside.transmit(trio.CharacterTransfer(address=4, characters="round"))
        outside.wait_until(lambda: outside.counters.taken == 1, PATIENCE)
        first = bus.nodes[0]
        assert isinstance(first, CoordinatorNode)
        assert first.vr[1] == 1
    assert not link.exists()


def test_a_program_may_leave_and_another_one_join() -> None:
    with ring_bus("coordinator") as bus:
        for _ in range(3):
            with MotionCoordinator.open(bus.path) as mc:
                mc.print_(11, "x", end="")
                assert mc.get(4, PATIENCE) == ord("x")


def test_ports_may_be_given() -> None:
    with open_pty() as port, PortRing([port, "coordinator"]) as ring:
        assert ring.paths == [port.path]
        with MembraneKeypad(open_port(port.path)) as keypad:
            keypad.wait_until(lambda: True)


def test_wrong_places() -> None:
    with pytest.raises(SimulationError, match="the ring has no port"):
        PortRing(["coordinator"])
    near, _far = memory_pair()
    with pytest.raises(SimulationError, match="memory:a has no descriptor"):
        PortRing([near])
    with pytest.raises(SimulationError, match="unknown kind of node 'x'"):
        ring_bus("x")
    with pytest.raises(SimulationError, match="16 places"):
        PortRing(["port"] * 16)
    with pytest.raises(SimulationError, match="16 places"):
        ring_bus("coordinator," * 14 + "coordinator")
