"""The blocking driver of masters and hosts; its deadlines are more precise than those of asyncio."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, contextmanager
from types import TracebackType
from typing import Any, Self, assert_never

from qlinkgen.errors import PortLost
from qlinkgen.link.events import Event
from qlinkgen.link.procedure import FAILURES, Ask, Outcome, Pause, Procedure, Report, Runner, Tell
from qlinkgen.link.transaction import Question, Reply
from qlinkgen.transport.conversation import Asker, MasterDriver, conversation, stream_of
from qlinkgen.transport.forking import tell_of_forks
from qlinkgen.transport.port import Port

#: Seconds in which other threads get the port, while one waits for the answers of a stream.
_LET_OTHERS = 0.0005


class BlockingMaster(MasterDriver):
    """Performs transactions on one bus.

    Any number of threads may use it: a lock of this bus is held during each transaction. Different buses do
    not wait for one another.

    Attributes:
        engine: deadlines, counters, health.
        port: the port of the bus.
        on_event: called with each event of the engine, in the calling thread.
    """

    def __init__(self, engine: Asker, port: Port, *, on_event: Callable[[Event], None] | None = None) -> None:
        super().__init__(engine, port, on_event)
        self._lock = threading.RLock()  # reentrant, since on_event may send requests
        self._queue = threading.Lock()  # of a peer, whose threads take turns
        self._asking: int | None = None  # the thread that holds it
        tell_of_forks(self)

    def transact(self, request: Question, *, attempts: int | None = None, trial: bool = False) -> Reply:
        """Send a request, and return the answer with the number of attempts and the time taken.

        Raises:
            NoReply: no reply was received, or the node is offline and its trial is not due.
            BadReply: only corrupt or wrong replies were received.
            Collision: the echo of the request was changed.
            PortLost: the port was lost.
            EncodeError: of the generated module; nothing was sent.
        """
        port = self.port
        with self._lock:
            outer, self._asking = self._asking, threading.get_ident()
            steps = conversation(self.engine, port, request, attempts, trial=trial)
            try:
                timeout = next(steps)
                while True:
                    timeout = steps.send(port.read(timeout))
            except StopIteration as end:
                reply: Reply = end.value
                return reply
            finally:
                steps.close()
                self._report()
                self._asking = outer

    def stream(self, request: Question, *, attempts: int | None = None) -> Generator[Any]:
        """Send a request whose answers another command stops, and return an iterator over them.

        The request is sent when the first answer is asked for. Closing the iterator sends the stopping
        command, which the caller may also send itself; so may it other requests, where the line allows it.

        Raises:
            NoReply: no reply was received, or no further one in time.
            Refused: the device refused the request, or ended the answers so.
            PortLost: the port was lost.
            TypeError: the answers of the request have an end.
        """
        stream = stream_of(self.transact(request, attempts=attempts))
        try:
            while stream is not None:
                while stream.answers:
                    yield stream.answers.popleft()
                if stream.ended:
                    break
                with self._hold():
                    data = self.port.read(self._wait_for(stream))
                    self._heard(stream, data)
                if not data:
                    self.port.sleep(_LET_OTHERS)
        except PortLost:
            stream = None
            raise
        finally:
            if stream is not None and not stream.ended:
                self.transact(stream.stop)
        if stream is not None and stream.error is not None:
            raise stream.error

    def transaction(self) -> AbstractContextManager[object]:
        """Keep the other threads off the line during a block of several calls.

        Blocks may be nested. The answers of a stream, and the requests of the other side of a link, wait too.
        """
        return self._lock

    @contextmanager
    def _hold(self) -> Iterator[None]:
        """Hold the port, and report events."""
        with self._lock:
            outer, self._asking = self._asking, threading.get_ident()
            try:
                yield
            finally:
                self._report()
                self._asking = outer

    def after_fork(self) -> None:
        """Abort a transaction of another thread, which does not exist in a forked child."""
        self._lock = threading.RLock()
        if self._asking not in {None, threading.get_ident()}:
            self._asking = None
            if self.engine.busy:
                self.engine.abort(self.port.now())

    def run(self, procedure: Procedure[Outcome], progress: Callable[[Report], None] | None = None) -> Outcome:
        """Run a procedure to its end; `progress` is called with each report."""
        runner = Runner(procedure)
        try:
            while runner.advance():
                told = self._do(runner)
                if told is not None and progress is not None:
                    progress(told.report)
            return runner.result
        finally:
            runner.close()

    def iterate(self, procedure: Procedure[Outcome]) -> Generator[Report, None, Outcome]:
        """Run a procedure as an iterator over its reports; it advances with the iterator."""
        runner = Runner(procedure)
        try:
            while runner.advance():
                told = self._do(runner)
                if told is not None:
                    yield told.report
            return runner.result
        finally:
            runner.close()

    def _do(self, runner: Runner[Outcome]) -> Tell | None:
        """Perform a step of a procedure; return a report."""
        step = runner.wanted
        if isinstance(step, Ask):
            try:
                runner.outcome = self.transact(step.request, attempts=step.attempts, trial=step.trial)
            except FAILURES as error:
                runner.failure = error
        elif isinstance(step, Pause):
            self.port.sleep(step.seconds)
            runner.outcome = self.port.now()
        elif isinstance(step, Tell):
            return step
        else:
            assert_never(step)
        return None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
