"""Joins a node of a ring, of a generated bus module, with simulated nodes on a virtual clock."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from qlinkgen.bus.ring import Ring
from qlinkgen.bus.ring_aio import AsyncRing
from qlinkgen.bus.ring_status import RingHandlers
from qlinkgen.link.ring import RingNode
from qlinkgen.sim.ring import Faults, RingWire
from qlinkgen.sim.virtual import VirtualPort
from qlinkgen.transport.port import Port

G = TypeVar("G", bound="Ring | AsyncRing")


class Silent:
    """A node that takes messages, and does nothing with them."""

    def handle(self, message: object, now: float) -> None:
        """Do nothing."""


@dataclass(frozen=True, slots=True)
class JoinedRing(Generic[G]):
    """A node, and the ring that it is part of.

    Attributes:
        master: the node.
        others: the engines of the other nodes, in the order of the ring: addresses 1, 2, and so on.
        wire: the fibres, with their faults and taps.
    """

    master: G
    others: tuple[RingNode, ...]
    wire: RingWire


@contextlib.contextmanager
def join_ring(
    node: type[G],
    *handlers: RingHandlers,
    faults: Faults = None,
    own: RingHandlers | None = None,
    **options: object,  # of the class, which checks them
) -> Iterator[JoinedRing[G]]:
    """Join a class of a generated bus module with nodes of a ring during a block.

    Time passes only while the node waits.

    Args:
        node: the class, such as `cell_bus.Ring`.
        handlers: the other nodes in the order of the ring; by default one that does nothing.
        faults: what happens to messages: a plan for all hops, or plans by the number of the node before it.
        own: handlers of this node.
        options: options of the class, such as `on_event`.
    """
    codec = node.codec
    wire = RingWire(codec, baud=codec.BUS.baud, faults=faults)
    with (
        contextlib.closing(VirtualPort(wire)) as port,
        join_ring_at(port, wire, node, *handlers, own=own, **options) as joined,
    ):
        yield joined


@contextlib.contextmanager
def join_ring_at(
    port: Port,
    wire: RingWire,
    node: type[G],
    *handlers: RingHandlers,
    own: RingHandlers | None = None,
    **options: object,  # of the class, which checks them
) -> Iterator[JoinedRing[G]]:
    """Join a node at a port with the others on a ring without nodes; see `join_ring`.

    A node for asyncio is left to the caller to close.
    """
    others = tuple(RingNode(node.codec, each.handle, baud=wire.baud) for each in handlers or (Silent(),))
    for number, engine in enumerate(others, 1):
        wire.attach(engine, f"node {number}")
    make: Any = node  # its options are those of the class
    made: G = make(port, own, **options)
    try:
        yield JoinedRing(made, others, wire)
    finally:
        if isinstance(made, Ring):
            made.close()
