"""The whole slave of examples/firmware on each chip: size, depth of its stack, time to answer."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from benchmarks.firmware_build import (
    AVR,
    CORTEX_M0,
    CORTEX_M3,
    ROOT,
    Size,
    Workshop,
    run,
    size_of,
    tool,
)
from benchmarks.firmware_cycles import build_simulator
from benchmarks.firmware_stack import CallGraph
from qlinkgen_codecs import qlink

EXAMPLES = ROOT / "examples" / "firmware"
PORTS = {"microbit": CORTEX_M0, "lm3s6965evb": CORTEX_M3, "atmega328p": AVR}
CLOCK = 14_745_600  # of the AVR: 115200 baud can be made from it exactly
BAUD = cast(int, qlink.BUS.baud)  # the schema has one

# An interrupt finds on the stack what the processor itself has put there.
_INTERRUPT = re.compile(r"_interrupt$|^__vector_\d+$")
_EXCEPTION_FRAME = {CORTEX_M0.name: 32 + 4, CORTEX_M3.name: 32 + 4, AVR.name: 0}  # and a word to align it
_ENTRIES = {"main", "reset", "fault"}

_A5 = 0xA5
ROUNDS = 8  # so that interrupts of the clock come at many places


def requests(number: int) -> dict[str, qlink.Message]:
    """The longest request of each answered command, with bytes to be stuffed where that costs something."""
    return {
        "node_info": qlink.NodeInfoRequest(node=1),
        "node_setup": qlink.NodeSetupRequest(node=1, node_number=1),
        "motor_position": qlink.MotorPositionRequest(node=1),
        "motor_request": qlink.MotorRequestRequest(node=1, motor_data=bytes([_A5] * 26)),
        "motor_response_poll": qlink.MotorResponsePollRequest(node=1),
        "motion": qlink.MotionRequest(node=1, counter=number, outputs=_A5, segments=[_A5 << 8 | _A5] * 12),
        "clear_fifo": qlink.ClearFifoRequest(node=1),
        "preset_motor_position": qlink.PresetMotorPositionRequest(node=1),
        "read": qlink.ReadRequest(node=1, size=25),
        "write": qlink.WriteRequest(node=1, data=bytes([_A5] * 25)),
        "write_read": qlink.WriteReadRequest(node=1, outputs=0xA5A5A5),
        "set_outputs": qlink.SetOutputsRequest(node=1, mask=0xA5A5A5),
        "clear_outputs": qlink.ClearOutputsRequest(node=1, mask=0xA5A5A5),
        "loop_back": qlink.LoopBackRequest(node=1, data=bytes([_A5] * 25)),
        "node_program_load": qlink.NodeProgramLoadRequest(node=1),
        "node_reset": qlink.NodeResetRequest(node=1),
    }


@dataclass(frozen=True)
class Slave:
    """A whole program, nothing taken off. Stack in bytes: of main, and of the deepest interrupt on top."""

    size: Size
    main: int
    interrupt: int

    @property
    def ram(self) -> int:
        """All of the RAM that it ever uses."""
        return self.size.ram + self.main + self.interrupt


@dataclass(frozen=True)
class Reply:
    """Time from a request's last byte to the first byte of the answer, and how long it may be."""

    cycles: int
    allowed_us: int

    @property
    def us(self) -> float:
        """The same in microseconds."""
        return 1e6 * self.cycles / CLOCK


def program(shop: Workshop, port: str) -> Path:
    """Build the Q.link node for a port, without its diagnostics, by the Makefile that users have."""
    place = shop.folder / "slaves" / port
    place.mkdir(parents=True, exist_ok=True)
    PORTS[port].tool("gcc")
    words = [
        f"PORT={port}",
        "APP=qlink_node",
        f"BUILD={place}",
        f"HEADERS={shop.headers}",
        "CPPFLAGS=-DNODE_DIAGNOSTICS=0",
        "CFLAGS=-Os -fstack-usage",
        f"F_CPU={CLOCK}UL",
    ]
    # What the make that runs this was told is not for this one.
    clean = {
        name: value for name, value in os.environ.items() if not name.startswith("MAKE") and name != "MFLAGS"
    }
    run(tool("make", "make"), "-s", *words, folder=EXAMPLES, environment=clean)
    return place / f"{port}-qlink_node.elf"


def slave(shop: Workshop, port: str) -> Slave:
    """What the whole slave takes of a chip."""
    target, elf = PORTS[port], program(shop, port)
    graph = CallGraph(target, elf)
    callers = graph.callers()
    compiled = {name for name in graph.functions if name in graph.measured}
    interrupts = {name for name in compiled if _INTERRUPT.search(name)}
    # Compiled, kept by the linker, and called by nobody: so a pointer leads there.
    graph.pointed_to = {name for name in compiled - interrupts - _ENTRIES if not callers[name]}
    deepest = max(graph.depth(name) for name in interrupts) + _EXCEPTION_FRAME[target.name]
    return Slave(size_of(target, elf), graph.depth("main"), deepest)


@dataclass(frozen=True)
class Run:
    """What simavr has seen of the AVR slave: its slowest replies, and the bytes of stack that were in use."""

    replies: dict[str, Reply]
    stack: int


def replies(shop: Workshop) -> Run:
    """How fast the AVR slave answers each command at its slowest, interrupts and main loop included."""
    simulate = build_simulator(shop, "run_answer")
    asked = [item for number in range(ROUNDS) for item in requests(number).items()]
    frames = [request.to_frame().hex() for _, request in asked]
    lines = run(simulate, program(shop, "atmega328p"), CLOCK, *frames).splitlines()
    answers = [line.split() for line in lines if re.fullmatch(r"\d+ [0-9a-f]+", line)]
    slowest: dict[str, int] = {}
    for (name, _), (cycles, answer) in zip(asked, answers, strict=True):
        message = qlink.decode_response(bytes.fromhex(answer))
        if type(message) is not qlink.COMMANDS[name].response:
            raise RuntimeError(f"{name} was answered by {message}")
        slowest[name] = max(int(cycles), slowest.get(name, 0))
    limits = {name: f"QLINK_RESPONSE_US({name.upper()}, {BAUD}ul)" for name in slowest}
    allowed = shop.values(AVR, "qlink.h", limits)
    stack = int(lines[-1].removeprefix("stack "))
    return Run({name: Reply(cycles, allowed[name]) for name, cycles in slowest.items()}, stack)
