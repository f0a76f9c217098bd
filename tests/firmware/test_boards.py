"""The ARM boards: baud rates that they can make, instructions from the last byte of a request to the answer.

QEMU has no baud rate and no cycles of a processor, so it cannot tell how long an answer takes on a chip. It
can tell every instruction executed, and every access to the UART. The first are counted between two of these.
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
    """A chip, and what its time is reckoned from.

    Attributes:
        cpu: as the compiler calls it.
        clock: Hz.
        cycles: of an instruction in the mean, assumed. The Cortex-M0 at 16 MHz needs no wait states; by the
            table of its technical reference manual it takes 1.7 for what is counted here. The Cortex-M3 takes
            fewer, but its flash waits at 50 MHz.
        read: how QEMU tells that a byte has been taken out of the UART.
        written: the same of one that is to be sent.
    """

    cpu: str
    clock: float
    cycles: float
    read: str
    written: str

    @property
    def traces(self) -> tuple[str, ...]:
        """What makes QEMU tell both."""
        return ("-trace", self.read.split()[0], "-trace", self.written.split()[0])


BOARDS = {
    "lm3s6965evb": Board("cortex-m3", 50e6, 3.0, "pl011_read addr 0x00000000", "pl011_write addr 0x00000000"),
    "microbit": Board("cortex-m0", 16e6, 1.8, "nrf51_uart_read addr 0x518", "nrf51_uart_write addr 0x51c"),
}
#: Instructions that can come in front: a pass of the main loop that the byte interrupts, and a tick.
IN_FRONT = 250
#: Those with the longest requests and answers, stuffed where they can be.
REQUESTS: tuple[qlink.Message, ...] = (
    qlink.LoopBackRequest(node=1, data=b"\xa5" * 25),
    qlink.ReadRequest(node=1, size=25),
    qlink.WriteRequest(node=1, data=b"\xa5" * 25),
    qlink.MotionRequest(node=1, segments=[0xA5A5] * 12),
    qlink.NodeInfoRequest(node=1),
)
#: Functions: what a byte calls, and where the node sleeps.
HANDLER, ASLEEP = "uart0_interrupt", "board_wait"
#: Seconds between the last byte but one and the last. The node has to be asleep by then, and is not always
#: where this machine is busy: such an answer does not count, and the next time there is more.
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
    turnaround = -(-1e6 // BAUD) / 1e6 + 1e-6  # one bit, and a step of the clock that tells it
    for request in REQUESTS:
        count = counted(port, program, request, tmp_path / "executed")
        taken = (count + IN_FRONT) * board.cycles / board.clock + turnaround
        allowed = TIMING.allowance(qlink.COMMANDS[request.NAME.partition(".")[0]])
        print(f"{port}: {request.NAME}: {count} instructions, {taken * 1e6:.0f} of {allowed * 1e6:.0f} us")
        assert count > 200, "it cannot be done with so few: the log has been read wrongly"
        assert taken < allowed, f"{request!r}: {count} instructions"


def counted(port: str, program: Path, request: qlink.Message, log: Path) -> int:
    """Return how many instructions a node takes until it answers a request."""
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
    """Run a firmware that tells each of its instructions; give its line when it answers."""
    with open_pty() as ours:
        command = [*TARGETS[port].command[:-1], str(program)]
        command[command.index("pty")] = ours.path
        # The clock of the board goes with its instructions: else it would tick while they are written down.
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
    """Return how this QEMU is told to tell each instruction, and not only where a jump leads."""
    told = subprocess.run([qemu, "-help"], capture_output=True, text=True, check=True).stdout
    return ("-singlestep",) if "-singlestep" in told else ("-accel", "tcg,one-insn-per-tb=on")


def wait_until_up(line: FirmwareLine) -> None:
    """Ask until the latest question is answered: those before were as well, or were lost."""
    for number in range(round(HANGS / UP)):
        asked = number.to_bytes(2, "big")
        line.write(qlink.LoopBackRequest(node=1, data=asked).to_frame())
        while (answer := line.next_answer(UP)) is not None:
            if qlink.decode_response(answer) == qlink.LoopBackResponse(node=1, data=asked):
                return
    raise AssertionError(f"no answer in {HANGS:.0f} s")


def instructions(log: Iterable[str], board: Board) -> Iterator[int | None]:
    """Yield for each answer the instructions from the interrupt of the last byte to its first byte.

    None where it does not count: more bytes were waiting than the last one, or the node was not asleep.
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
            # An interrupt may find nothing, since the one before it has taken its byte as well.
            yield executed - begun if asleep and bytes_read == 1 else None
            asked = False
