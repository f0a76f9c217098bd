"""What buses of every kind are made of: ports at the right speed, and engines."""

from __future__ import annotations

from collections.abc import Mapping

from qlinkgen.bus.options import Parity, StopBits
from qlinkgen.link.codec import Codec, Module
from qlinkgen.link.echo import EchoMode
from qlinkgen.link.health import HealthPolicy
from qlinkgen.link.master import MasterEngine
from qlinkgen.link.peer import PeerEngine
from qlinkgen.link.slave import Node
from qlinkgen.link.transaction import Accepts
from qlinkgen.transport.conversation import timing_of
from qlinkgen.transport.opening import open_port
from qlinkgen.transport.port import Port


def open_line(
    codec: Module, name: str, *, baud: int | None, parity: Parity, stop_bits: StopBits, reopen: bool
) -> Port:
    """Open a port for a protocol; see `Bus.open`."""
    speed = baud or codec.BUS.baud
    if speed is None:
        raise ValueError("the schema states no speed; pass baud")
    return open_port(name, baud=speed, parity=parity, stop_bits=stop_bits, reopen=reopen)


def make_master(
    codec: Codec,
    port: Port,
    accepts: Mapping[str, Accepts] | None,
    *,
    echo: EchoMode,
    attempts: int = 3,
    slack: float | None = None,
    health: HealthPolicy | None = HealthPolicy(),  # noqa: B008  # immutable
    number: int | None = None,
) -> MasterEngine:
    """Make the engine of a master on a port; see `BusOptions`."""
    timing = timing_of(codec, port, slack=slack, attempts=attempts)
    return MasterEngine(codec, timing, echo=echo, health=health, accepts=accepts, number=number)


def make_peer(
    codec: Codec,
    port: Port,
    handlers: Node,
    *,
    attempts: int = 3,
    slack: float | None = None,
    turnaround: float = 0.0,
) -> PeerEngine:
    """Make the engine of one side of a link on a port; see `PeerOptions`."""
    timing = timing_of(codec, port, slack=slack, attempts=attempts)
    return PeerEngine(codec, timing, handlers, turnaround=turnaround)


def check_node(codec: Module, number: object) -> int:
    """Return the number of a node.

    Raises:
        ValueError: no node has it.
    """
    first, last = codec.BUS.first_node or 0, codec.BUS.last_node or 0
    if not isinstance(number, int) or not first <= number <= last:
        raise ValueError(f"node must be {first}..{last}, not {number!r}")
    return number
