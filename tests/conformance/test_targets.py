"""The kit on other processors, emulated: big-endian, 32 bits without a library, 8 bits with 2 KiB of RAM."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conformance import kits
from tests.conformance.conftest import Write
from tests.conformance.test_host import vectors_of
from tests.proof import cases

SMALL = ("-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections")


@pytest.mark.parametrize("name", cases.SHIPPED)
def test_big_endian(name: str, kit: Write, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    compiler = require_tool("s390x-linux-gnu-gcc", package="gcc-s390x-linux-gnu")
    emulator = require_tool("qemu-s390x", package="qemu-user")
    program = kits.compiled(tmp_path / "kit", compiler, "-std=c99", "-O0", "-static", kits.STDIO, kit(name))
    report = kits.ran(emulator, program)
    report.check()
    assert not vectors_of(name) - report.by_verb


@pytest.mark.parametrize("name", cases.SHIPPED)
def test_cortex_m3_without_a_library(
    name: str, kit: Write, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    compiler = require_tool("arm-none-eabi-gcc", package="gcc-arm-none-eabi")
    emulator = require_tool("qemu-system-arm", package="qemu-system-arm")
    script = kits.TARGETS_DIR / "arm_link.ld"
    program = kits.compiled(
        tmp_path / "kit.elf",
        compiler,
        *("-mcpu=cortex-m3", "-mthumb", "-std=gnu99", "-Os" if name == "trio" else "-O0", *SMALL),
        *("-nostdlib", "-T", script, "-DCONFORMANCE_MAIN=0", f"-DKIT={name}_conformance"),
        *(kits.TARGETS_DIR / "arm_start.c", kit(name), "-lgcc"),
    )
    machine = (
        "-M",
        "lm3s6965evb",
        "-display",
        "none",
        "-monitor",
        "none",
        "-serial",
        "stdio",
        "-semihosting",
    )
    report = kits.ran(emulator, *machine, "-kernel", program)
    report.check()
    assert not vectors_of(name) - report.by_verb


@pytest.fixture(scope="session")
def simulator(tmp_path_factory: pytest.TempPathFactory, require_tool: Callable[..., str]) -> Path:
    """Give the program that runs a firmware of an ATmega328P to its end."""
    require_tool("simavr", package="simavr")
    program = tmp_path_factory.mktemp("simavr") / "avr_run"
    headers = ("-I", "/usr/include/simavr", "-I", "/usr/include/simavr/parts")
    compiler = require_tool("gcc", package="gcc")
    source = kits.TARGETS_DIR / "avr_run.c"
    kits.output(compiler, "-O1", *headers, source, "-o", program, "-lsimavrparts", "-lsimavr")
    return program


#: First and last message of each part. 32 KiB of flash hold two whole protocols, and half of the third
#: without dispatching, which needs the code of all commands in every part.
HALVES = ((0, 101), (102, 201))
RUNS: list[tuple[str, tuple[int, ...]]] = [
    ("qlink", ()),
    ("trio", ()),
    *(("mc1231a", half) for half in HALVES),
]


@pytest.mark.parametrize(("name", "part"), RUNS)
def test_atmega328p(
    name: str,
    part: tuple[int, ...],
    *,
    kit: Write,
    simulator: Path,
    tmp_path: Path,
    require_tool: Callable[..., str],
) -> None:
    compiler = require_tool("avr-gcc", package="gcc-avr")
    limits = zip(("FIRST", "LAST", "DISPATCH"), (*part, 0) if part else (), strict=False)
    program = kits.compiled(
        tmp_path / "kit.elf",
        compiler,
        *("-mmcu=atmega328p", "-std=gnu99", "-Os", *SMALL),
        *("-DCONFORMANCE_MAIN=0", f"-DKIT={name}_conformance"),
        *(f"-DCONFORMANCE_{which}={number}" for which, number in limits),
        *(kits.TARGETS_DIR / "avr_main.c", kit(name)),
    )
    report = kits.ran(simulator, program)
    report.check()
    messages = [message.name for message in cases.protocol(name).messages]
    kept = set(messages[part[0] : part[1] + 1] if part else messages)
    assert {each.split(" ")[0] for each in report.names} - {"check"} == kept
    if not part:
        assert not vectors_of(name) - report.by_verb


def test_the_halves_are_all() -> None:
    (first, middle), (next_one, last) = HALVES
    assert first == 0
    assert middle + 1 == next_one
    assert last == len(cases.protocol("mc1231a").messages) - 1
