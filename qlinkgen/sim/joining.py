"""Joins a master with simulated slaves, on a virtual clock or over a pty."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

from qlinkgen.bus import aio, blocking
from qlinkgen.bus.host import Host
from qlinkgen.bus.host_aio import AsyncHost
from qlinkgen.bus.making import make_peer
from qlinkgen.link.codec import Codec
from qlinkgen.link.device import DeviceCodec, DeviceEngine
from qlinkgen.link.many import has_endless
from qlinkgen.link.peer import PeerEngine
from qlinkgen.link.slave import Node, SlaveEngine
from qlinkgen.sim.faults import FaultPlan
from qlinkgen.sim.generic import GenericNode
from qlinkgen.sim.virtual import VirtualPort
from qlinkgen.sim.wire import Wire
from qlinkgen.transport.opening import open_port
from qlinkgen.transport.port import Port

#: Speed of a line in bits per second, if the schema states none.
USUAL_SPEED = 115200

Transport = Literal["virtual", "pty"]
M = TypeVar("M", bound="blocking.Calls | aio.AsyncCalls")


@dataclass(frozen=True, slots=True)
class Joined(Generic[M]):
    """A master, and the line to its slaves.

    Attributes:
        master: the master, or one side of a link.
        others: the engines of the slaves, of the other side, or of the device of a host.
        wire: the line, with its faults and taps.
    """

    master: M
    others: tuple[SlaveEngine | PeerEngine | DeviceEngine, ...]
    wire: Wire


@contextlib.contextmanager
def join(
    master: type[M],
    *handlers: Node,
    transport: Transport = "virtual",
    faults: FaultPlan | None = None,
    turnaround: float = 0.0,
    own: Node | None = None,
    **options: object,  # of the class, which checks them
) -> Iterator[Joined[M]]:
    """Join a class of a generated bus module with slaves during a block, and close it afterwards.

    Args:
        master: the class, such as `oven_bus.Bus`.
        handlers: the slaves; by default one that answers each command with the defaults of its response. On a
            link whose sides both ask, the other side.
        transport: "virtual": time passes only while the master waits; "pty": a pseudo-terminal, in real time.
        faults: what happens to frames on the line.
        turnaround: seconds from a request to its answer.
        own: handlers of this side, where both sides of a link ask.
        options: options of the class, such as `attempts`.
    """
    codec = master.codec
    host = _is_host(master)
    speed = codec.BUS.baud or USUAL_SPEED
    paced = transport == "virtual"
    wire = Wire(
        baud=speed if paced else None,
        bits_per_byte=codec.BUS.bits_per_byte,
        faults=faults,
        collisions=not host and not has_endless(codec),  # a host has a line for each direction
    )
    with (
        _port(wire, transport, speed) as port,
        join_at(port, wire, master, *handlers, turnaround=turnaround, own=own, **options) as joined,
    ):
        yield joined


@contextlib.contextmanager
def join_at(
    port: Port,
    wire: Wire,
    master: type[M],
    *handlers: Node,
    turnaround: float = 0.0,
    own: Node | None = None,
    **options: object,  # of the class, which checks them
) -> Iterator[Joined[M]]:
    """Join a master at a port with slaves on its line during a block, and close the master afterwards.

    Args:
        port: the port of the master; closing the master closes it.
        wire: the line, without stations.
        master: as for `join`, like the rest.
        handlers: see there.
        turnaround: see there.
        own: see there.
        options: see there.
    """
    codec: Any = master.codec  # its class depends on the kind
    nodes = handlers or (_usual(codec),)
    both = issubclass(master, blocking.Link | aio.AsyncLink)
    others = tuple(_engine(master, port, each, turnaround) for each in nodes)
    for engine in others:
        wire.attach(engine)
    given = (own or _usual(codec),) if both else ()
    make: Any = master  # its arguments depend on the kind
    made: M = make(port, *given, **options)
    with contextlib.closing(made):
        yield Joined(made, others, wire)


def _usual(codec: Codec | DeviceCodec) -> GenericNode:
    return GenericNode(codec, codec.BUS.first_node or 0)


def _is_host(master: type[M]) -> bool:
    return issubclass(master, Host | AsyncHost)


def _engine(
    master: type[M], port: Port, handlers: Node, turnaround: float
) -> SlaveEngine | PeerEngine | DeviceEngine:
    codec: Any = master.codec  # its class depends on the kind
    if _is_host(master):
        return DeviceEngine(codec, handlers, turnaround=turnaround)
    if issubclass(master, blocking.Link | aio.AsyncLink):
        return make_peer(codec, port, handlers, turnaround=turnaround)
    return SlaveEngine(codec, handlers, turnaround=turnaround, baud=port.baud)


@contextlib.contextmanager
def _port(wire: Wire, transport: Transport, speed: int) -> Iterator[Port]:
    if transport == "virtual":
        yield VirtualPort(wire, baud=speed)
        return
    from qlinkgen.sim.pty_bus import PtyBus  # noqa: PLC0415  # needs a system that has ptys

    with PtyBus(wire) as line, open_port(line.path, baud=speed) as port:
        yield port
