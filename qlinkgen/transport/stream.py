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
from typing import Protocol

from qlinkgen.errors import PortLost
from qlinkgen.transport.port import Port

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

    def close(self) -> None:
        """Give everything back."""


def wait(descriptor: int, timeout: float, *, writable: bool = False) -> bool:
    """Return whether a descriptor got ready within `timeout` seconds.

    `select` keeps to microseconds; `poll` rounds up to milliseconds, a dozen byte times at 115200 baud.
    """
    if descriptor < _SELECT_LIMIT:
        watched = (descriptor,)
        readers, writers, _ = select.select(
            () if writable else watched, watched if writable else (), (), timeout
        )
        return bool(readers or writers)
    poll = select.poll()
    poll.register(descriptor, select.POLLOUT if writable else select.POLLIN)
    return bool(poll.poll(timeout * 1000))


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
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        #: The quickest way to ask whether there is something: 0.9 us, where `select` takes 1.4 and an empty
        #: read 2.5.
        self._look = poll.poll

    def read(self, timeout: float) -> bytes:
        """Return what is there, else what comes first."""
        if timeout <= 0:
            return self._present() if self._look(0) else b""
        limit = time.monotonic() + timeout
        while wait(self._descriptor, timeout):
            if data := self._present():
                return data
            timeout = limit - time.monotonic()
            if timeout <= 0:
                break
        return b""

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
            if wait(self._descriptor, self._stall, writable=True):
                data = data[self._some(data) :]
            else:
                data = self._stalled(data)

    def _stalled(self, data: memoryview) -> memoryview:
        raise OSError(f"it took no byte for {self._stall:.1f} s, and {len(data)} are still to be sent")

    def drain(self) -> None:
        """Wait until the driver has sent everything."""
        if sys.platform != "win32":
            termios.tcdrain(self._descriptor)

    def fileno(self) -> int | None:
        """Return the descriptor."""
        return self._descriptor

    def close(self) -> None:
        """Do nothing: who opened the descriptor closes it."""


class StreamPort(Port):
    """What ports over a channel share. A port that was lost or closed says so at every further use."""

    _channel: Channel
    _gone = ""

    def read(self, timeout: float) -> bytes:
        """See `Port.read`; at most 4096 bytes at a time."""
        if self._gone:
            raise PortLost(self._gone, port=self.name)
        try:
            return self._channel.read(timeout)
        except SYSTEM_ERRORS as error:
            raise self._lose(error) from error

    def write(self, data: bytes) -> None:
        """See `Port.write`."""
        if self._gone:
            raise PortLost(self._gone, port=self.name)
        try:
            self._channel.write(data)
        except SYSTEM_ERRORS as error:
            raise self._lose(error) from error

    def _lose(self, error: Exception) -> PortLost:
        reason = getattr(error, "strerror", None) or error.args[-1]
        self._gone = (
            f"{self.name} was lost ({reason}); check the plug and what is at its other end, open it again"
        )
        return PortLost(self._gone, port=self.name)

    def fileno(self) -> int | None:
        """Return a descriptor to wait on while the port is open, None where there is none."""
        return None if self._gone else self._channel.fileno()

    def close(self) -> None:
        """Give the port back, also one that was lost. Closing twice does no harm."""
        self._gone = f"{self.name} was closed here; open it again to use it"
        with contextlib.suppress(*SYSTEM_ERRORS):  # what is gone already needs no closing
            self._channel.close()
