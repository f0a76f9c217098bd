"""Drivers that keep a node of a ring at work, for blocking programs.

A node must send the messages of others on while the program at it does something else, or nothing. So
`NodeThread` has a thread that reads the port, and the program's calls only look at what it has left behind.
A call that sends writes to the port itself, so it waits for no other thread.

On a port with a clock of its own, such as a simulated one, time stands still while nobody reads, and nothing
is lost by reading only when the program waits: `PumpedNode` does that, in the thread that calls.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

from qlinkgen.link.ring import RingNode
from qlinkgen.transport.forking import tell_of_forks
from qlinkgen.transport.port import Port
from qlinkgen.transport.ring_driver import GIVE_WAY, NodeIo, OnEvent, RingDriver
from qlinkgen.transport.ring_thread import NodeThread

__all__ = ["NodeIo", "NodeThread", "OnEvent", "PumpedNode", "RingDriver", "drive"]

T = TypeVar("T")


class PumpedNode(RingDriver):
    """Keeps a node at work while the program waits for it, and only then; for ports with their own clock.

    Attributes:
        node: the engine.
        port: where it receives and transmits.
        on_event: called with each event of the engine.
    """

    def __init__(self, port: Port, node: RingNode, *, on_event: OnEvent | None = None) -> None:
        self.node = node
        self.port = port
        self.on_event = on_event
        self._io = NodeIo(port, node)
        self._lock = threading.RLock()
        tell_of_forks(self)

    def now(self) -> float:
        """Return the time on the port's clock."""
        return self.port.now()

    def act(self, function: Callable[[float], T]) -> T:
        """See `RingDriver.act`; what has come is taken first."""
        with self._lock:
            self._step(self.port.read(0))
            now = self.port.now()
            result = function(now)
            self._io.flush(now)
            return result

    def until(self, attempt: Callable[[float], T | None], timeout: float | None) -> T | None:
        """See `RingDriver.until`."""
        with self._lock:
            self._step(self.port.read(0))
            now = self.port.now()
            limit = float("inf") if timeout is None else now + timeout
            while (value := attempt(now)) is None and now < limit:
                self._step(self.port.read(self._io.wait_at_most(now, limit - now)))
                now = self.port.now()
            self._io.flush(now)
            return value

    def give_way(self) -> None:
        """See `RingDriver.give_way`."""
        self.pause(GIVE_WAY)

    def pause(self, seconds: float) -> None:
        """Let time pass, and the node work."""
        self.until(lambda _now: None, seconds)

    def _step(self, data: bytes) -> None:
        self._io.step(data)
        self._io.report(self.on_event)

    def after_fork(self) -> None:
        """Make a new lock: the old one may be held by a thread that does not exist in the child."""
        self._lock = threading.RLock()

    def close(self) -> None:
        """Close the port."""
        self.port.close()


def drive(port: Port, node: RingNode, *, on_event: OnEvent | None = None) -> RingDriver:
    """Return the driver that suits a port: a thread, or none where the port has a clock of its own."""
    if port.own_clock:
        return PumpedNode(port, node, on_event=on_event)
    return NodeThread(port, node, on_event=on_event)
