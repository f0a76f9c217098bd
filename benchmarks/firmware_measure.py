"""All measurements of size, stack and time in docs/firmware.md; the tests use them too."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from benchmarks.firmware_answers import Run, replies
from benchmarks.firmware_build import HEADERS, TARGETS, Workshop, temporary
from benchmarks.firmware_cycles import Cycles, all_forms
from benchmarks.firmware_floor import SIDES, Work, work
from benchmarks.firmware_size import PROTOCOLS, Core, Costs, Dispatch, buffers, cores, costs, dispatch
from benchmarks.firmware_slave import PORTS, Slave, slave


@dataclass(frozen=True)
class Measured:
    """By target: core, messages and buffers of each protocol; the AVR's cycles; the slave of each port."""

    tools: str
    core: dict[str, dict[str, Core]]
    messages: dict[str, dict[str, Costs]]
    buffers: dict[str, dict[str, dict[str, int]]]
    dispatch: dict[str, dict[str, Dispatch]]
    cycles: dict[str, Cycles]
    floor: dict[str, dict[str, Work]]
    slaves: dict[str, Slave]
    run: Run


def tools() -> str:
    """The compilers; figures of different ones cannot be compared."""
    return ", ".join(target.version() for target in TARGETS)


def measure(headers: Path = HEADERS) -> Measured:
    """Build and run all of this project's own programs; ToolMissing says what to install."""
    with temporary() as folder:
        shop = Workshop(Path(folder), headers)
        return Measured(
            tools=tools(),
            core={target.name: cores(shop, target) for target in TARGETS},
            messages={
                target.name: {name: costs(shop, target, name) for name in PROTOCOLS} for target in TARGETS
            },
            buffers={
                target.name: {name: buffers(shop, target, name) for name in PROTOCOLS} for target in TARGETS
            },
            dispatch={target.name: dispatch(shop, target) for target in TARGETS},
            cycles=all_forms(shop),
            floor={target.name: {side: work(shop, target, side) for side in SIDES} for target in TARGETS},
            slaves={port: slave(shop, port) for port in PORTS},
            run=replies(shop),
        )
