"""Answering on a port: a slave, or several of them, in real time."""

from __future__ import annotations

from collections.abc import Callable, Generator

from qlinkgen.link.slave import SlaveEngine
from qlinkgen.transport.port import Port

#: Seconds after which a server looks whether it is to stop, while nothing comes.
LOOK = 0.1


def serve(port: Port, *slaves: SlaveEngine, stop: Callable[[], bool] = lambda: False) -> None:
    """Answer for slaves on a port until `stop()` is true.

    Raises:
        PortLost: the port went away.
    """
    steps = _serving(port, slaves)
    timeout = next(steps)
    while not stop():
        timeout = steps.send(port.read(timeout))


async def serve_async(port: Port, *slaves: SlaveEngine, stop: Callable[[], bool] = lambda: False) -> None:
    """Do the same in an event loop, where a cancelled task stops it too."""
    from qlinkgen.transport import aio  # noqa: PLC0415  # asyncio costs blocking servers 50 ms

    steps = _serving(port, slaves)
    timeout = next(steps)
    while not stop():
        timeout = steps.send(await aio.read(port, timeout))


def _serving(port: Port, slaves: tuple[SlaveEngine, ...]) -> Generator[float, bytes, None]:
    """Yields how long to wait for bytes, is sent those that came."""
    data = b""
    while True:
        now = port.now()
        for slave in slaves:
            if data:
                slave.receive(data, now)
            if answer := slave.bytes_to_send(now):
                port.write(answer)
        timers = [timer for slave in slaves if (timer := slave.next_timer()) is not None]
        data = yield min(LOOK, max(0.0, min(timers, default=now + LOOK) - now))
