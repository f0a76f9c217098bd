"""The blocking driver of one side of a link whose sides both ask; `aio_peers` has that for asyncio.

Requests of the other side are answered while this one asks, and between that while `serve` runs, in another
thread or task. Handlers are called wherever bytes are read, and must not send requests themselves.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, contextmanager

from qlinkgen.link.transaction import Question, Reply
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.serving import serving

#: Seconds that a request waits at most for `serve`, which reads the port in between.
TURN = 0.005


class BlockingPeer(BlockingMaster):
    """Asks and answers on one port; its engine is a `PeerEngine`. Any number of threads may use it."""

    def transact(self, request: Question, *, attempts: int | None = None, trial: bool = False) -> Reply:
        """Send a request; see `BlockingMaster.transact`."""
        with self._turn():
            return super().transact(request, attempts=attempts, trial=trial)

    def transaction(self) -> AbstractContextManager[object]:
        """Keep the other threads off the line; see `BlockingMaster.transaction`."""
        return self._turn()

    @contextmanager
    def _hold(self) -> Iterator[None]:
        with self._turn(), super()._hold():
            yield

    def serve(self, stop: Callable[[], bool]) -> None:
        """Answer requests of the other side until `stop()` is true.

        Raises:
            PortLost: the port was lost.
        """
        steps, timeout = serving(self.port, self.engine), 0.0
        next(steps)
        while not stop():
            with self._turn():
                timeout = steps.send(self.port.read(min(timeout, TURN)))
                self._report()

    @contextmanager
    def _turn(self) -> Generator[None]:
        """Hold the port; threads get it in the order in which they ask for it."""
        if self._asking == threading.get_ident():  # a request of on_event
            yield
            return
        with self._queue:
            self._lock.acquire()
        self._asking = threading.get_ident()
        try:
            yield
        finally:
            self._asking = None
            self._lock.release()
