"""Rings of 1 to 15 nodes: every pair of nodes, every message, every address."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable
from decimal import Decimal

import pytest

from qlinkgen.bus.ring_status import engine_of
from qlinkgen.codecs import trio
from qlinkgen.link.codec import Message
from qlinkgen.link.ring import RingNode
from qlinkgen.link.ring_events import Taken
from qlinkgen.protocols.trio import CoordinatorNode, KeypadNode
from qlinkgen.protocols.trio.client import Node
from qlinkgen.sim import SimulationError
from qlinkgen.sim.virtual_ring import VirtualRing
from qlinkgen.transport import memory_ring
from qlinkgen.transport.ring import NodeIo

#: Made for an address; the address apart, one of each type.
MESSAGES: dict[str, Callable[[int], trio.Message]] = {
    "character_transfer": lambda address: trio.CharacterTransfer(address=address, characters="Hi\0\x7f"),
    "direct_variable_transfer": lambda address: trio.DirectVariableTransfer(
        address=address, number=7, value=Decimal("-0.25")
    ),
    "keypad_offset": lambda address: trio.KeypadOffset(address=address, offset=3),
    "keypad_mode": lambda address: trio.KeypadMode(address=address, mode=127),
}


def fields(message: Message) -> tuple[object, ...]:
    return (type(message), *(getattr(message, name) for name in message.FIELDS))


def keypad(baud: int | None = None) -> KeypadNode:
    """A keypad with its offset."""
    node = KeypadNode(baud=baud)
    node.offset, node.link.passes = 1, True
    return node


def mixed(size: int, baud: int | None = None) -> list[Node]:
    """Coordinators, and a keypad at every third place."""
    return [CoordinatorNode(baud=baud) if place % 3 != 1 else keypad(baud) for place in range(size)]


def verbose(nodes: list[Node]) -> list[RingNode]:
    links = [engine_of(node) for node in nodes]
    for link in links:
        link.verbose = True
    return links


def taken(links: list[RingNode]) -> list[tuple[int, tuple[object, ...]]]:
    """Which node has taken which message; cleared on reading."""
    found = []
    for place, link in enumerate(links):
        found += [(place, fields(event.message)) for event in link.events if isinstance(event, Taken)]
        link.events.clear()
    return found


def test_the_messages_are_all_that_there_are() -> None:
    assert set(MESSAGES) == set(trio.MESSAGES)


@pytest.mark.parametrize("baud", [None, 38400])
@pytest.mark.parametrize("size", range(1, 16))
def test_every_message_from_each_node_to_each_address_arrives_once(size: int, baud: int | None) -> None:
    ring = VirtualRing(mixed(size, baud), baud=baud)
    links = verbose(ring.nodes)
    sources = range(size) if baud is None else [0, size // 2]
    for source, address in itertools.product(sources, range(1, 16)):
        for make in MESSAGES.values():
            message = make(address)
            assert links[source].send(message, ring.now)
            ring.wire.wake(links[source])
            ring.settle()
            assert taken(links) == [((source + address) % size, fields(message))]
        for node in ring.nodes:
            node.reset()
            if isinstance(node, KeypadNode):
                node.offset, node.link.passes = 1, True
    sent = 4 * 15 * len(sources)
    assert sum(link.counters.taken for link in links) == sum(link.counters.sent for link in links) == sent
    hops = sum(link.counters.passed for link in links) + sent
    assert hops == 4 * len(sources) * sum(range(1, 16))
    assert all(link.netstat == 0 and not link.counters.faults for link in links)


@pytest.mark.parametrize("cut_through", [True, False])
@pytest.mark.parametrize("size", [2, 4, 15])
def test_all_nodes_at_once(size: int, cut_through: bool) -> None:
    ring = VirtualRing(["coordinator"] * size, baud=38400, cut_through=cut_through)
    links = verbose(ring.nodes)
    chance = random.Random(size)
    expected = []
    for number in range(40 * size):
        source, address = chance.randrange(size), chance.randint(1, 15)
        message = trio.DirectVariableTransfer(address=address, number=number % 251, value=Decimal(number))
        while not links[source].send(message, ring.now):
            ring.sleep(0.01)
        ring.wire.wake(links[source])
        expected.append(((source + address) % size, fields(message)))
        if chance.random() < 0.2:
            ring.sleep(chance.random() * 0.02)
    ring.settle()
    assert sorted(taken(links), key=repr) == sorted(expected, key=repr)
    assert all(link.netstat == 0 for link in links)


@pytest.mark.parametrize("size", [1, 4, 15])
def test_memory_ports_in_a_ring(size: int) -> None:
    nodes: list[Node] = [CoordinatorNode() for _ in range(size)]
    links = verbose(nodes)
    io = [NodeIo(port, link) for port, link in zip(memory_ring(size), links, strict=True)]
    for source, address in itertools.product(range(size), range(1, 16)):
        message = MESSAGES["direct_variable_transfer"](address)
        links[source].send(message, 0.0)
        io[source].flush(0.0)
        for _ in range(16):
            for each in io:
                each.step(each.port.read(0))
        assert taken(links) == [((source + address) % size, fields(message))]


def test_a_ring_has_15_places() -> None:
    VirtualRing(["coordinator"] * 15)
    with pytest.raises(SimulationError, match="16 places, including the outside's; a ring has at most 15"):
        VirtualRing(["coordinator"] * 16)
    with pytest.raises(SimulationError, match="at least one node"):
        VirtualRing([])
    with pytest.raises(SimulationError, match="a ring needs a Motion Coordinator"):
        VirtualRing("keypad,keypad")
    with pytest.raises(SimulationError, match="a ring needs a Motion Coordinator"):
        VirtualRing("passive,keypad")
    VirtualRing([RingNode(trio), "keypad"])  # its engine may send an offset
    with pytest.raises(
        SimulationError, match=r"unknown kind of node 'plotter'; .* coordinator, keypad, passive"
    ):
        VirtualRing("coordinator,plotter")
    with pytest.raises(SimulationError, match="node 0 is a CoordinatorNode, not a KeypadNode"):
        VirtualRing("coordinator").keypad(0)


# latency on a line with line time


def way(address: int, *, cut_through: bool, message: str = "direct_variable_transfer") -> float:
    """Byte times until the receiver has the message; the ring has 15 nodes."""
    baud = 38400
    ring = VirtualRing(["coordinator"] * 15, baud=baud, cut_through=cut_through)
    mc, target = ring.coordinator(0), engine_of(ring.nodes[address % 15])
    mc.transmit(MESSAGES[message](address))
    while not target.counters.taken:
        ring.wire.step(1.0)
    return ring.now * baud / 10


@pytest.mark.parametrize("hops", range(15))
def test_cut_through_adds_one_byte_time_for_each_hop(hops: int) -> None:
    assert way(1 + hops, cut_through=True) == pytest.approx(16 + hops)


@pytest.mark.parametrize("hops", [0, 1, 7, 14])
def test_store_and_forward_adds_the_length_of_the_message(hops: int) -> None:
    assert way(1 + hops, cut_through=False) == pytest.approx(16 + 16 * hops)
    assert way(1 + hops, cut_through=False, message="keypad_mode") == pytest.approx(3 + 3 * hops)


def test_a_node_that_sends_delays_what_it_sends_on_by_the_rest_of_its_message_at_most() -> None:
    ring = VirtualRing(["coordinator"] * 3, baud=38400)
    byte = 10 / 38400
    busy, source, target = ring.coordinator(1), ring.coordinator(0), ring.coordinator(2)
    for _ in range(5):
        busy.print_(10, "x" * 98, end="")  # 100 bytes on the wire
    ring.sleep(10.5 * byte)
    source.send(11, 1, 7, 1)
    target.wait_until(lambda: target.vr[7] == 1)
    # The first byte arrives after 11.5 byte times, the transmitter is free after 100: then it goes first.
    assert ring.now / byte == pytest.approx(100 + 16, abs=0.1)
    assert target.counters.taken == 2
