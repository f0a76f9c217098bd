"""A ring on a virtual clock: nodes, fibres, faults, and the programs on the nodes."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterable
from typing import TypeVar, Unpack

from qlinkgen.bus.ring_status import engine_of
from qlinkgen.codecs import trio
from qlinkgen.link.ring import RingNode
from qlinkgen.protocols.trio.aio import AsyncMembraneKeypad, AsyncMotionCoordinator
from qlinkgen.protocols.trio.client import Node
from qlinkgen.protocols.trio.coordinator_node import CoordinatorNode
from qlinkgen.protocols.trio.keypad_node import KeypadNode
from qlinkgen.protocols.trio.nodes import MembraneKeypad, MotionCoordinator
from qlinkgen.protocols.trio.options import NodeOptions, RingOptions
from qlinkgen.sim.errors import SimulationError
from qlinkgen.sim.programs import Programs
from qlinkgen.sim.ring import Faults, RingWire
from qlinkgen.sim.wire import Tap
from qlinkgen.transport.ring_aio import AsyncRingDriver
from qlinkgen.transport.ring_driver import GIVE_WAY, RingDriver

T = TypeVar("T")


def _passive(**options: Unpack[NodeOptions]) -> RingNode:
    options.setdefault("codec", trio)
    return RingNode(**options)


#: Kind of node to its constructor; options are those of `RingNode`.
KINDS: dict[str, Callable[..., Node]] = {
    "coordinator": CoordinatorNode,
    "keypad": KeypadNode,
    "passive": _passive,
}


def make_nodes(ring: str | Iterable[str | Node], **options: Unpack[NodeOptions]) -> list[Node]:
    """Return the nodes of a ring in their order.

    Args:
        ring: kinds such as "coordinator,keypad,coordinator", or nodes, or both in a list.
        options: options of each new node; see `RingNode`.

    Raises:
        SimulationError: a kind is unknown, or the ring is empty.
    """
    parts = ring.split(",") if isinstance(ring, str) else ring
    nodes = [_make(part.strip(), options) if isinstance(part, str) else part for part in parts]
    if not nodes:
        raise SimulationError("a ring needs at least one node")
    return nodes


def _make(kind: str, options: NodeOptions) -> Node:
    if kind not in KINDS:
        raise SimulationError(f"unknown kind of node {kind!r}; kinds are {', '.join(KINDS)}")
    return KINDS[kind](**options)


class VirtualRing:
    """A closed ring of simulated nodes. Time advances only while a program waits, or in `sleep` and `settle`.

    Attributes:
        nodes: the behaviours, in the order of the ring.
        wire: the fibres.
    """

    def __init__(
        self,
        ring: str | Iterable[str | Node],
        *,
        baud: int | None = None,
        faults: Faults = None,
        taps: Iterable[Tap] = (),
        **options: Unpack[RingOptions],
    ) -> None:
        """Make a ring.

        Args:
            ring: see `make_nodes`; at most 15 nodes.
            baud: bits per second, or None for an unpaced ring.
            faults: a plan for all hops, or plans by the number of the node before the hop.
            taps: functions that are told of all bytes, those at time 0 too; see `Wire`.
            options: options of each new node; see `RingNode`.

        Raises:
            SimulationError: an argument is out of range.
        """
        places = ring.split(",") if isinstance(ring, str) else list(ring)
        self.nodes = make_nodes(places, baud=baud, **options)
        # A passive node that the caller has made may act as one.
        if not any(isinstance(node, CoordinatorNode) for node in self.nodes) and not any(
            isinstance(place, RingNode) for place in places
        ):
            raise SimulationError("a ring needs a Motion Coordinator, which gives keypads their offset")
        self.wire = RingWire(trio, baud=baud, faults=faults, outside=False)
        for number, node in enumerate(self.nodes):
            self.wire.attach(engine_of(node), f"node {number}")
        self.wire.taps += taps
        self.wire.advance(0.0)
        self._programs = Programs(self.wire.step)

    @property
    def now(self) -> float:
        """Seconds on the virtual clock."""
        return self.wire.now

    # clients

    def coordinator(self, place: int) -> MotionCoordinator:
        """Return the Motion Coordinator at a place of the ring, for a blocking program."""
        node = self._node(place, CoordinatorNode)
        return MotionCoordinator.driven(node, HostedNode(self, node))

    def keypad(self, place: int) -> MembraneKeypad:
        """Return the keypad at a place of the ring, for a blocking program."""
        node = self._node(place, KeypadNode)
        return MembraneKeypad.driven(node, HostedNode(self, node))

    def async_coordinator(self, place: int) -> AsyncMotionCoordinator:
        """Return the Motion Coordinator at a place of the ring, for asyncio."""
        node = self._node(place, CoordinatorNode)
        return AsyncMotionCoordinator.driven(node, AsyncHostedNode(self, node))

    def async_keypad(self, place: int) -> AsyncMembraneKeypad:
        """Return the keypad at a place of the ring, for asyncio."""
        node = self._node(place, KeypadNode)
        return AsyncMembraneKeypad.driven(node, AsyncHostedNode(self, node))

    def _node(self, place: int, kind: type[T]) -> T:
        node = self.nodes[place]
        if not isinstance(node, kind):
            raise SimulationError(f"node {place} is a {type(node).__name__}, not a {kind.__name__}")
        return node

    # time

    def run(self, *programs: Callable[[], T]) -> list[T]:
        """Run blocking programs concurrently to their ends; return their results.

        Raises:
            SimulationError: deadlock: all of them wait, and no events are left.
        """
        return self._programs.run(programs)

    def give_way(self, due: float) -> None:
        """Wait for the next event, at the latest until `due`; for drivers."""
        self._programs.give_way(due)

    def sleep(self, seconds: float) -> None:
        """Let time pass for the whole ring."""
        self.wire.advance(self.now + seconds)

    def settle(self, limit: float = math.inf) -> None:
        """Advance until no message is in transit, or for `limit` seconds."""
        end = self.now + limit
        while self.wire.step(end) and self.now < end:
            pass

    # nodes

    def switch_off(self, place: int) -> None:
        """Switch a node off: the ring is open there, and messages passing it are lost."""
        self.wire.switch_off(engine_of(self.nodes[place]))

    def switch_on(self, place: int) -> None:
        """Switch a node on again; a keypad loses its offset, a Motion Coordinator its receive buffer."""
        node = self.nodes[place]
        node.reset()
        self.wire.switch_on(engine_of(node))


class HostedNode(RingDriver):
    """Driver of a node of a `VirtualRing` for blocking programs."""

    def __init__(self, ring: VirtualRing, node: Node) -> None:
        self.node = engine_of(node)
        self._ring = ring

    def now(self) -> float:
        """Return the virtual time."""
        return self._ring.now

    def act(self, function: Callable[[float], T]) -> T:
        """See `RingDriver.act`."""
        result = function(self._ring.now)
        self._ring.wire.wake(self.node)
        return result

    def until(self, attempt: Callable[[float], T | None], timeout: float | None) -> T | None:
        """See `RingDriver.until`.

        Raises:
            SimulationError: no events are left.
        """
        ring = self._ring
        due = math.inf if timeout is None else ring.now + timeout
        while (value := attempt(ring.now)) is None:
            if ring.now >= due:
                return None
            ring.give_way(due)
        ring.wire.wake(self.node)
        return value

    def give_way(self) -> None:
        """See `RingDriver.give_way`."""
        self._ring.give_way(self._ring.now + GIVE_WAY)

    def pause(self, seconds: float) -> None:
        """Sleep on the virtual clock."""
        self.until(lambda _now: None, seconds)

    def close(self) -> None:
        """Do nothing: the node stays on the ring."""


class AsyncHostedNode(AsyncRingDriver):
    """Driver of a node of a `VirtualRing` for asyncio."""

    def __init__(self, ring: VirtualRing, node: Node) -> None:
        self.node = engine_of(node)
        self._ring = ring
        self._driver = HostedNode(ring, node)

    def now(self) -> float:
        """Return the virtual time."""
        return self._ring.now

    def act(self, function: Callable[[float], T]) -> T:
        """See `RingDriver.act`."""
        return self._driver.act(function)

    async def until(self, attempt: Callable[[float], T | None], timeout: float | None) -> T | None:
        """See `RingDriver.until`; other tasks run after each event.

        Raises:
            SimulationError: no events are left, and no timeout.
        """
        ring = self._ring
        due = math.inf if timeout is None else ring.now + timeout
        idle = 0
        while (value := attempt(ring.now)) is None:
            if ring.now >= due:
                return None
            await asyncio.sleep(0)
            # Other tasks may be about to send: deadlock only after they had some turns.
            idle = 0 if ring.wire.step(due) else idle + 1
            if idle > _IDLE_ROUNDS:
                raise SimulationError("no events are left on the ring; use a timeout, or send first")
        ring.wire.wake(self.node)
        return value

    async def give_way(self) -> None:
        """See `RingDriver.give_way`."""
        await self.pause(GIVE_WAY)

    async def pause(self, seconds: float) -> None:
        """Sleep on the virtual clock."""
        await self.until(lambda _now: None, seconds)

    async def close(self) -> None:
        """Do nothing: the node stays on the ring."""


#: Turns of the event loop without an event on the ring that count as a deadlock.
_IDLE_ROUNDS = 10_000
