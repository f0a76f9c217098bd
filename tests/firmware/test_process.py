"""The ports that are a process on a pty: masters come and go, nothing is busy, and a signal is the end."""

from __future__ import annotations

import contextlib
import itertools
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NoReturn

import pytest

from qlinkgen.protocols.qlink import Bus
from qlinkgen.transport import open_port
from qlinkgen_codecs import qlink
from tests.firmware.firmware import HANGS
from tests.firmware.test_build import PORTS, copied, run, sure

__all__ = ["copied"]  # a fixture

Tool = Callable[..., str]
Missing = Callable[..., NoReturn]
SIMAVR = Path("/usr/include/simavr/sim_avr.h")


@contextlib.contextmanager
def running(*command: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The process, and the path that it printed."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert process.stdout is not None
        yield process, process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate()


def processor_seconds(process: subprocess.Popen[str]) -> float:
    """Processor time that a process has used."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100


def simulator(folder: Path, require_tool: Tool, missing_tool: Missing) -> Path:
    """Build what runs an AVR."""
    require_tool("cc", package="gcc")
    if not SIMAVR.exists():
        missing_tool("simavr's library", package="libsimavr-dev")
    sure("make", "-C", folder, "simulator")
    return folder / "build" / "run_simavr"


@pytest.mark.parametrize("port", ["posix", "atmega328p"])
def test_lives_until_a_signal(port: str, copied: Path, require_tool: Tool, missing_tool: Missing) -> None:
    compiler, package, _ = PORTS[port]
    require_tool(compiler, package=package)
    command = [copied / "build" / "posix-qlink_node"]
    sure("make", "-C", copied, f"PORT={port}")
    if port == "atmega328p":
        command = [
            simulator(copied, require_tool, missing_tool),
            copied / "build" / "atmega328p-qlink_node.elf",
        ]
    with running(*command) as (process, path):
        for _ in range(3):  # meanwhile nobody holds the line
            with Bus.open(path, slack=HANGS, echo="none") as bus:
                assert bus.node(1).loop_back(data=b"\x00\xa5\x00").data == b"\x00\xa5\x00"
        if Path("/proc/self/stat").exists():
            used = processor_seconds(process)
            time.sleep(1.0)
            assert processor_seconds(process) - used < 0.2  # it sleeps
        process.terminate()
        rest, _ = process.communicate(timeout=HANGS)
    assert (rest, process.returncode) == ("", 0)


def test_an_answer_waits_for_the_inserted_byte(copied: Path, require_tool: Tool) -> None:
    # At one bit a second a byte lasts for ten: so long the node waits for what the master still has to send.
    require_tool("cc", package="gcc")
    sure("make", "-C", copied, "CPPFLAGS=-DBOARD_BAUD=1")
    requests = (
        qlink.LoopBackRequest(node=1, offset=0, data=value.to_bytes(2)) for value in itertools.count()
    )
    wire = next(
        frame for frame in (request.to_frame() for request in requests) if frame.endswith(b"\xa5\x00")
    )
    with running(copied / "build" / "posix-qlink_node") as (_, path), open_port(path) as port:
        port.write(wire[:-1])
        assert port.read(0.3) == b""
        port.write(wire[-1:])
        answer = b""
        while len(answer) < len(wire):
            more = port.read(HANGS)
            assert more
            answer += more
    assert answer == wire  # of a loop_back it is the request


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ((), "usage: run_simavr [--hertz 14745600] firmware.elf"),
        (("--hertz", "0", "x.elf"), "usage: "),
        (("--speed", "1", "x.elf"), "usage: "),
        (("/nowhere/x.elf",), "/nowhere/x.elf is no firmware in ELF"),
    ],
)
def test_the_simulator_says_what_is_wrong(
    arguments: tuple[str, ...], expected: str, copied: Path, require_tool: Tool, missing_tool: Missing
) -> None:
    done = run(simulator(copied, require_tool, missing_tool), *arguments)
    assert done.returncode != 0
    assert expected in done.stdout
