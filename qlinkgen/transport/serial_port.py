"""Serial ports of this machine and of the network, opened by pyserial.

On ports with a file descriptor, bytes are read and written through it and pyserial only configures the port;
on others (Windows, rfc2217:// and other URLs) pyserial reads and writes.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable
from threading import get_ident
from typing import Literal

from qlinkgen.errors import CapabilityMissing, PortError
from qlinkgen.transport import settings
from qlinkgen.transport.adapter import Adapter, look_up
from qlinkgen.transport.failures import check_url, explain
from qlinkgen.transport.port import Ability, Capabilities
from qlinkgen.transport.settings import RS485Settings
from qlinkgen.transport.stream import CHUNK, SYSTEM_ERRORS, Channel, DescriptorChannel, StreamPort

#: URLs whose descriptor can be read directly; hwgrep:// looks for a device by its description.
_DIRECT = frozenset({"", "hwgrep", "socket"})

#: pyserial's own timeout, set once: changing it costs 6 us, and on rfc2217:// a round trip.
_SLICE = 0.01

#: Polling interval in seconds during the last part of a wait, which is shorter than a slice.
_LOOK = 0.0002

_PARITIES = {"none": "N", "even": "E", "odd": "O"}


class PyserialChannel:
    """Reads and writes by pyserial, for ports without a usable descriptor."""

    def __init__(self, serial: settings.SerialStream) -> None:
        self._serial = serial
        self._woken = False

    def read(self, timeout: float) -> bytes:
        """Return available bytes, else the first ones to arrive."""
        limit = time.monotonic() + timeout
        while not self._serial.in_waiting:
            left = limit - time.monotonic()
            if left <= 0 or self._woken:
                return b""
            if left > _SLICE:
                if first := bytes(self._serial.read(1)):
                    return self._with_waiting(first)
            else:
                time.sleep(min(left, _LOOK))
        return self._with_waiting(b"")

    def _with_waiting(self, data: bytes) -> bytes:
        while len(data) < CHUNK and (size := self._serial.in_waiting):
            try:
                data += self._serial.read(min(size, CHUNK - len(data)))
            except SYSTEM_ERRORS:
                if data:  # the next read raises again
                    break
                raise
        return data

    def write(self, data: bytes) -> None:
        """Write all bytes."""
        self._serial.write(data)

    def drain(self) -> None:
        """Wait until all is sent, as far as pyserial knows."""
        self._serial.flush()

    def fileno(self) -> int | None:
        """Return None: these ports have no descriptor to wait on."""
        return None

    def wake(self) -> None:
        """End a read within a slice, and on Windows a write."""
        self._woken = True
        if (cancel := getattr(self._serial, "cancel_write", None)) is not None:
            with contextlib.suppress(*SYSTEM_ERRORS):  # a lost port does not wait
                cancel()

    def close(self) -> None:
        """Do nothing: the port closes pyserial's object."""


class SerialPort(StreamPort):
    """A serial port: 8 data bits, raw, without flow control, exclusive to this program.

    Args:
        name: a device such as /dev/ttyUSB0, /dev/serial/by-id/... or COM3; or a URL of pyserial such as
            socket://HOST:PORT (raw bytes) or rfc2217://HOST:PORT (a serial device server).
        baud: bits per second. On a pty and on socket:// it only serves arithmetic.
        parity: none, even or odd.
        stop_bits: 1 or 2.
        low_latency: ask the driver to deliver received bytes immediately. It may refuse; see `capabilities`.
        rs485: let the driver switch the transceiver's direction; True for its default settings.
        direction: called with True before bytes are sent, with False after the last was transmitted and
            before the port is opened, for a transceiver switched by the caller.

    Raises:
        ValueError: an argument is out of range.
        PortMissing: the port does not exist, or the server of the URL does not respond.
        PortBusy: another program uses it, or this user lacks the permission.
        CapabilityMissing: the driver does not support the baud rate or `rs485`.
        PortError: it is not a serial port.
    """

    def __init__(
        self,
        name: str,
        baud: int = 115200,
        *,
        parity: Literal["none", "even", "odd"] = "none",
        stop_bits: Literal[1, 2] = 1,
        low_latency: bool = True,
        rs485: bool | RS485Settings | None = None,
        direction: Callable[[bool], None] | None = None,
    ) -> None:
        _check(name, baud, parity, stop_bits)
        if rs485 and direction is not None:
            raise ValueError(
                "rs485 and direction exclude each other: the driver or the caller switches; pass one of them"
            )
        super().__init__(name, baud)
        self._direction = direction
        if direction is not None:
            direction(False)
        self._serial = _open(name, baud, _PARITIES[parity], stop_bits)
        self._held.callback(self._serial.close)
        try:
            self._use(self._make_channel())
            self.capabilities = self._set_up(low_latency=low_latency, rs485=rs485)
        except PortError:
            self.close()
            raise
        except SYSTEM_ERRORS as error:
            self.close()
            raise explain(name, error) from error

    def _make_channel(self) -> Channel:
        if sys.platform == "win32" or _scheme(self.name) not in _DIRECT:
            return PyserialChannel(self._serial)
        # A full buffer of 4096 bytes may have no room until all of it is transmitted.
        return DescriptorChannel(self._serial.fileno(), stall=1 + CHUNK * 10 / self.baud)

    def _set_up(self, *, low_latency: bool, rs485: bool | RS485Settings | None) -> Capabilities:
        descriptor = self._channel.fileno()
        if descriptor is None or _scheme(self.name) == "socket":
            return self._set_up_remote(descriptor, rs485)
        if rs485:
            settings.set_rs485(self._serial, self.name, RS485Settings() if rs485 is True else rs485)
        settings.check_baud(descriptor, self.name, self.baud)
        settings.make_raw(descriptor)
        accepted = low_latency and settings.set_low_latency(self._serial)
        adapter = look_up(descriptor)  # after low latency was set, which changes the result
        if adapter.paced is not Ability.NO:
            settings.shut_out(descriptor)
            self._held.callback(settings.let_in, descriptor)
        return _capabilities(adapter, accepted=accepted, rs485=settings.rs485_state(descriptor))

    def _set_up_remote(self, descriptor: int | None, rs485: bool | RS485Settings | None) -> Capabilities:
        if rs485 or self._direction is not None:
            raise CapabilityMissing(
                f"{self.name}: only a local port can switch a transceiver's direction; "
                "let the device server or the adapter switch it",
                port=self.name,
            )
        if _scheme(self.name) != "socket":
            return Capabilities(latency_source="pyserial does not report it")
        if descriptor is not None:
            settings.send_at_once(descriptor)
        return Capabilities(paced=Ability.NO, latency_source="not available for a network connection")

    def write(self, data: bytes) -> None:
        """See `Port.write`. With `direction` it returns after the last byte was transmitted."""
        if self._direction is None or self._gone or self._gate.is_shut:
            super().write(data)
            return
        self._direction(True)
        try:
            super().write(data)
            self._drain()
        finally:
            self._direction(False)

    def send_break(self, seconds: float) -> None:
        """See `Port.send_break`. The system may make it longer, by a millisecond or so."""
        if self._direction is not None and not self._gone and not self._gate.is_shut:
            self._direction(True)  # `write` of the frame ends it
        self._drain()
        self._enter()
        try:
            self._serial.break_condition = True
            time.sleep(seconds)
            self._serial.break_condition = False
        except SYSTEM_ERRORS as error:
            raise self._lose(error) from error
        finally:
            self._gate.leave(get_ident())


def _check(name: object, baud: object, parity: object, stop_bits: object) -> None:
    if not isinstance(name, str) or not name.strip():
        raise ValueError(f"name: {name!r} was given; give a device such as /dev/ttyUSB0, or a URL")
    if not isinstance(baud, int) or not 1 <= baud <= 100_000_000:
        raise ValueError(f"baud: {baud!r} was given; give bits a second, such as 115200")
    if parity not in _PARITIES:
        raise ValueError(f"parity: {parity!r} was given; it is one of {', '.join(_PARITIES)}")
    if stop_bits not in {1, 2}:
        raise ValueError(f"stop_bits: {stop_bits!r} was given; it is 1 or 2")


def _scheme(name: str) -> str:
    return name.partition("://")[0].lower() if "://" in name else ""


def _open(name: str, baud: int, parity: str, stop_bits: int) -> settings.Serial:
    check_url(name)
    import serial  # noqa: PLC0415  # takes 9 ms, and simulated ports do not need it

    options = {"parity": parity, "stopbits": stop_bits, "timeout": _SLICE, "exclusive": True}
    try:
        opened: settings.Serial = serial.serial_for_url(name, baud, **options)
    except (*SYSTEM_ERRORS, ValueError) as error:  # ValueError: a URL unknown to pyserial
        raise explain(name, error) from error
    return opened


def _capabilities(adapter: Adapter, *, accepted: bool, rs485: Ability) -> Capabilities:
    at_once = adapter.latency is not None and adapter.latency <= 0.001
    refused = Ability.UNKNOWN if adapter.latency is None else Ability.NO
    return Capabilities(
        exclusive=Ability.YES,
        low_latency=Ability.YES if accepted or at_once else refused,
        rs485=rs485,
        paced=adapter.paced,
        latency=adapter.latency,
        latency_source=adapter.source,
        driver=adapter.driver,
    )
