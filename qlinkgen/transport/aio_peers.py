"""The asyncio driver of one side of a link whose sides both ask; see `qlinkgen.transport.peers`."""

from __future__ import annotations

from qlinkgen.transport import aio
from qlinkgen.transport.aio import AsyncMaster
from qlinkgen.transport.peers import TURN
from qlinkgen.transport.serving import serving


class AsyncPeer(AsyncMaster):
    """Asks and answers on one port; its engine is a `PeerEngine`. Tasks of one event loop may use it."""

    async def serve(self) -> None:
        """Answer requests of the other side until the task is cancelled.

        Raises:
            PortLost: the port was lost.
        """
        steps, timeout = serving(self.port, self.engine), 0.0
        next(steps)
        while True:
            async with self._lock:
                timeout = steps.send(await aio.read(self.port, min(timeout, TURN)))
                self._report()
