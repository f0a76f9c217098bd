"""The slave of examples/firmware on each chip: size and stack depth."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from benchmarks.firmware_build import (
    AVR,
    CORTEX_M0,
    CORTEX_M3,
    EXAMPLES,
    Size,
    Workshop,
    clock,
    run,
    size_of,
    tool,
)
from benchmarks.firmware_stack import CallGraph

PORTS = {"microbit": CORTEX_M0, "lm3s6965evb": CORTEX_M3, "atmega328p": AVR}

# Bytes that the processor itself pushes at an interrupt.
_INTERRUPT = re.compile(r"_interrupt$|^__vector_\d+$")
_EXCEPTION_FRAME = {CORTEX_M0.name: 32 + 4, CORTEX_M3.name: 32 + 4, AVR.name: 0}  # and a word to align it
_ENTRIES = {"main", "reset", "fault"}


@dataclass(frozen=True)
class Slave:
    """A whole program, nothing subtracted. Stack in bytes: of main, and of the deepest interrupt on top."""

    size: Size
    main: int
    interrupt: int

    @property
    def ram(self) -> int:
        """All RAM in use, stack included."""
        return self.size.ram + self.main + self.interrupt


def program(shop: Workshop, port: str, options: str = "") -> Path:
    """Build the Q.link node for a port with the users' Makefile, with these options."""
    place = shop.folder / "slaves" / port
    place.mkdir(parents=True, exist_ok=True)
    PORTS[port].tool("gcc")
    words = [
        f"PORT={port}",
        "APP=qlink_node",
        f"BUILD={place}",
        f"HEADERS={shop.headers}",
        f"CPPFLAGS={options}",
        "CFLAGS=-Os -fstack-usage",
        f"F_CPU={clock()}UL",
    ]
    # Do not pass on the options of an outer make.
    clean = {
        name: value for name, value in os.environ.items() if not name.startswith("MAKE") and name != "MFLAGS"
    }
    run(tool("make", "make"), "-s", *words, folder=EXAMPLES, environment=clean)
    return place / f"{port}-qlink_node.elf"


def slave(shop: Workshop, port: str) -> Slave:
    """Size of the whole slave."""
    target, elf = PORTS[port], program(shop, port)
    graph = CallGraph(target, elf)
    callers = graph.callers()
    compiled = {name for name in graph.functions if name in graph.measured}
    interrupts = {name for name in compiled if _INTERRUPT.search(name)}
    # Compiled, kept by the linker, and without a direct call: reached through a pointer.
    graph.pointed_to = {name for name in compiled - interrupts - _ENTRIES if not callers[name]}
    deepest = max(graph.depth(name) for name in interrupts) + _EXCEPTION_FRAME[target.name]
    return Slave(size_of(target, elf), graph.depth("main"), deepest)
