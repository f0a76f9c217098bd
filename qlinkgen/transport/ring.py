"""Drivers of a ring node for blocking programs.

A node must forward messages while its program is busy or waiting. So `NodeThread` has a thread that reads the
port, and the program's calls only read its buffers. A call that sends writes to the port itself, so it does
not wait for another thread.

A port with its own clock, such as a simulated one, only needs to be read while the program waits, since its
time does not advance otherwise: `PumpedNode` does that, in the calling thread.
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
    """Runs a node while the program waits; for ports with their own clock.

    Attributes:
        node: the engine.
        port: the port of the node.
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
        """See `RingDriver.act`; received bytes are processed first."""
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
        """Sleep while the node runs."""
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
    """Return the driver for a port: with a thread, or without one if the port has its own clock."""
    if port.own_clock:
        return PumpedNode(port, node, on_event=on_event)
    return NodeThread(port, node, on_event=on_event)
