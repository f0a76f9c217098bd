"""The ARM boards: possible baud rates, and instructions from the last byte of a request to the answer.

QEMU simulates neither baud rate nor processor cycles, so it cannot measure the time of an answer on a chip.
It traces every instruction and every access to the UART: the tests count instructions between two accesses.
"""

from __future__ import annotations

import contextlib
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.link import Timing
from qlinkgen.transport import open_pty
from tests.firmware.firmware import HANGS, SOURCES, TARGETS
from tests.firmware.fixtures import BuildFirmware
from tests.firmware.line import UP, FirmwareLine

HEADERS = SOURCES.parents[1] / "generated" / "c"
TIMING = Timing.of(qlink, host_slack=0.0)
BAUD = round(10 / TIMING.byte_time)


@dataclass(frozen=True)
class Board:
    """A chip, and the data to compute its time.

    Attributes:
        cpu: the compiler's name of it.
        clock: Hz.
        cycles: assumed average per instruction. The Cortex-M0 at 16 MHz needs no wait states; by the table of
            its technical reference manual it takes 1.7 for the code counted here. The Cortex-M3 takes fewer,
            but its flash has wait states at 50 MHz.
        read: QEMU's trace of a byte read from the UART.
        written: QEMU's trace of a byte written to the UART.
    """

    cpu: str
    clock: float
    cycles: float
    read: str
    written: str

    @property
    def traces(self) -> tuple[str, ...]:
        """QEMU's options for both traces."""
        return ("-trace", self.read.split()[0], "-trace", self.written.split()[0])


BOARDS = {
    "lm3s6965evb": Board("cortex-m3", 50e6, 3.0, "pl011_read addr 0x00000000", "pl011_write addr 0x00000000"),
    "microbit": Board("cortex-m0", 16e6, 1.8, "nrf51_uart_read addr 0x518", "nrf51_uart_write addr 0x51c"),
}
#: Instructions possible before that: a pass of the main loop interrupted by the byte, and a tick.
IN_FRONT = 250
#: The longest requests and answers, stuffed if possible.
REQUESTS: tuple[qlink.Message, ...] = (
    qlink.LoopBackRequest(node=1, data=b"\xa5" * 25),
    qlink.ReadRequest(node=1, size=25),
    qlink.WriteRequest(node=1, data=b"\xa5" * 25),
    qlink.MotionRequest(node=1, segments=[0xA5A5] * 12),
    qlink.NodeInfoRequest(node=1),
)
#: Functions: the one called by a byte, and the one in which the node sleeps.
HANDLER, ASLEEP = "uart0_interrupt", "board_wait"
#: Seconds before the last byte. The node has to be asleep by then, but is not always on a busy machine: such
#: an answer does not count, and the next pause is longer.
PAUSES = (0.01, 0.05, 0.2, 0.8, 3.0, 12.0)


def compiled(port: str, baud: int, require_tool: Callable[..., str]) -> subprocess.CompletedProcess[str]:
    """Compile the board's source for a baud rate."""
    gcc = require_tool("arm-none-eabi-gcc", package="gcc-arm-none-eabi")
    options = (
        "-std=c99",
        f"-mcpu={BOARDS[port].cpu}",
        "-mthumb",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-ffreestanding",
    )
    folders = (f"-I{SOURCES}", f"-I{SOURCES / 'qlink_node'}", f"-I{HEADERS}")
    source = SOURCES / port / "board.c"
    command = (gcc, *options, *folders, f"-DBOARD_BAUD={baud}ul", "-fsyntax-only", source)
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("baud", [9600, 19200, 38400, 115200])
@pytest.mark.parametrize("port", BOARDS)
def test_a_usual_baud_rate_compiles(port: str, baud: int, require_tool: Callable[..., str]) -> None:
    run = compiled(port, baud, require_tool)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize(
    ("port", "baud", "why"),
    [
        ("lm3s6965evb", 40, "does not fit the divider"),
        ("lm3s6965evb", 4_000_000, "does not fit the divider"),
        ("microbit", 300, "must be 1200 to 1000000"),
        ("microbit", 1_500_000, "must be 1200 to 1000000"),
    ],
)
def test_one_that_the_chip_cannot_make_does_not(
    port: str, baud: int, why: str, require_tool: Callable[..., str]
) -> None:
    run = compiled(port, baud, require_tool)
    assert run.returncode != 0
    assert f"BOARD_BAUD {why}" in run.stderr


@pytest.mark.parametrize("port", BOARDS)
def test_the_answer_begins_before_the_deadline(
    port: str, build_firmware: BuildFirmware, tmp_path: Path
) -> None:
    board, program = BOARDS[port], build_firmware(port, "qlink_node", "-DBOARD_TURNAROUND_US=0")
    turnaround = -(-1e6 // BAUD) / 1e6 + 1e-6  # one bit, and a step of the measuring clock
    for request in REQUESTS:
        count = counted(port, program, request, tmp_path / "executed")
        taken = (count + IN_FRONT) * board.cycles / board.clock + turnaround
        allowed = TIMING.allowance(qlink.COMMANDS[request.NAME.partition(".")[0]])
        print(f"{port}: {request.NAME}: {count} instructions, {taken * 1e6:.0f} of {allowed * 1e6:.0f} us")
        assert count > 200, "it cannot be done with so few: the log has been read wrongly"
        assert taken < allowed, f"{request!r}: {count} instructions"


def counted(port: str, program: Path, request: qlink.Message, log: Path) -> int:
    """Return the number of instructions until a node answers a request."""
    for pause in PAUSES:
        with traced(port, program, log) as line:
            line.write(request.to_frame()[:-1])
            time.sleep(pause)
            line.write(request.to_frame()[-1:])
            assert line.next_answer(HANGS) is not None
        with log.open(errors="replace") as lines:
            *_, count = instructions(lines, BOARDS[port])
        if count is not None:
            return count
    raise AssertionError(f"{port} was not asleep {pause} s after the last byte but one of {request!r}")


@contextlib.contextmanager
def traced(port: str, program: Path, log: Path) -> Iterator[FirmwareLine]:
    """Run a firmware with each instruction traced; yield its line when it answers."""
    with open_pty() as ours:
        command = [*TARGETS[port].command[:-1], str(program)]
        command[command.index("pty")] = ours.path
        # The clock of the board counts instructions: else it would tick while the trace is written.
        command += [*one_by_one(command[0]), "-icount", "shift=7", "-d", "exec,nochain", "-D", str(log)]
        process = subprocess.Popen([*command, *BOARDS[port].traces], stderr=subprocess.DEVNULL)
        try:
            line = FirmwareLine(ours)
            wait_until_up(line)
            yield line
        finally:
            process.terminate()
            process.wait(HANGS)


def one_by_one(qemu: str) -> tuple[str, ...]:
    """Return the option of this QEMU to trace each instruction instead of each block."""
    told = subprocess.run([qemu, "-help"], capture_output=True, text=True, check=True).stdout
    return ("-singlestep",) if "-singlestep" in told else ("-accel", "tcg,one-insn-per-tb=on")


def wait_until_up(line: FirmwareLine) -> None:
    """Send requests until the latest is answered: the earlier ones were answered as well, or lost."""
    for number in range(round(HANGS / UP)):
        asked = number.to_bytes(2, "big")
        line.write(qlink.LoopBackRequest(node=1, data=asked).to_frame())
        while (answer := line.next_answer(UP)) is not None:
            if qlink.decode_response(answer) == qlink.LoopBackResponse(node=1, data=asked):
                return
    raise AssertionError(f"no answer in {HANGS:.0f} s")


def instructions(log: Iterable[str], board: Board) -> Iterator[int | None]:
    """Yield for each answer the instructions from the interrupt of the last byte to its first byte.

    None if it does not count: several bytes were waiting, or the node was not asleep.
    """
    executed = begun = bytes_read = 0
    handler, function, asleep, asked = "", "", False, False
    for line in log:
        if line.startswith("Trace"):
            # Trace 0: address here [segment/address there/flags/flags] function
            address, last, function = line.split("/")[1], function, line.rsplit(None, 1)[-1]
            if not handler and function == HANDLER:
                handler = address
            if address == handler:
                begun, bytes_read, asleep = executed, 0, last == ASLEEP
            executed += 1
        elif line.startswith(board.read):
            bytes_read += 1
            asked = True
        elif line.startswith(board.written) and asked:
            # An interrupt may find no byte, since the previous one has read it too.
            yield executed - begun if asleep and bytes_read == 1 else None
            asked = False
