"""Two ports joined in this process: a null modem without an operating system."""

from __future__ import annotations

from threading import Condition

from qlinkgen.errors import PortLost
from qlinkgen.transport.port import Ability, Capabilities, Port
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
    """Bytes under way in one direction."""

    __slots__ = ("data", "ended")

    def __init__(self) -> None:
        self.data = bytearray()
        self.ended = False


class MemoryPort(Port):
    """One end of a `memory_pair`. Both ends may be used by several threads at a time."""

    def __init__(
        self,
        name: str,
        baud: int,
        incoming: _Lane,
        outgoing: _Lane,
        changed: Condition,
        *,
        told: Condition | None = None,
    ) -> None:
        """Make an end; `memory_pair` makes both, `memory_ring` a ring of them.

        `changed` belongs to the incoming lane, `told` to the outgoing one if that has its own.
        """
        self.name = name
        self.baud = baud
        self.capabilities = _CAPABILITIES
        self._incoming = incoming
        self._outgoing = outgoing
        self._changed = changed
        self._told = told or changed
        self._closed = False

    def read(self, timeout: float) -> bytes:
        """See `Port.read`. What the other end wrote before it closed is read before `PortLost` is raised."""
        lane = self._incoming
        with self._changed:
            self._changed.wait_for(lambda: lane.data or lane.ended, max(timeout, 0.0))
            self._check_open()
            if not lane.data and lane.ended:
                raise self._lost()
            data = bytes(lane.data[:CHUNK])
            del lane.data[:CHUNK]
            return data

    def write(self, data: bytes) -> None:
        """See `Port.write`. Nothing is ever held back, so this does not wait."""
        lane = self._outgoing
        with self._told:
            self._check_open()
            if lane.ended:
                raise self._lost()
            lane.data += data
            self._told.notify_all()

    def _check_open(self) -> None:
        if self._closed:
            raise PortLost(f"{self.name} was closed here; make a new pair to go on", port=self.name)

    def _lost(self) -> PortLost:
        return PortLost(f"{self.name} was lost: its other end was closed; make a new pair", port=self.name)

    def close(self) -> None:
        """Close this end; a read that waits at either end returns."""
        self._closed = True
        for lane, changed in ((self._incoming, self._changed), (self._outgoing, self._told)):
            with changed:
                lane.ended = True
                changed.notify_all()


def memory_pair(
    baud: int = 115200, *, names: tuple[str, str] = ("memory:a", "memory:b")
) -> tuple[MemoryPort, MemoryPort]:
    """Return two ports; what is written to one is read from the other, at once.

    Args:
        baud: speed that both say they have; only arithmetic uses it.
        names: how error texts call them.
    """
    changed = Condition()
    there, back = _Lane(), _Lane()
    return (
        MemoryPort(names[0], baud, back, there, changed),
        MemoryPort(names[1], baud, there, back, changed),
    )


def memory_ring(count: int, baud: int = 115200) -> list[MemoryPort]:
    """Return ports in a ring: what is written to one is read from the next, from the last from the first.

    Args:
        count: ports, at least 1.
        baud: speed that all say they have; only arithmetic uses it.
    """
    lanes = [(_Lane(), Condition()) for _ in range(count)]
    ports = []
    for at, (incoming, changed) in enumerate(lanes):
        outgoing, told = lanes[(at + 1) % count]
        ports.append(MemoryPort(f"memory:{at}", baud, incoming, outgoing, changed, told=told))
    return ports
