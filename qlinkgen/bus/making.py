"""What buses of every kind are made of: ports at the right speed, and engines."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Mapping

from qlinkgen.bus.options import Checksum, Parity, StopBits
from qlinkgen.link.codec import Codec, Module
from qlinkgen.link.echo import EchoMode
from qlinkgen.link.health import HealthPolicy
from qlinkgen.link.host import HostEngine
from qlinkgen.link.host_rules import HostCodec, HostRules
from qlinkgen.link.host_timing import HostTiming
from qlinkgen.link.master import MasterEngine
from qlinkgen.link.peer import PeerEngine
from qlinkgen.link.ring import RingCodec
from qlinkgen.link.slave import Node
from qlinkgen.link.transaction import Accepts
from qlinkgen.transport.conversation import host_slack, timing_of
from qlinkgen.transport.opening import open_port
from qlinkgen.transport.port import Ability, Port


def open_line(
    codec: Module | RingCodec,
    name: str,
    *,
    baud: int | None,
    parity: Parity,
    stop_bits: StopBits,
    reopen: bool,
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


def make_host(
    codec: HostCodec,
    port: Port,
    *,
    attempts: int = 3,
    slack: float | None = None,
    checksum: Checksum = "always",
    forgets: float = 0.0,
) -> HostEngine:
    """Make the engine of a host on a port; see `HostEngineOptions`.

    Raises:
        ValueError: `checksum` names no command, or an option is out of range.
    """
    timing = HostTiming.for_host(
        codec,
        baud=port.baud,
        host_slack=host_slack(port) if slack is None else slack,
        paced=port.capabilities.paced is Ability.YES,
        attempts=attempts,
        forgets=forgets,
    )
    return HostEngine(codec, timing, HostRules.of(codec), checked=_checked(codec, checksum))


def _checked(codec: Module, checksum: Checksum) -> Collection[str]:
    """Return the names of the commands whose check value is read."""
    if isinstance(checksum, str):
        if checksum not in {"always", "never"}:
            raise ValueError(f"checksum must be 'always', 'never' or names of commands, not {checksum!r}")
        return codec.COMMANDS if checksum == "always" else ()
    for name in checksum:
        if name not in codec.COMMANDS:
            close = difflib.get_close_matches(name, codec.COMMANDS, 1)
            hint = f"did you mean {close[0]}?" if close else f"commands are {', '.join(codec.COMMANDS)}"
            raise ValueError(f"checksum: unknown command {name!r}; {hint}")
    return frozenset(checksum)


def check_node(codec: Module, number: object) -> int:
    """Return the number of a node.

    Raises:
        ValueError: no node has it.
    """
    first, last = codec.BUS.first_node or 0, codec.BUS.last_node or 0
    if not isinstance(number, int) or not first <= number <= last:
        raise ValueError(f"node must be {first}..{last}, not {number!r}")
    return number
