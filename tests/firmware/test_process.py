"""The ports that run as a process on a pty: several masters in turn, no busy waiting, end by a signal."""

from __future__ import annotations

import contextlib
import itertools
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NoReturn

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.protocols.qlink import Bus
from qlinkgen.transport import Port, open_port
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
    """Build the simulator of the AVR."""
    require_tool("cc", package="gcc")
    if not SIMAVR.exists():
        missing_tool("simavr's library", package="libsimavr-dev")
    sure("make", "-C", folder, "simulator")
    return folder / "build" / "run_simavr"


def answer_of(port: Port, expected: bytes, seconds: float = HANGS) -> bytes:
    """Read as many bytes as expected, or fewer after a timeout."""
    answer = b""
    while len(answer) < len(expected) and (more := port.read(seconds)):
        answer += more
    return answer


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
        for _ in range(3):  # the line is closed meanwhile
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
    # At one bit a second a byte takes ten seconds: the node waits so long for the master's inserted byte.
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
        assert answer_of(port, wire) == wire  # of a loop_back it is the request


#: Requests whose answers are the same bytes.
FIRST, SECOND = (
    qlink.LoopBackRequest(node=1, offset=0, data=data).to_frame() for data in (b"1st", b"second")
)


def test_a_node_that_hears_itself_drops_its_answers(copied: Path, require_tool: Tool) -> None:
    # At one bit a second it waits for its echo longer than a busy machine delays the test.
    require_tool("cc", package="gcc")
    sure("make", "-C", copied, "CPPFLAGS=-DBOARD_HEARS_ITSELF=1 -DBOARD_BAUD=1")
    with running(copied / "build" / "posix-qlink_node") as (_, path), open_port(path) as port:
        for wire in (FIRST, SECOND, FIRST, FIRST):
            port.write(wire)
            assert answer_of(port, wire) == wire
            port.write(wire)  # /RE is tied low
        port.write(SECOND)
        assert answer_of(port, SECOND) == SECOND
        # A different byte ends the echo: the bytes after it are a request.
        port.write(b"\0" + FIRST)
        assert answer_of(port, FIRST) == FIRST
        port.write(FIRST)
        assert port.read(0.3) == b""


def test_a_node_that_does_not_hear_itself_after_all_gives_up_waiting(
    copied: Path, require_tool: Tool
) -> None:
    require_tool("cc", package="gcc")
    sure("make", "-C", copied, "CPPFLAGS=-DBOARD_HEARS_ITSELF=1 -DBOARD_BAUD=1000")
    with running(copied / "build" / "posix-qlink_node") as (_, path), open_port(path) as port:
        for _ in range(20):  # on a busy machine a pause may be too short for the node, but not each time
            port.write(FIRST)
            answer_of(port, FIRST, 1.0)
            time.sleep(0.1)
            port.write(SECOND)
            if answer_of(port, SECOND, 1.0) == SECOND:
                return
    raise AssertionError("it takes requests for its echo")


#: Settings that outlive the process.
KEPT = """
#include <stdio.h>
void settings_load(node_settings_t *settings)
{
    FILE *const file = fopen("@", "rb");
    of_the_build(settings);
    if (file != NULL) {
        (void)fread(settings, sizeof *settings, 1u, file);
        (void)fclose(file);
    }
}
void settings_store(const node_settings_t *settings)
{
    FILE *const file = fopen("@", "wb");
    if (file != NULL) {
        (void)fwrite(settings, sizeof *settings, 1u, file);
        (void)fclose(file);
    }
}
"""


def test_settings_may_outlive_the_power(copied: Path, require_tool: Tool) -> None:
    require_tool("cc", package="gcc")
    source, kept = copied / "qlink_node" / "settings.c", copied / "kept"
    of_the_build = source.read_text().partition("void settings_store")[0]
    of_the_build = of_the_build.replace("void settings_load", "static void of_the_build")
    source.write_text(of_the_build + KEPT.replace("@", str(kept)))
    sure("make", "-C", copied)
    program = copied / "build" / "posix-qlink_node"
    with running(program) as (_, path), Bus.open(path, slack=HANGS, echo="none") as bus:
        assert bus.node(1).node_info().t1_delay == 1.0
        assert not kept.exists()
        bus.node(1).node_setup(node_number=5, t1_delay=0.3, t2_delay=2.5, position_type=1)
        assert bus.node(5).node_info().t1_delay == 0.3
        before = kept.stat().st_mtime_ns
        bus.node(5).set_outputs(mask=1)
        bus.node(5).loop_back(data=b"stored once")
        assert kept.stat().st_mtime_ns == before
    with running(program) as (_, path), Bus.open(path, slack=HANGS, echo="none") as bus:
        told = bus.node(5).node_info()
        assert (told.t1_delay, told.t2_delay, told.position_type) == (0.3, 2.5, 1)


#: Sends no bytes, and then the registers of its pins.
PINS = """
#include "board.h"
#ifdef __AVR__
#include <avr/io.h>
#else
#define PORTD 0x01u
#define DDRD 0x04u
#endif
int main(void)
{
    uint8_t pins[2];
    uint8_t byte;
    board_start();
    pins[0] = PORTD;
    pins[1] = DDRD;
    for (;;) {
        if (board_receive(&byte)) {
            board_send(pins, 0u);
            board_send(pins, sizeof pins);
        }
        board_wait();
    }
}
"""


@pytest.mark.parametrize("port", ["posix", "atmega328p"])
def test_sending_nothing_does_not_hang(
    port: str, copied: Path, require_tool: Tool, missing_tool: Missing
) -> None:
    compiler, package, _ = PORTS[port]
    require_tool(compiler, package=package)
    (copied / "pins").mkdir()
    (copied / "pins" / "main.c").write_text(PINS)
    (copied / "pins" / "line.h").write_text((copied / "qlink_node" / "line.h").read_text())
    sure("make", "-C", copied, f"PORT={port}", "APP=pins", "APPS=pins", "HEADER_pins=qlink.h")
    command = [copied / "build" / "posix-pins"]
    if port == "atmega328p":
        command = [
            simulator(copied, require_tool, missing_tool),
            copied / "build" / "atmega328p-pins.elf",
        ]
    with running(*command) as (_, path), open_port(path) as line:
        expected = b"\x01\x04"  # RXD has its pull-up; the direction is an output, and low
        answers: list[bytes] = []
        while not answers or (not answers[-1] and len(answers) < HANGS):
            line.write(b"?")  # lost if the chip has not started
            answers.append(answer_of(line, expected, 1.0))
        assert answers[-1] == expected


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ((), "usage: run_simavr [--hertz 18432000] firmware.elf"),
        (("--hertz", "0", "x.elf"), "usage: "),
        (("--speed", "1", "x.elf"), "usage: "),
        (("/nowhere/x.elf",), "/nowhere/x.elf is not an ELF firmware"),
    ],
)
def test_the_simulator_says_what_is_wrong(
    arguments: tuple[str, ...], expected: str, copied: Path, require_tool: Tool, missing_tool: Missing
) -> None:
    done = run(simulator(copied, require_tool, missing_tool), *arguments)
    assert done.returncode != 0
    assert expected in done.stdout
