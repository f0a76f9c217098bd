"""The generated header against the floor, code written by hand for motion.response alone.

Instructions of a Cortex-M0 are counted by QEMU, which knows no cycles; cycles of an AVR by simavr.
Both are the same in every run.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.firmware_build import AVR, CORTEX_M0, PROGRAMS, Size, Target, Workshop, run, size_of, tool
from benchmarks.firmware_cycles import build_simulator
from benchmarks.firmware_stack import CallGraph

HAND = PROGRAMS.parent / "c"
#: Options of the programs that are compared.
SIDES = {"floor": ("-DFLOOR",), "generated": ()}
#: How many times as much as the floor the generated header takes at most: flash, encode, receive.
RATIOS = {CORTEX_M0.name: (1.26, 1.15, 1.15), AVR.name: (1.22, 0.89, 0.87)}
_BARE = ("-nostartfiles", "-nostdlib", "-Wl,--section-start=.vectors=0,-Ttext=0x100,-Tbss=0x20000000")
_ENTRY = ("-Wl,-e,reset,-u,vectors", "-lgcc")
_STEP = re.compile(r"^Trace \d+: \S+ \[[^/]+/([0-9a-f]+)/")


@dataclass(frozen=True)
class Work:
    """One side on one chip: bytes, and instructions or cycles to encode and to receive a frame of 16 bytes.

    Attributes:
        longest: of the calls that receive a byte.
    """

    size: Size
    stack: int
    encode: int
    receive: int
    longest: int


def work(shop: Workshop, target: Target, side: str) -> Work:
    """Build and run one of SIDES."""
    options = (f"-I{HAND}", *SIDES[side])
    source, name = PROGRAMS / "compared.c", f"compared-{side}"
    sized = shop.link(target, f"{name}-size", source, ("-DSIZE", *options))
    empty = shop.size(target, f"{name}-empty", source, ("-DSIZE", "-DEMPTY", *options))
    encode, *received = (
        instructions(shop, name, options) if target is CORTEX_M0 else cycles(shop, name, options)
    )
    stack = CallGraph(target, sized).depth("main")
    return Work(size_of(target, sized) - empty, stack, encode, sum(received), max(received))


def ratios(floor: Work, generated: Work) -> tuple[float, float, float]:
    """Flash, and the time to encode and to receive, of the header over the floor."""
    return (
        generated.size.flash / floor.size.flash,
        generated.encode / floor.encode,
        generated.receive / floor.receive,
    )


def instructions(shop: Workshop, name: str, options: Iterable[str]) -> list[int]:
    """Instructions of each call of `encode` and `receive` on a Cortex-M0, calls and returns included."""
    program = shop.link(CORTEX_M0, name, PROGRAMS / "compared.c", (*_BARE, *options, *_ENTRY))
    log = program.with_suffix(".log")
    qemu = tool("qemu-system-arm", "qemu-system-arm")
    steps = ("-singlestep",) if "-singlestep" in run(qemu, "-help") else ("-accel", "tcg,one-insn-per-tb=on")
    quiet = ("-display", "none", "-monitor", "none", "-serial", "none", "-semihosting")
    run(qemu, "-M", "lm3s6965evb", *quiet, *steps, "-d", "exec,nochain", "-D", log, "-kernel", program)
    lines = log.read_text().splitlines()
    steps_taken = [int(match[1], 16) for match in map(_STEP.match, lines) if match]
    return list(_calls(steps_taken, places(CORTEX_M0, program), call=4))


def cycles(shop: Workshop, name: str, options: Iterable[str]) -> list[int]:
    """Cycles of each call of `encode` and `receive` on an ATmega328P, calls and returns included."""
    program = shop.link(AVR, name, PROGRAMS / "compared.c", tuple(options))
    found = places(AVR, program)
    marked = run(build_simulator(shop, "run_calls"), program, found["encode"], found["receive"])
    return [int(line) for line in marked.splitlines() if line.isdigit()]


def places(target: Target, program: Path) -> dict[str, int]:
    """Addresses of the functions that are counted."""
    symbols = re.findall(r"^([0-9a-f]+) \w (encode|receive)$", run(target.tool("nm"), program), re.MULTILINE)
    return {name: int(address, 16) for address, name in symbols}


def _calls(steps: list[int], functions: dict[str, int], *, call: int) -> Iterator[int]:
    """Instructions from each first one of a function to its return; ``call`` bytes has a call."""
    begun, back = 0, -1
    for at, address in enumerate(steps):
        if address in functions.values():
            begun, back = at, steps[at - 1] + call
        elif address == back:
            yield at - begun
            back = -1
