"""Serves slaves on a port in real time."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Protocol

from qlinkgen.transport.port import Port

#: Seconds between checks of `stop` on an idle line.
LOOK = 0.1


class Answering(Protocol):
    """The interface of engines that answer: `SlaveEngine`, and `PeerEngine` of a link."""

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes."""
        ...

    def bytes_to_send(self, now: float) -> bytes:
        """Return the bytes to write now."""
        ...

    def next_timer(self) -> float | None:
        """Return the time of the next call, None without one."""
        ...


def serve(port: Port, *slaves: Answering, stop: Callable[[], bool] = lambda: False) -> None:
    """Serve slaves on a port until `stop()` is true.

    Raises:
        PortLost: the port was lost.
    """
    steps = serving(port, *slaves)
    timeout = next(steps)
    while not stop():
        timeout = steps.send(port.read(timeout))


async def serve_async(port: Port, *slaves: Answering, stop: Callable[[], bool] = lambda: False) -> None:
    """Do the same in an event loop, where cancelling the task stops it too."""
    from qlinkgen.transport import aio  # noqa: PLC0415  # importing asyncio takes 50 ms

    steps = serving(port, *slaves)
    timeout = next(steps)
    while not stop():
        timeout = steps.send(await aio.read(port, timeout))


def serving(port: Port, *slaves: Answering) -> Generator[float, bytes, None]:
    """Serve slaves: yields the timeout of a read, takes the bytes read."""
    data = b""
    while True:
        now = port.now()
        for slave in slaves:
            if data:
                slave.receive(data, now)
            if answer := slave.bytes_to_send(now):
                port.transmit(answer, getattr(slave, "break_time", 0.0))  # of buses
        timers = [timer for slave in slaves if (timer := slave.next_timer()) is not None]
        data = yield min(LOOK, max(0.0, min(timers, default=now + LOOK) - now))
