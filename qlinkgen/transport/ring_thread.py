"""A thread that runs a ring node independently of the program."""

from __future__ import annotations

import contextlib
import select
import sys
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Protocol, Self, TypeVar

from qlinkgen.errors import PortError, PortLost
from qlinkgen.link.ring import RingNode
from qlinkgen.transport.forking import tell_of_forks
from qlinkgen.transport.handing_over import HandOver
from qlinkgen.transport.port import Port, closed_here
from qlinkgen.transport.ring_driver import FLUSH, GIVE_WAY, LOOK, LOOK_OFTEN, NodeIo, OnEvent, RingDriver
from qlinkgen.transport.waker import Waker

T = TypeVar("T")
#: `select` takes no descriptor from here on (FD_SETSIZE).
_SELECT_LIMIT = 1024


class _Waker(Protocol):
    def wait(self, timeout: float) -> bytes: ...

    def wake(self) -> None: ...

    def stop(self) -> None: ...

    def release(self) -> None: ...


class NodeThread(RingDriver):
    """Runs a node in its own thread.

    Attributes:
        node: the engine.
        port: the port of the node, owned by this driver.
        on_event: called with each event of the engine, in the thread of the node.
    """

    def __init__(self, port: Port, node: RingNode, *, on_event: OnEvent | None = None) -> None:
        """Start receiving and forwarding."""
        self.node = node
        self.port = port
        self.on_event = on_event
        self._io = NodeIo(port, node)
        self._changed = threading.Condition()
        self._failure: BaseException | None = None
        self._closing = False
        self._waker: _Waker = _waker(port, self)
        tell_of_forks(self)
        self._thread = threading.Thread(target=self._run, name=f"ring node at {port.name}", daemon=True)
        self._thread.start()

    def now(self) -> float:
        """Return the time on the port's clock."""
        return self.port.now()

    # the thread of the node

    def _run(self) -> None:
        with HandOver(self.fail), self.port.hold(self._waker.wake):
            data = b""
            while not self._closing:
                with self._changed:
                    now = self._io.step(data)
                    timeout = self._io.wait_at_most(now, 60.0)
                    self._changed.notify_all()
                self._io.report(self.on_event)
                data = self._waker.wait(timeout)

    def fail(self, failure: BaseException) -> None:
        """Keep an error for the next call of the program."""
        with self._changed:
            self._failure = failure
            self._changed.notify_all()

    def after_fork(self) -> None:
        """Fail in a forked child, in which the thread does not exist."""
        self._changed = threading.Condition()
        if not self._closing:
            self._failure = PortLost(
                f"{self.port.name} belongs to the parent process; open the port after the fork",
                port=self.port.name,
            )

    # the threads of the program

    def act(self, function: Callable[[float], T]) -> T:
        """See `RingDriver.act`.

        Raises:
            PortLost: the port was lost.
        """
        with self._changed:
            self._check()
            now = self.port.now()
            result = function(now)
            self._io.flush(now)
            self._leave()
        return result

    def until(self, attempt: Callable[[float], T | None], timeout: float | None) -> T | None:
        """See `RingDriver.until`.

        Raises:
            PortLost: the port was lost.
        """
        with self._changed:
            deadline = None if timeout is None else self.port.now() + timeout
            while True:
                self._check()
                now = self.port.now()
                value = attempt(now)
                if value is not None:
                    break
                left = None if deadline is None else deadline - now
                if left is not None and left <= 0:
                    return None
                self._changed.wait(left)
            self._io.flush(now)
            self._leave()
        return value

    def _leave(self) -> None:
        """Wake the thread if there is new work for it."""
        if self.node.next_timer() is not None or (self.on_event is not None and self.node.events):
            self._waker.wake()

    def give_way(self) -> None:
        """See `RingDriver.give_way`."""
        with self._changed:
            self._changed.wait(GIVE_WAY)

    def pause(self, seconds: float) -> None:
        """Sleep while the node runs."""
        self.port.sleep(seconds)

    def _check(self) -> None:
        if self._failure is not None:
            raise self._failure
        if self._closing:
            raise closed_here(self.port.name)

    def close(self) -> None:
        """Send the buffered bytes, stop the thread, and close the port.

        Raises:
            Exception: an exception of `on_event`; the port is closed all the same.
        """
        if self._closing:
            return
        failure = self._failure
        if failure is None:
            with contextlib.suppress(PortError):  # a lost port cannot send
                self.until(lambda _now: self.node.idle or None, FLUSH)
        self._closing = True
        self._waker.stop()
        if self._thread is not threading.current_thread():
            self._thread.join()
        self._waker.release()
        self.port.close()
        with self._changed:
            self._changed.notify_all()
        if failure is not None and not isinstance(failure, PortError):
            raise failure

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _waker(port: Port, driver: NodeThread) -> _Waker:
    descriptor = port.fileno()
    if descriptor is None or sys.platform == "win32":
        return _Slices(port, driver)
    return _Pipe(port, descriptor)


class _Pipe:
    """Waits for bytes on a descriptor, and can be woken."""

    def __init__(self, port: Port, descriptor: int) -> None:
        self._port = port
        self._waker = Waker()
        self._watched = (descriptor, self._waker.descriptor)
        self._poll = select.poll() if max(self._watched) >= _SELECT_LIMIT else None
        if self._poll is not None:
            for each in self._watched:
                self._poll.register(each, select.POLLIN)

    def wait(self, timeout: float) -> bytes:
        if self._poll is not None:
            ready = bool(self._poll.poll(timeout * 1000))
        else:
            ready = bool(select.select(self._watched, (), (), timeout)[0])
        if not ready:
            return b""
        self._waker.clear()
        return self._port.read(0)  # raises if the port was closed

    def wake(self) -> None:
        self._waker.wake()

    def stop(self) -> None:
        self._waker.wake()

    def release(self) -> None:
        self._waker.close()


class _Slices:
    """Waits for bytes on a port without a descriptor, in short intervals."""

    def __init__(self, port: Port, driver: NodeThread) -> None:
        self._port = port
        self._driver = driver

    def wait(self, timeout: float) -> bytes:
        often = not self._driver.node.idle
        return self._port.read(min(timeout, LOOK_OFTEN if often else LOOK))

    def wake(self) -> None:
        pass

    def stop(self) -> None:
        self._port.close()  # ends a waiting read

    def release(self) -> None:
        pass
