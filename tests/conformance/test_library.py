"""Kits of protocols of the library on other processors, emulated."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.schema import find, load
from tests.conformance import emulators, kits

#: Small ones of different kinds: bits in an array, a terminator without a check value, seeds, sizes by count.
KITS = ("crsf", "visca", "mavlink_1", "modbus_rtu")


def written(name: str, folder: Path) -> Path:
    return kits.write(name, folder, model=load(find(name)))


def complete(report: kits.Report, name: str) -> None:
    """Every test passed, and every message was encoded or decoded."""
    report.check()
    tried = {each.split(" ")[0] for each in report.names}
    assert tried >= {each.name for each in load(find(name)).messages}


@pytest.mark.slow
@pytest.mark.parametrize("name", KITS)
def test_big_endian(name: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    complete(emulators.big_endian(written(name, tmp_path), tmp_path, require_tool), name)


@pytest.mark.slow
@pytest.mark.parametrize("name", KITS)
def test_cortex_m3_without_a_library(name: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    complete(emulators.cortex_m3(name, written(name, tmp_path), tmp_path, require_tool, "-Os"), name)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["crsf", "mavlink_1"])
def test_atmega328p(name: str, simulator: Path, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    complete(emulators.atmega328p(name, written(name, tmp_path), tmp_path, require_tool, simulator), name)
