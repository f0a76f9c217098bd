"""Settings of an open serial port beyond those of pyserial: latency, RS485, exclusive use.

All except `RS485Settings` are specific to Linux.
"""

from __future__ import annotations

import array
import contextlib
import os
import socket
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Protocol

from qlinkgen.errors import CapabilityMissing
from qlinkgen.transport.port import Ability

if sys.platform != "win32":
    import fcntl
    import termios

#: From the kernel's asm-generic/ioctls.h and linux/serial.h; Python's termios lacks them.
_TCGETS2 = 0x802C542A
_TIOCGRS485 = 0x542E
_RS485_ENABLED = 1

#: Largest relative difference between both ends: after ten bits the receiver must still sample the right one.
_BAUD_TOLERANCE = 0.025


class SerialStream(Protocol):
    """Interface of an open port of pyserial, which has no types: bytes."""

    @property
    def in_waiting(self) -> int:
        """Number of bytes available."""
        ...

    def read(self, size: int, /) -> bytes:
        """Return a number of bytes, or those received within the timeout."""
        ...

    def write(self, data: bytes, /) -> int | None:
        """Write bytes."""
        ...

    def flush(self) -> None:
        """Wait until all is sent."""
        ...


class Serial(SerialStream, Protocol):
    """An open port of pyserial; some kinds of port lack the attributes."""

    rs485_mode: object
    break_condition: bool
    set_low_latency_mode: Callable[[bool], None]

    def fileno(self) -> int:
        """Return the file descriptor."""
        ...

    def close(self) -> None:
        """Close the port."""
        ...


@dataclass(frozen=True, slots=True)
class RS485Settings:
    """Settings of the driver for switching the direction of an RS485 transceiver by RTS.

    Attributes:
        rts_level_for_tx: RTS while sending.
        rts_level_for_rx: RTS while receiving.
        loopback: receive sent bytes.
        delay_before_tx: seconds between switching and the first bit, in whole milliseconds.
        delay_before_rx: seconds between the last bit and switching back, in whole milliseconds.
    """

    rts_level_for_tx: bool = True
    rts_level_for_rx: bool = False
    loopback: bool = False
    delay_before_tx: float | None = None
    delay_before_rx: float | None = None


def set_rs485(serial: Serial, name: str, wanted: RS485Settings) -> None:
    """Make the driver switch the transceiver. Raises CapabilityMissing if it cannot."""
    from serial.rs485 import RS485Settings as Settings  # noqa: PLC0415  # rarely needed

    try:
        serial.rs485_mode = Settings(**asdict(wanted))
    except (ValueError, NotImplementedError) as error:
        raise CapabilityMissing(
            f"{name}: its driver cannot switch an RS485 transceiver; omit rs485 if the adapter switches "
            "by itself, as most USB ones do, or pass a function as direction=",
            port=name,
        ) from error


def rs485_state(descriptor: int) -> Ability:
    """Return whether the driver switches a transceiver now."""
    if sys.platform != "linux":
        return Ability.UNKNOWN
    state = array.array("I", [0] * 8)
    try:
        fcntl.ioctl(descriptor, _TIOCGRS485, state)
    except OSError:
        return Ability.NO
    return Ability.YES if state[0] & _RS485_ENABLED else Ability.NO


def set_low_latency(serial: Serial) -> bool:
    """Ask the driver to deliver bytes immediately (ASYNC_LOW_LATENCY). Return whether it accepted."""
    try:
        serial.set_low_latency_mode(True)
    except (ValueError, NotImplementedError, AttributeError):  # refused; another system; another kind of port
        return False
    return True


def check_baud(descriptor: int, name: str, wanted: int) -> None:
    """Compare with the actual speed of the driver: many accept any number and round it."""
    actual = _actual_baud(descriptor)
    if actual and abs(actual / wanted - 1) > _BAUD_TOLERANCE:
        raise CapabilityMissing(
            f"{name} does not support {wanted} baud: its driver has set {actual} instead; "
            "choose a supported rate, or another adapter",
            port=name,
        )


def _actual_baud(descriptor: int) -> int:
    if sys.platform != "linux":
        return 0
    # struct termios2: four words of flags, five of line discipline and control characters, then both speeds.
    state = array.array("I", [0] * 32)
    try:
        fcntl.ioctl(descriptor, _TCGETS2, state)
    except OSError:
        return 0
    return state[10]


def make_raw(descriptor: int) -> None:
    """Complete the raw mode of pyserial: an empty read means the end, and a break does not interrupt."""
    if sys.platform == "win32":
        return
    state = termios.tcgetattr(descriptor)
    state[0] &= ~termios.BRKINT
    state[6][termios.VMIN] = 1
    termios.tcsetattr(descriptor, termios.TCSANOW, state)


def shut_out(descriptor: int) -> None:
    """Also exclude programs that do not ask for a lock (except those of root)."""
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            fcntl.ioctl(descriptor, termios.TIOCEXCL)


def let_in(descriptor: int) -> None:
    """End `shut_out`: the kernel does so only when the port is closed in all processes."""
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            fcntl.ioctl(descriptor, termios.TIOCNXCL)


def send_at_once(descriptor: int) -> None:
    """Make TCP send small writes without waiting for earlier acknowledgements (TCP_NODELAY)."""
    with contextlib.suppress(OSError), socket.socket(fileno=os.dup(descriptor)) as own:
        own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
