"""Reads the kernel's information on the hardware of a terminal: driver, latency, pacing.

Nothing is changed. The information is available on Linux; elsewhere all of it is unknown.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path

from qlinkgen.transport.port import Ability

#: The kernel's list of terminals.
SYSFS = Path("/sys")

#: Description of the processor, which identifies a virtual machine.
CPUINFO = Path("/proc/cpuinfo")

#: Major numbers of the slave ends of ptys: Unix98 and, long ago, BSD (Documentation/admin-guide/devices.txt).
_PTY_MAJORS = frozenset({3, *range(136, 144)})

#: Drivers of adapters that always have a UART; cdc_acm, for example, often has none.
_UART_BRIDGES = frozenset(
    {
        "ark3116",
        "ch341-uart",
        "cp210x",
        "ftdi_sio",
        "io_ti",
        "mos7720",
        "mos7840",
        "mxuport",
        "pl2303",
        "xr_serial",
    }
)


@dataclass(frozen=True, slots=True)
class Adapter:
    """The hardware of a terminal.

    Attributes:
        driver: the kernel's driver, such as `ftdi_sio`; empty if unknown.
        latency: longest time in seconds that received bytes are held back, None if the driver does not report
            it.
        source: source of that number, or why it is unknown.
        paced: bytes are transmitted at the baud rate.
    """

    driver: str = ""
    latency: float | None = None
    source: str = "not available on this system"
    paced: Ability = Ability.UNKNOWN


def look_up(descriptor: int) -> Adapter:
    """Return the hardware of an open terminal.

    It is found by device number, so links such as those in /dev/serial/by-id give the same result.
    """
    if sys.platform != "linux":
        return Adapter()
    number = os.fstat(descriptor).st_rdev
    entry = SYSFS / "dev" / "char" / f"{os.major(number)}:{os.minor(number)}"
    if entry.is_dir():
        return _of_device(entry)
    if os.major(number) in _PTY_MAJORS:
        return Adapter("pty", 0.0, "a pty delivers bytes immediately", Ability.NO)
    return Adapter()


def _of_device(entry: Path) -> Adapter:
    name = entry.resolve().name
    driver = _link_name(entry / "device" / "driver")
    latency = _latency_timer(entry / "device" / "latency_timer")
    if latency is None:
        source = f"the driver {driver} does not report it" if driver else "the driver is unknown"
    else:
        source = f"latency_timer of {driver or 'the driver'} (/sys/class/tty/{name}/device/latency_timer)"
    return Adapter(driver, latency, source, _paced(entry, driver))


def _link_name(link: Path) -> str:
    try:
        return link.readlink().name
    except OSError:
        return ""


def _latency_timer(file: Path) -> float | None:
    # Milliseconds. Only ftdi_sio has it, and reports 1 in low-latency mode.
    try:
        return int(file.read_text("ascii")) / 1000
    except (OSError, ValueError):
        return None


def _paced(entry: Path, driver: str) -> Ability:
    if driver in _UART_BRIDGES:
        return Ability.YES
    if (entry / "uartclk").exists() and not _is_virtual():
        return Ability.YES
    return Ability.UNKNOWN


def _is_virtual() -> bool:
    # The UART of a virtual machine sends immediately at any baud rate.
    try:
        return "hypervisor" in CPUINFO.read_text("ascii", "replace")
    except OSError:
        return True
