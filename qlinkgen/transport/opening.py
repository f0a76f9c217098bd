"""Opens ports for the command line and the protocols."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Literal

from qlinkgen.transport.port import Port
from qlinkgen.transport.reopening import ReopeningPort
from qlinkgen.transport.serial_port import SerialPort
from qlinkgen.transport.settings import RS485Settings


def open_port(
    name: str,
    *,
    baud: int = 115200,
    parity: Literal["none", "even", "odd"] = "none",
    stop_bits: Literal[1, 2] = 1,
    rs485: bool | RS485Settings | None = None,
    direction: Callable[[bool], None] | None = None,
    low_latency: bool = True,
    reopen: bool = False,
) -> Port:
    """Open a serial port by its device name or URL.

    Args:
        name: see `SerialPort`, also for the other arguments.
        baud: bits per second.
        parity: none, even or odd.
        stop_bits: 1 or 2.
        rs485: let the driver switch an RS485 transceiver.
        direction: function that switches it.
        low_latency: ask the driver to deliver received bytes immediately.
        reopen: after a reported loss, reopen the port at its next use; see `ReopeningPort`.

    Raises:
        ValueError: an argument is out of range.
        PortError: the port cannot be opened: PortMissing, PortBusy, CapabilityMissing.
    """

    def opener() -> Port:
        return SerialPort(
            name,
            baud,
            parity=parity,
            stop_bits=stop_bits,
            low_latency=low_latency,
            rs485=rs485,
            direction=direction,
        )

    return ReopeningPort(opener) if reopen else opener()


@contextlib.contextmanager
def closing_on_error(port: Port) -> Iterator[Port]:
    """Close a port if an error occurs while its user is made."""
    try:
        yield port
    except BaseException:
        port.close()
        raise
