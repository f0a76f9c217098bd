"""What is set at an open serial port beyond pyserial's own settings: latency, RS485, exclusive use.

All of it but `RS485Settings` is Linux's; the other systems have nothing like it, or no interface to it.
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

#: From the kernel's asm-generic/ioctls.h and linux/serial.h; Python's termios has no names for them.
_TCGETS2 = 0x802C542A
_TIOCGRS485 = 0x542E
_RS485_ENABLED = 1

#: Share by which both ends may differ: ten bits later the receiver must still sample within the right one.
_BAUD_TOLERANCE = 0.025


class SerialStream(Protocol):
    """How bytes go through an open port of pyserial, which has no types."""

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read at once."""
        ...

    def read(self, size: int, /) -> bytes:
        """Return so many bytes, or those that came within the timeout."""
        ...

    def write(self, data: bytes, /) -> int | None:
        """Hand over bytes."""
        ...

    def flush(self) -> None:
        """Wait until all is sent."""
        ...


class Serial(SerialStream, Protocol):
    """An open port of pyserial; not every kind of port has what is not a method."""

    rs485_mode: object
    set_low_latency_mode: Callable[[bool], None]

    def fileno(self) -> int:
        """Return the file descriptor."""
        ...

    def close(self) -> None:
        """Close the port."""
        ...


@dataclass(frozen=True, slots=True)
class RS485Settings:
    """How the driver switches the direction of an RS485 transceiver by RTS.

    Attributes:
        rts_level_for_tx: RTS while sending.
        rts_level_for_rx: RTS while receiving.
        loopback: receive what is sent.
        delay_before_tx: seconds between switching and the first bit, in whole milliseconds.
        delay_before_rx: seconds between the last bit and switching back, in whole milliseconds.
    """

    rts_level_for_tx: bool = True
    rts_level_for_rx: bool = False
    loopback: bool = False
    delay_before_tx: float | None = None
    delay_before_rx: float | None = None


def set_rs485(serial: Serial, name: str, wanted: RS485Settings) -> None:
    """Make the driver switch the transceiver. Raises CapabilityMissing where it cannot."""
    from serial.rs485 import RS485Settings as Settings  # noqa: PLC0415  # few need it

    try:
        serial.rs485_mode = Settings(**asdict(wanted))
    except (ValueError, NotImplementedError) as error:
        raise CapabilityMissing(
            f"{name}: its driver cannot switch an RS485 transceiver; leave rs485 out if the adapter switches "
            "by itself, as most USB ones do, or give direction= a function that does it",
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
    """Ask the driver to hand on bytes at once (ASYNC_LOW_LATENCY). Returns whether it agreed."""
    try:
        serial.set_low_latency_mode(True)
    except (ValueError, NotImplementedError, AttributeError):  # refused; another system; another kind of port
        return False
    return True


def check_baud(descriptor: int, name: str, wanted: int) -> None:
    """Compare with the speed that the driver has really set: many take any number and do what they can."""
    actual = _actual_baud(descriptor)
    if actual and abs(actual / wanted - 1) > _BAUD_TOLERANCE:
        raise CapabilityMissing(
            f"{name} cannot do {wanted} baud: its driver has set {actual} instead; "
            "choose a rate that it knows, or another adapter",
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
    """Finish what pyserial leaves: an empty read means the end, and a break is no interrupt."""
    if sys.platform == "win32":
        return
    state = termios.tcgetattr(descriptor)
    state[0] &= ~termios.BRKINT
    state[6][termios.VMIN] = 1
    termios.tcsetattr(descriptor, termios.TCSANOW, state)


def shut_out(descriptor: int) -> None:
    """Keep out programs that do not ask for a lock, too (only root is still let in)."""
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            fcntl.ioctl(descriptor, termios.TIOCEXCL)


def let_in(descriptor: int) -> None:
    """End `shut_out`: the kernel does so by itself only when nobody at all has the port open any more."""
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            fcntl.ioctl(descriptor, termios.TIOCNXCL)


def send_at_once(descriptor: int) -> None:
    """Make TCP send small writes without waiting for an acknowledgement of the one before."""
    with contextlib.suppress(OSError), socket.socket(fileno=os.dup(descriptor)) as own:
        own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
