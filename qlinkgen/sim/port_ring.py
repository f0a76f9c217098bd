"""A ring in real time of simulated nodes and ports, which programs can join.

`PortRing` takes the places in order: nodes, and ports such as the master ends of ptys. Bytes sent by a
program at a port go to the next place, with faults and at the speed of the line; bytes from the previous
place can be read there. `ring_bus` makes the ring of the command line: simulated nodes, and one pty for the
outside between the last and the first.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Sequence
from typing import Self, Unpack

from qlinkgen.bus.ring_status import engine_of
from qlinkgen.codecs import trio
from qlinkgen.protocols.trio.client import Node
from qlinkgen.protocols.trio.options import RingOptions
from qlinkgen.sim.errors import SimulationError
from qlinkgen.sim.pty_bus import PtyBus, make_looker
from qlinkgen.sim.ring import Faults, RingWire
from qlinkgen.sim.traffic import Engine
from qlinkgen.sim.virtual_ring import make_nodes
from qlinkgen.transport.port import Port
from qlinkgen.transport.pty import PtyPort, open_pty


class PortPlace:
    """A port as a station of the ring: writes bytes from the ring, sends bytes read into the ring.

    Attributes:
        port: the port of a program, or the master end of its pty.
    """

    def __init__(self, port: Port) -> None:
        self.port = port
        self._waiting = b""
        self._since = 0.0

    def receive(self, data: bytes, _now: float) -> None:
        """Write bytes from the previous place to the port."""
        self.port.write(data)

    def put(self, data: bytes, now: float) -> None:
        """Take bytes sent by the program."""
        self._since = now
        self._waiting += data

    def bytes_to_send(self, _now: float) -> bytes:
        """Return the bytes for the next place."""
        data, self._waiting = self._waiting, b""
        return data

    def next_timer(self) -> float | None:
        """Return the time of the oldest unsent bytes."""
        return self._since if self._waiting else None


class PortRing(PtyBus):
    """Runs a ring with several ports in real time; see `PtyBus` for how it is started and stopped.

    Attributes:
        nodes: the simulated nodes, in the order of the ring.
        ports: the ports, in the order of the ring.
        paths: device names for programs, of each port.
    """

    def __init__(
        self, places: Iterable[str | Node | Port], *, baud: int | None = None, faults: Faults = None
    ) -> None:
        """Make a ring.

        Args:
            places: nodes or their kinds, such as "keypad"; for programs, ports with a descriptor, or "port"
                for a new pty.
            baud: bits per second, or None for an unpaced ring.
            faults: a plan for all hops, or plans by the number of the place before the hop.

        Raises:
            PortError: a pty cannot be opened.
            SimulationError: no port among the places, more than 15 places, or a port without a descriptor.
        """
        self.nodes: list[Node] = []
        self.ports: list[Port] = []
        self._places: list[PortPlace] = []
        wire = RingWire(trio, baud=baud, faults=faults, outside=False)
        with contextlib.ExitStack() as opened:  # closes new ptys if an error occurs
            for number, place in enumerate(places):
                wire.attach(self._engine(place, baud, opened), f"place {number}")
            if not self.ports:
                raise SimulationError("the ring has no port; use VirtualRing for a ring of nodes")
            descriptors = [_descriptor(port) for port in self.ports]
            super().__init__(wire, port=self.ports[0])
            opened.pop_all()
        self.paths = [port.path if isinstance(port, PtyPort) else port.name for port in self.ports]
        self._look = make_looker(*descriptors, self._waker.descriptor)

    def _engine(self, place: str | Node | Port, baud: int | None, opened: contextlib.ExitStack) -> Engine:
        """Return the engine of a place."""
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
        """Read the ports; False if no bytes were received."""
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
        raise SimulationError(f"{port.name} has no descriptor to wait on; use a pty or a serial port")
    return descriptor


class RingBus(PtyBus):
    """A ring of simulated nodes with one pty for the outside, between the last node and the first.

    Attributes:
        nodes: the simulated nodes, in the order of the ring.
    """

    def __init__(
        self, wire: RingWire, nodes: Sequence[Node], link: str | os.PathLike[str] | None, port: Port | None
    ) -> None:
        """Use `ring_bus`."""
        super().__init__(wire, link=link, port=port)
        self.nodes = list(nodes)

    def __enter__(self) -> Self:
        return self.start()


def ring_bus(
    ring: str | Iterable[str | Node],
    *,
    link: str | os.PathLike[str] | None = None,
    port: Port | None = None,
    baud: int | None = None,
    faults: Faults = None,
    **options: Unpack[RingOptions],
) -> RingBus:
    """Make a ring of simulated nodes, with the outside on a new pty.

    For the outside the first node is the next one: number 10 in BASIC, address 1 on the wire.

    Args:
        ring: kinds such as "coordinator,keypad,coordinator", or nodes, at most 14.
        link: path of a symbolic link to the pty, so that its name is known beforehand.
        port: use this port instead of a new pty.
        baud: bits per second, or None for an unpaced ring.
        faults: a plan for all hops, or plans by the number of the node before the hop; the outside has the
            last number.
        options: options of each new node; see `RingNode`.

    Raises:
        PortError: the link cannot be made.
        CapabilityMissing: this system has no ptys.
        SimulationError: an argument is out of range.
    """
    nodes = make_nodes(ring, baud=baud, **options)
    wire = RingWire(trio, baud=baud, faults=faults)
    for number, node in enumerate(nodes):
        wire.attach(engine_of(node), f"node {number}")
    return RingBus(wire, nodes, link, port)
