"""Fixtures for tests of the firmware: import them into the conftest of the folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NoReturn
from zlib import crc32

import pytest

from qlinkgen.transport import open_port
from tests.firmware.firmware import TARGETS, Firmware, build, has_header
from tests.firmware.line import FirmwareLine

__all__ = ["BuildFirmware", "FirmwareLines", "build_firmware", "firmware_line"]

#: Builds an application for a port and returns the program: build_firmware("posix", "trio_keypad").
BuildFirmware = Callable[..., Path]
#: Returns the line to the running Q.link node of a port.
FirmwareLines = Callable[[str], FirmwareLine]


@pytest.fixture(scope="session")
def build_firmware(
    require_tool: Callable[..., str],
    missing_tool: Callable[..., NoReturn],
    shared: Path,
) -> BuildFirmware:
    """Return a function that builds, once for all workers, or skips if a tool is missing."""

    def make(target: str, app: str = "qlink_node", options: str = "") -> Path:
        for tool, package in (("make", "make"), *TARGETS[target].tools):
            require_tool(tool, package=package)
        for header, compiler, package in TARGETS[target].headers:
            if not has_header(header, compiler):
                missing_tool(header, package=package)
        return build(target, app, shared / "firmware" / f"{crc32(options.encode()):08x}", options)

    return make


class Running:
    """The Q.link node of a port, running, with its line."""

    def __init__(self, target: str, program: Path) -> None:
        processor = _own_processor() if TARGETS[target].pinned else None
        self.firmware = Firmware(target, program, processor=processor)
        self.line = FirmwareLine(open_port(self.firmware.start()))
        self.line.wait_until_up()

    @property
    def usable(self) -> bool:
        """Whether a test can use it."""
        return self.firmware.running and not self.line.broken

    def stop(self) -> None:
        """End it."""
        self.line.port.close()
        self.firmware.stop()


@pytest.fixture(scope="module")
def firmware_line(build_firmware: BuildFirmware) -> Iterator[FirmwareLines]:
    """Return a function that returns the line to the Q.link node of a port.

    One process for each module of tests: each test configures it first. It ends with the module, since an
    idle emulator takes processor time from other tests.
    """
    running: dict[str, Running] = {}

    def line_to(target: str) -> FirmwareLine:
        program = build_firmware(target, "qlink_node", TARGETS[target].options)
        known = running.get(target)
        if known is not None and not known.usable:
            known.stop()
            known = None
        if known is None:
            known = running[target] = Running(target, program)
        return known.line

    yield line_to
    for each in running.values():
        each.stop()


def _own_processor() -> int | None:
    """Return a processor for this worker; None if the system has no choice."""
    if not hasattr(os, "sched_getaffinity"):
        return None
    mine = sorted(os.sched_getaffinity(0))
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0")
    return mine[int(worker.removeprefix("gw")) % len(mine)]
