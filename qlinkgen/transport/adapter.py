"""What the kernel tells about the hardware behind a terminal: driver, latency, whether bytes take time.

Everything here is looked up, nothing is changed. Linux tells; elsewhere all of it is unknown.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path

from qlinkgen.transport.port import Ability

#: Where the kernel shows its devices.
SYSFS = Path("/sys")

#: Where the processor is described; a virtual one says so.
CPUINFO = Path("/proc/cpuinfo")

#: Major numbers of the slave ends of ptys: Unix98 and, long ago, BSD (Documentation/admin-guide/devices.txt).
_PTY_MAJORS = frozenset({3, *range(136, 144)})

#: Drivers of adapters that always have a UART behind them; cdc_acm, for one, often has none.
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
    """What is behind a terminal.

    Attributes:
        driver: the kernel's driver, such as `ftdi_sio`; empty where it is not known.
        latency: most seconds that received bytes are held back, None where the driver does not tell.
        source: where that number comes from, or why there is none.
        paced: bytes take their time on a line.
    """

    driver: str = ""
    latency: float | None = None
    source: str = "this system does not tell"
    paced: Ability = Ability.UNKNOWN


def look_up(descriptor: int) -> Adapter:
    """Return what is known of the open terminal.

    It is found by device number, so links such as those in /dev/serial/by-id lead to the same place.
    """
    if sys.platform != "linux":
        return Adapter()
    number = os.fstat(descriptor).st_rdev
    entry = SYSFS / "dev" / "char" / f"{os.major(number)}:{os.minor(number)}"
    if entry.is_dir():
        return _of_device(entry)
    if os.major(number) in _PTY_MAJORS:
        return Adapter("pty", 0.0, "a pty hands bytes on at once", Ability.NO)
    return Adapter()


def _of_device(entry: Path) -> Adapter:
    name = entry.resolve().name
    driver = _link_name(entry / "device" / "driver")
    latency = _latency_timer(entry / "device" / "latency_timer")
    if latency is None:
        source = f"the driver {driver} does not tell" if driver else "no driver is named, so nothing tells"
    else:
        source = f"latency_timer of {driver or 'the driver'} (/sys/class/tty/{name}/device/latency_timer)"
    return Adapter(driver, latency, source, _paced(entry, driver))


def _link_name(link: Path) -> str:
    try:
        return link.readlink().name
    except OSError:
        return ""


def _latency_timer(file: Path) -> float | None:
    # Milliseconds. Only ftdi_sio has it, and says 1 while low latency is on.
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
    # The UART of a virtual machine sends at any baud rate without taking time for it.
    try:
        return "hypervisor" in CPUINFO.read_text("ascii", "replace")
    except OSError:
        return True
