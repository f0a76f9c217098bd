"""Kits on other processors, emulated: big-endian, 32 bits without a library, 8 bits with 2 KiB of RAM."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tests.conformance import kits

Require = Callable[..., str]

_SMALL = ("-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections")
_MACHINE = (
    "-M", "lm3s6965evb", "-display", "none", "-monitor", "none", "-serial", "stdio", "-semihosting",
)  # fmt: skip


def big_endian(kit: Path, folder: Path, require: Require) -> kits.Report:
    """A kit on s390x."""
    compiler = require("s390x-linux-gnu-gcc", package="gcc-s390x-linux-gnu")
    emulator = require("qemu-s390x", package="qemu-user")
    program = kits.compiled(folder / "kit", compiler, "-std=c99", "-O0", "-static", kits.STDIO, kit)
    return kits.ran(emulator, program)


def cortex_m3(
    name: str, kit: Path, folder: Path, require: Require, optimisation: str = "-O0", *flags: str
) -> kits.Report:
    """A kit on a Cortex-M3 without a library; `flags` for the compiler."""
    compiler = require("arm-none-eabi-gcc", package="gcc-arm-none-eabi")
    emulator = require("qemu-system-arm", package="qemu-system-arm")
    script = kits.TARGETS_DIR / "arm_link.ld"
    program = kits.compiled(
        folder / "kit.elf",
        compiler,
        *("-mcpu=cortex-m3", "-mthumb", "-std=gnu99", optimisation, *_SMALL),
        *("-nostdlib", "-T", script, "-DCONFORMANCE_MAIN=0", f"-DKIT={name}_conformance"),
        *flags,
        *(kits.TARGETS_DIR / "arm_start.c", kit, "-lgcc"),
    )
    return kits.ran(emulator, *_MACHINE, "-kernel", program)


def atmega328p(
    name: str, kit: Path, folder: Path, require: Require, simulator: Path, *limits: str
) -> kits.Report:
    """A kit on an ATmega328P; `limits` choose a part of it."""
    compiler = require("avr-gcc", package="gcc-avr")
    program = kits.compiled(
        folder / "kit.elf",
        compiler,
        *("-mmcu=atmega328p", "-std=gnu99", "-Os", *_SMALL),
        *("-DCONFORMANCE_MAIN=0", f"-DKIT={name}_conformance", *limits),
        *(kits.TARGETS_DIR / "avr_main.c", kit),
    )
    return kits.ran(simulator, program)


def avr_simulator(folder: Path, require: Require) -> Path:
    """The program that runs a firmware of an ATmega328P to its end."""
    require("simavr", package="simavr")
    program = folder / "avr_run"
    headers = ("-I", "/usr/include/simavr", "-I", "/usr/include/simavr/parts")
    source = kits.TARGETS_DIR / "avr_run.c"
    compiler = require("gcc", package="gcc")
    kits.output(compiler, "-O1", *headers, source, "-o", program, "-lsimavrparts", "-lsimavr")
    return program
