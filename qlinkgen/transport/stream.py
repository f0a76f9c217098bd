"""A port over a channel of the system: every system error becomes a `PortLost`.

A channel transfers bytes and raises system errors. `DescriptorChannel` is the fast one;
`qlinkgen.transport.serial_port` has another for ports without a descriptor.
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
    #: System errors of a failing port.
    SYSTEM_ERRORS: tuple[type[Exception], ...] = (OSError,)
else:
    import termios

    SYSTEM_ERRORS = (OSError, termios.error)  # the second is not an OSError, though it has an errno

#: Most bytes of one read; the kernel's buffer of a serial line is not larger.
CHUNK = 4096

#: `select` takes no descriptor from here on (FD_SETSIZE).
_SELECT_LIMIT = 1024


class Channel(Protocol):
    """Transfers bytes. Raises system errors, and OSError at the end of the stream."""

    def read(self, timeout: float) -> bytes:
        """Return up to `CHUNK` bytes, b"" after `timeout` seconds without one."""

    def write(self, data: bytes) -> None:
        """Write all bytes."""

    def drain(self) -> None:
        """Return when the last bit has left, as far as the driver knows."""

    def fileno(self) -> int | None:
        """Return a descriptor to wait on, None where there is none."""

    def wake(self) -> None:
        """End the calls of other threads, which may raise OSError. Only `close` is called afterwards."""

    def close(self) -> None:
        """Release all resources. No call is inside."""


def _ready(descriptor: int, waker: int, timeout: float, *, writable: bool) -> tuple[bool, bool]:
    """Return whether a descriptor, and whether a waker, became ready within `timeout` seconds.

    `select` has microsecond resolution; `poll` rounds up to milliseconds, a dozen byte times at 115200 baud.
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
    """Reads and writes a non-blocking descriptor, at 1.2 times the cost of raw calls (pyserial: 1.5).

    A terminal must be set to VMIN=1: with 0 an empty read could mean "no data" as well as "unplugged".

    Args:
        descriptor: open, and non-blocking. Its opener closes it.
        stall: seconds without room for another byte after which a write fails.
    """

    def __init__(self, descriptor: int, stall: float) -> None:
        self._descriptor = descriptor
        self._stall = stall
        self._waker = Waker()
        self._woken = False
        self._draining = 0
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        #: The fastest check for available bytes: 0.9 us, while `select` takes 1.4 and an empty read 2.5.
        self._look = poll.poll

    def read(self, timeout: float) -> bytes:
        """Return available bytes, else the first ones to arrive."""
        if timeout <= 0:
            try:
                return self._present() if self._look(0) else b""
            except RuntimeError:  # a poll object allows one thread at a time
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
        """Return whether the descriptor became ready within `timeout` seconds. Raises OSError once woken."""
        ready, woken = _ready(self._descriptor, self._waker.descriptor, timeout, writable=writable)
        if woken:
            raise OSError("closed while a call was waiting")
        return ready

    def _present(self) -> bytes:
        """Return available bytes; b"" if another reader was faster."""
        try:
            data = os.read(self._descriptor, CHUNK)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError("end of the stream: it was unplugged, or its other side closed")
        return data

    def write(self, data: bytes) -> None:
        """Write all bytes, nearly always in one call."""
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
        raise OSError(f"no byte accepted for {self._stall:.1f} s, {len(data)} bytes unsent")

    def drain(self) -> None:
        """Wait until the driver has sent all bytes."""
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
        """End the calls of other threads. If one drains, unsent bytes are discarded."""
        self._woken = True
        self._waker.wake()
        if self._draining and sys.platform != "win32":
            with contextlib.suppress(*SYSTEM_ERRORS):  # a lost port does not drain
                termios.tcflush(self._descriptor, termios.TCOFLUSH)

    def close(self) -> None:
        """Close the resources of this channel. The opener closes the descriptor."""
        self._waker.close()


class StreamPort(Port):
    """Base class of ports over a channel. Every use of a lost or closed port raises `PortLost`."""

    _channel: Channel
    _gone = ""

    def __init__(self, name: str, baud: int) -> None:
        """Name the port; `_use` gives it its channel."""
        self.name = name
        self.baud = baud
        #: Resources to release when the port is closed and no call is inside, the last first.
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
            f"{self.name} was lost ({reason}); check the connection and the other end, then reopen it"
        )
        return PortLost(self._gone, port=self.name)

    def fileno(self) -> int | None:
        """Return a descriptor to wait on while the port is open, None if it has none."""
        return None if self._gone or self._gate.is_shut else self._channel.fileno()

    @contextlib.contextmanager
    def hold(self, wake: Callable[[], object]) -> Iterator[int | None]:
        """See `Port.hold`."""
        self._enter()
        thread = get_ident()
        self._gate.wakers.append(wake)
        try:
            if self._gate.is_shut:  # closed before the waker was registered
                raise closed_here(self.name)
            yield self._channel.fileno()
        finally:
            self._gate.wakers.remove(wake)
            self._gate.leave(thread)

    def close(self) -> None:
        """Close the port, also after its loss. See `Port.close`."""
        self._gate.shut()

    def _release(self) -> None:
        with contextlib.suppress(*SYSTEM_ERRORS):  # already closed or lost
            self._held.close()
