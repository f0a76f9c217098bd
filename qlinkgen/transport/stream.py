"""A port over a channel of the system: every fault of the system becomes a `PortLost`.

A channel is anything that moves bytes and fails with the system's own errors. `DescriptorChannel` is the fast
one; `qlinkgen.transport.serial_port` has another for what has no descriptor.
"""

from __future__ import annotations

import contextlib
import os
import select
import sys
import time
from collections.abc import Callable, Iterator
from threading import get_ident
from typing import Protocol

from qlinkgen.errors import PortLost
from qlinkgen.transport.gate import Gate
from qlinkgen.transport.port import Port, closed_here
from qlinkgen.transport.waker import Waker

if sys.platform == "win32":
    #: What the system raises when a port fails.
    SYSTEM_ERRORS: tuple[type[Exception], ...] = (OSError,)
else:
    import termios

    SYSTEM_ERRORS = (OSError, termios.error)  # the second is no OSError, though it carries an errno

#: Most bytes that one read returns; the kernel keeps no more for a serial line.
CHUNK = 4096

#: `select` takes no descriptor from here on (FD_SETSIZE).
_SELECT_LIMIT = 1024


class Channel(Protocol):
    """Moves bytes. Raises what the system raises, and OSError at the end of the stream."""

    def read(self, timeout: float) -> bytes:
        """Return up to `CHUNK` bytes, b"" when `timeout` seconds brought none."""

    def write(self, data: bytes) -> None:
        """Hand over all bytes."""

    def drain(self) -> None:
        """Return when the last bit has left, as far as the driver knows."""

    def fileno(self) -> int | None:
        """Return a descriptor to wait on, None where there is none."""

    def wake(self) -> None:
        """End the calls of other threads: they may raise OSError. No further call follows but `close`."""

    def close(self) -> None:
        """Give everything back. No call is inside any more."""


def _ready(descriptor: int, waker: int, timeout: float, *, writable: bool) -> tuple[bool, bool]:
    """Return whether a descriptor, and whether a waker, got ready within `timeout` seconds.

    `select` keeps to microseconds; `poll` rounds up to milliseconds, a dozen byte times at 115200 baud.
    """
    if descriptor < _SELECT_LIMIT and waker < _SELECT_LIMIT:
        if writable:
            readers, writers, _ = select.select((waker,), (descriptor,), (), timeout)
            return bool(writers), bool(readers)
        readers = select.select((descriptor, waker), (), (), timeout)[0]
        return descriptor in readers, waker in readers
    poll = select.poll()
    poll.register(descriptor, select.POLLOUT if writable else select.POLLIN)
    poll.register(waker, select.POLLIN)
    found = [each for each, _ in poll.poll(timeout * 1000)]
    return descriptor in found, waker in found


class DescriptorChannel:
    """Reads and writes a non-blocking descriptor itself: 1.2 times the cost of raw calls, pyserial takes 1.5.

    A terminal must be set to VMIN=1: with 0 an empty read could mean "nothing yet" as well as "unplugged".

    Args:
        descriptor: open, and non-blocking. It is closed by who opened it.
        stall: seconds without room for another byte after which a write is given up.
    """

    def __init__(self, descriptor: int, stall: float) -> None:
        self._descriptor = descriptor
        self._stall = stall
        self._waker = Waker()
        self._woken = False
        self._draining = 0
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        #: The quickest way to ask whether there is something: 0.9 us, where `select` takes 1.4 and an empty
        #: read 2.5.
        self._look = poll.poll

    def read(self, timeout: float) -> bytes:
        """Return what is there, else what comes first."""
        if timeout <= 0:
            try:
                return self._present() if self._look(0) else b""
            except RuntimeError:  # a poll object takes one thread at a time
                return self._present()
        limit = time.monotonic() + timeout
        while self._wait(timeout):
            if data := self._present():
                return data
            timeout = limit - time.monotonic()
            if timeout <= 0:
                break
        return b""

    def _wait(self, timeout: float, *, writable: bool = False) -> bool:
        """Return whether the descriptor got ready within `timeout` seconds. Raises OSError once woken."""
        ready, woken = _ready(self._descriptor, self._waker.descriptor, timeout, writable=writable)
        if woken:
            raise OSError("closed while a call was waiting")
        return ready

    def _present(self) -> bytes:
        """Return what is there; b"" when another reader was quicker."""
        try:
            data = os.read(self._descriptor, CHUNK)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError("end of the stream: it was unplugged, or its other side closed")
        return data

    def write(self, data: bytes) -> None:
        """Hand over all bytes, nearly always in one call."""
        written = self._some(data)
        if written < len(data):
            self._rest(memoryview(data)[written:])

    def _some(self, data: bytes | memoryview) -> int:
        try:
            return os.write(self._descriptor, data)
        except BlockingIOError:
            return 0

    def _rest(self, data: memoryview) -> None:
        while data:
            ready = self._wait(self._stall, writable=True)
            data = data[self._some(data) :] if ready else self._stalled(data)

    def _stalled(self, data: memoryview) -> memoryview:
        raise OSError(f"it took no byte for {self._stall:.1f} s, and {len(data)} are still to be sent")

    def drain(self) -> None:
        """Wait until the driver has sent everything."""
        if sys.platform == "win32":
            return
        self._draining += 1
        try:
            if self._woken:
                raise OSError("closed before everything was sent")
            termios.tcdrain(self._descriptor)
        finally:
            self._draining -= 1

    def fileno(self) -> int | None:
        """Return the descriptor."""
        return self._descriptor

    def wake(self) -> None:
        """End the calls of other threads. Where one drains, what is still to be sent is thrown away."""
        self._woken = True
        self._waker.wake()
        if self._draining and sys.platform != "win32":
            with contextlib.suppress(*SYSTEM_ERRORS):  # a port that is gone drains nothing
                termios.tcflush(self._descriptor, termios.TCOFLUSH)

    def close(self) -> None:
        """Close what belongs to this channel. The descriptor is closed by the code that opened it."""
        self._waker.close()


class StreamPort(Port):
    """What ports over a channel share. A port that was lost or closed says so at every further use."""

    _channel: Channel
    _gone = ""

    def __init__(self, name: str, baud: int) -> None:
        """Name the port; `_use` gives it its channel."""
        self.name = name
        self.baud = baud
        #: What is given back when the port is closed and no call is inside, the last first.
        self._held = contextlib.ExitStack()
        self._gate = Gate(self._release)

    def _use(self, channel: Channel) -> None:
        self._channel = channel
        self._held.callback(channel.close)
        self._gate.wakers.append(channel.wake)

    def _enter(self) -> None:
        if not self._gate.enter():
            raise closed_here(self.name)
        if self._gone:
            self._gate.leave(get_ident())
            raise PortLost(self._gone, port=self.name)

    def read(self, timeout: float) -> bytes:
        """See `Port.read`; at most 4096 bytes at a time."""
        self._enter()
        try:
            data = self._channel.read(timeout)
        except SYSTEM_ERRORS as error:
            raise self._lose(error) from error
        finally:
            self._gate.leave(get_ident())
        if not data and self._gate.is_shut:
            raise closed_here(self.name)
        return data

    def write(self, data: bytes) -> None:
        """See `Port.write`."""
        self._enter()
        try:
            self._channel.write(data)
        except SYSTEM_ERRORS as error:
            raise self._lose(error) from error
        finally:
            self._gate.leave(get_ident())

    def _drain(self) -> None:
        """Return when the last bit has left, as far as the driver knows."""
        self._enter()
        try:
            self._channel.drain()
        except SYSTEM_ERRORS as error:
            raise self._lose(error) from error
        finally:
            self._gate.leave(get_ident())

    def _lose(self, error: Exception) -> PortLost:
        if self._gate.is_shut:
            return closed_here(self.name)
        reason = getattr(error, "strerror", None) or error.args[-1]
        self._gone = (
            f"{self.name} was lost ({reason}); check the plug and what is at its other end, open it again"
        )
        return PortLost(self._gone, port=self.name)

    def fileno(self) -> int | None:
        """Return a descriptor to wait on while the port is open, None where there is none."""
        return None if self._gone or self._gate.is_shut else self._channel.fileno()

    @contextlib.contextmanager
    def hold(self, wake: Callable[[], object]) -> Iterator[int | None]:
        """See `Port.hold`."""
        self._enter()
        thread = get_ident()
        self._gate.wakers.append(wake)
        try:
            if self._gate.is_shut:  # too late for the waker to be seen
                raise closed_here(self.name)
            yield self._channel.fileno()
        finally:
            self._gate.wakers.remove(wake)
            self._gate.leave(thread)

    def close(self) -> None:
        """Give the port back, also one that was lost. See `Port.close`."""
        self._gate.shut()

    def _release(self) -> None:
        with contextlib.suppress(*SYSTEM_ERRORS):  # what is gone already needs no closing
            self._held.close()
