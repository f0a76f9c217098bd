"""A ring in real time whose places are simulated nodes and ports: any program joins it at a port.

`PortRing` takes the places in their order: nodes, and ports such as the master ends of ptys. What a program
sends at a port goes to the place behind it, through faults and at the pace of the line; what comes from the
place before is read there. `ring_bus` makes the ring of the command line: simulated nodes, and one pty for
the outside between the last and the first.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Sequence
from typing import Self, Unpack

from qlinkgen.codecs import trio
from qlinkgen.protocols.trio.client import Node, engine_of
from qlinkgen.protocols.trio.options import RingOptions
from qlinkgen.sim.errors import SimulationError
from qlinkgen.sim.pty_bus import PtyBus, make_looker
from qlinkgen.sim.ring import Faults, RingWire
from qlinkgen.sim.traffic import Engine
from qlinkgen.sim.virtual_ring import make_nodes
from qlinkgen.transport.port import Port
from qlinkgen.transport.pty import PtyPort, open_pty


class PortPlace:
    """A port as a station of the ring: what comes from the ring is written, what is read goes to the ring.

    Attributes:
        port: where a program is, directly or at the other end of a pty.
    """

    def __init__(self, port: Port) -> None:
        self.port = port
        self._waiting = b""
        self._since = 0.0

    def receive(self, data: bytes, _now: float) -> None:
        """Hand on what comes from the place before."""
        self.port.write(data)

    def put(self, data: bytes, now: float) -> None:
        """Take what the program at the port sends."""
        self._since = now
        self._waiting += data

    def bytes_to_send(self, _now: float) -> bytes:
        """Return what goes to the next place."""
        data, self._waiting = self._waiting, b""
        return data

    def next_timer(self) -> float | None:
        """Return when there was something to send."""
        return self._since if self._waiting else None


class PortRing(PtyBus):
    """Runs a ring with several ports in real time; see `PtyBus` for how it is started and stopped.

    Attributes:
        nodes: the simulated nodes, in the order of the ring.
        ports: the ports, in the order of the ring.
        paths: what a program opens to join the ring at each port.
    """

    def __init__(
        self, places: Iterable[str | Node | Port], *, baud: int | None = None, faults: Faults = None
    ) -> None:
        """Make a ring.

        Args:
            places: nodes or their kinds, such as "keypad"; and for programs ports with a descriptor, or
                "port" for a new pty.
            baud: bits a second, or None: bytes take no time.
            faults: a plan for all hops, or plans by the number of the place that the hop leads away from.

        Raises:
            PortError: there is no pty to be had.
            SimulationError: no port among the places, more than 15 places, or a port without a descriptor.
        """
        self.nodes: list[Node] = []
        self.ports: list[Port] = []
        self._places: list[PortPlace] = []
        wire = RingWire(trio, baud=baud, faults=faults, outside=False)
        with contextlib.ExitStack() as opened:  # closes new ptys where the ring can not be made
            for number, place in enumerate(places):
                wire.attach(self._engine(place, baud, opened), f"place {number}")
            if not self.ports:
                raise SimulationError("no place of the ring is a port: where all are nodes, use VirtualRing")
            descriptors = [_descriptor(port) for port in self.ports]
            super().__init__(wire, port=self.ports[0])
            opened.pop_all()
        self.paths = [port.path if isinstance(port, PtyPort) else port.name for port in self.ports]
        self._look = make_looker(*descriptors, self._waker.descriptor)

    def _engine(self, place: str | Node | Port, baud: int | None, opened: contextlib.ExitStack) -> Engine:
        """Take what stands at a place."""
        if place == "port":
            place = opened.enter_context(open_pty(baud=baud or 115200))
        if isinstance(place, Port):
            self.ports.append(place)
            self._places.append(PortPlace(place))
            return self._places[-1]
        (node,) = make_nodes([place], baud=baud)
        self.nodes.append(node)
        return engine_of(node)

    def _all_ports(self) -> Sequence[Port]:
        return self.ports

    def _loop(self) -> None:
        wire, clock = self.wire, self.port.now
        while not self._stopping:
            wire.advance(clock())
            if self._wait(wire.next_timer()) and not self._read():
                self._answer_calls()

    def _read(self) -> bool:
        """Take what has come at the ports; False where nothing has."""
        found = False
        for place in self._places:
            if data := place.port.read(0.0):
                place.put(data, self.port.now())
                self.wire.wake(place)
                found = True
        return found


def _descriptor(port: Port) -> int:
    descriptor = port.fileno()
    if descriptor is None:
        raise SimulationError(f"{port.name} has no descriptor to wait for: use a pty or a serial port")
    return descriptor


class RingBus(PtyBus):
    """A ring of simulated nodes with one pty for the outside, between the last node and the first.

    Attributes:
        nodes: the simulated nodes, in the order of the ring.
    """

    def __init__(self, wire: RingWire, nodes: Sequence[Node], link: str | os.PathLike[str] | None) -> None:
        """Use `ring_bus`."""
        super().__init__(wire, link=link)
        self.nodes = list(nodes)

    def __enter__(self) -> Self:
        return self.start()


def ring_bus(
    ring: str | Iterable[str | Node],
    *,
    link: str | os.PathLike[str] | None = None,
    baud: int | None = None,
    faults: Faults = None,
    **options: Unpack[RingOptions],
) -> RingBus:
    """Put simulated nodes on a ring, and the outside at a new pty.

    Seen from the outside the first node is the next one: number 10 in BASIC, address 1 on the wire.

    Args:
        ring: kinds such as "coordinator,keypad,coordinator", or nodes, at most 14.
        link: path of a symbolic link to the pty, so that its name is known beforehand.
        baud: bits a second, or None: bytes take no time.
        faults: a plan for all hops, or plans by the number of the node that the hop leads away from; the
            outside has the last number.
        options: for each node that is made here; see `RingNode`.

    Raises:
        PortError: the link cannot be made.
        CapabilityMissing: this system has no ptys.
        SimulationError: an argument out of its range.
    """
    nodes = make_nodes(ring, baud=baud, **options)
    wire = RingWire(trio, baud=baud, faults=faults)
    for number, node in enumerate(nodes):
        wire.attach(engine_of(node), f"node {number}")
    return RingBus(wire, nodes, link)
