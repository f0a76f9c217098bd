"""Ports connected within this process: a null modem in memory."""

from __future__ import annotations

from threading import Condition

from qlinkgen.errors import PortLost
from qlinkgen.transport.forking import tell_of_forks
from qlinkgen.transport.port import Ability, Capabilities, Port, closed_here
from qlinkgen.transport.stream import CHUNK

_CAPABILITIES = Capabilities(
    exclusive=Ability.YES,
    low_latency=Ability.YES,
    rs485=Ability.NO,
    paced=Ability.NO,
    latency=0.0,
    latency_source="bytes stay in this process",
)


class _Lane:
    """Bytes in transit in one direction."""

    __slots__ = ("__weakref__", "changed", "data", "ended")

    def __init__(self) -> None:
        self.data = bytearray()
        self.ended = False
        self.changed = Condition()
        tell_of_forks(self)

    def after_fork(self) -> None:
        """Make a new lock: the old one may be held by a thread that does not exist in the child."""
        self.changed = Condition()


class MemoryPort(Port):
    """One end of a `memory_pair`. Both ends may be used by several threads at a time."""

    def __init__(self, name: str, baud: int, incoming: _Lane, outgoing: _Lane) -> None:
        """Make an end; `memory_pair` makes both, `memory_ring` a ring of them."""
        self.name = name
        self.baud = baud
        self.capabilities = _CAPABILITIES
        self._incoming = incoming
        self._outgoing = outgoing
        self._closed = False

    def read(self, timeout: float) -> bytes:
        """See `Port.read`. Bytes written before the other end closed are read before `PortLost` is raised."""
        lane = self._incoming
        with lane.changed:
            lane.changed.wait_for(lambda: lane.data or lane.ended, max(timeout, 0.0))
            self._check_open()
            if not lane.data and lane.ended:
                raise self._lost()
            data = bytes(lane.data[:CHUNK])
            del lane.data[:CHUNK]
            return data

    def write(self, data: bytes) -> None:
        """See `Port.write`. The buffer is unlimited, so this does not wait."""
        lane = self._outgoing
        with lane.changed:
            self._check_open()
            if lane.ended:
                raise self._lost()
            lane.data += data
            lane.changed.notify_all()

    def _check_open(self) -> None:
        if self._closed:
            raise closed_here(self.name)

    def _lost(self) -> PortLost:
        return PortLost(f"{self.name} was lost: its other end was closed; make a new pair", port=self.name)

    def close(self) -> None:
        """Close this end; a read that waits at either end returns."""
        self._closed = True
        for lane in (self._incoming, self._outgoing):
            with lane.changed:
                lane.ended = True
                lane.changed.notify_all()


def memory_pair(
    baud: int = 115200, *, names: tuple[str, str] = ("memory:a", "memory:b")
) -> tuple[MemoryPort, MemoryPort]:
    """Return two connected ports; bytes written to one can be read from the other immediately.

    Args:
        baud: nominal speed, used only in arithmetic.
        names: names in error texts.
    """
    there, back = _Lane(), _Lane()
    return MemoryPort(names[0], baud, back, there), MemoryPort(names[1], baud, there, back)


def memory_ring(count: int, baud: int = 115200) -> list[MemoryPort]:
    """Return ports in a ring: each writes to the next one, the last to the first.

    Args:
        count: number of ports, at least 1.
        baud: nominal speed, used only in arithmetic.
    """
    lanes = [_Lane() for _ in range(count)]
    return [
        MemoryPort(f"memory:{at}", baud, incoming, lanes[(at + 1) % count])
        for at, incoming in enumerate(lanes)
    ]
