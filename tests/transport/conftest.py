"""Ptys, a fake sysfs, and a simulated serial driver."""

from __future__ import annotations

import array
import fcntl
import os
import termios
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.transport import PtyPort, adapter, open_pty
from tests.cli.conftest import qlinkgen  # noqa: F401  # the fixture that runs the command line

#: Time limit in seconds; a longer wait has failed.
PATIENCE = 20.0


def descriptors() -> int:
    """Number of open descriptors of this process."""
    return len(list(Path("/proc/self/fd").iterdir()))


#: Makes the device of a pty look like `ftdi_sio` and the like.
Disguise = Callable[..., Path]


@pytest.fixture
def pty() -> Iterator[PtyPort]:
    """The master end of a pty."""
    with open_pty() as port:
        yield port


@pytest.fixture
def disguise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Disguise:
    """Return a function that makes an entry for a device in a fake sysfs."""
    monkeypatch.setattr(adapter, "SYSFS", tmp_path / "sys")

    def dress(path: str, driver: str = "", latency_timer: str | None = None, *, uart: bool = False) -> Path:
        number = os.stat(path).st_rdev  # noqa: PTH116
        device = tmp_path / "sys" / "devices" / "usb1" / "ttyUSB7"
        entry = device / "tty" / "ttyUSB7"
        entry.mkdir(parents=True)
        (entry / "device").symlink_to(device)
        if driver:
            (device / "driver").symlink_to(tmp_path / "sys" / "bus" / "usb-serial" / "drivers" / driver)
        if latency_timer is not None:
            (device / "latency_timer").write_text(latency_timer)
        if uart:
            (entry / "uartclk").write_text("1843200\n")
        numbers = tmp_path / "sys" / "dev" / "char"
        numbers.mkdir(parents=True, exist_ok=True)
        (numbers / f"{os.major(number)}:{os.minor(number)}").symlink_to(entry)
        return device

    return dress


class Driver:
    """Answers the ioctls of a real serial driver; everything else goes to the kernel.

    Attributes:
        words: last answer of each ioctl, by its number.
        asked: numbers of the ioctls that were sent here, in order.
    """

    def __init__(self, kernel: Callable[..., Any]) -> None:
        self.kernel = kernel
        self.words: dict[int, list[int]] = {}
        self.stored_by: dict[int, int] = {}
        self.asked: list[int] = []
        self.on_store: Callable[[int, list[int]], None] = lambda number, words: None

    def register(self, getter: int, setter: int | None, words: list[int]) -> None:
        """Answer `getter` with words, which `setter` changes."""
        self.words[getter] = words
        if setter is not None:
            self.stored_by[setter] = getter

    def ioctl(self, descriptor: int, number: int, argument: Any = 0, *rest: Any) -> Any:
        self.asked.append(number)
        if number in self.words and isinstance(argument, array.array):
            for index, word in enumerate(self.words[number]):
                argument[index] = word
            return 0
        if number in self.stored_by:
            self.words[self.stored_by[number]] = list(argument)
            self.on_store(number, list(argument))
            return 0
        return self.kernel(descriptor, number, argument, *rest)


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch) -> Driver:
    """A simulated driver, without abilities until they are registered."""
    pretended = Driver(fcntl.ioctl)
    monkeypatch.setattr(fcntl, "ioctl", pretended.ioctl)
    return pretended


LOW_LATENCY = 0x2000
GET_SERIAL, SET_SERIAL = termios.TIOCGSERIAL, termios.TIOCSSERIAL
GET_RS485, SET_RS485 = 0x542E, 0x542F
GET_TERMIOS2 = 0x802C542A
