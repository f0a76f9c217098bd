"""Transactions over a pty: the public API, raw system calls, pyserial, and two Modbus libraries."""

from __future__ import annotations

import contextlib
import itertools
import os
import subprocess
import sys
import time
import tty
from collections.abc import Callable, Iterator
from statistics import median

from benchmarks import ROOT, measure
from benchmarks.peer import PeerMissing, load
from benchmarks.report import Goal, Section, number
from benchmarks.wire_responder import MODBUS_REQUEST, NODES, motion_answers
from qlinkgen.codecs import qlink
from qlinkgen.link.timing import QUIET_BYTES, Timing
from qlinkgen.protocols.qlink import Bus
from qlinkgen.transport.opening import open_port
from qlinkgen.transport.port import Port

TIMING = Timing.of(qlink, host_slack=0.0)
WORDS = list(range(0x1000, 0x100C))
SLICE = 100
#: Bytes of an answer without stuffing.
ANSWER = 16
RAW = "os.write, os.read"
OURS = "Bus.motion"
INTRO = """\
A motion with 12 words to a node in a second process that answers at once, over a pty: 33 bytes sent, 16
received; for the Modbus libraries 5 registers, 8 bytes sent and 15 received. Best round trip of all rounds,
all in turns, over that of the bare system calls. CPU is the client's. The gap is the time from reading the
last byte of an answer to writing the first byte of the next request while `stream_motion` feeds 4 nodes; the
share is that of the time in which a line of 115200 baud is busy, including the node's own turnaround."""

Client = Callable[[], object]


@contextlib.contextmanager
def responder(kind: str) -> Iterator[str]:
    """A process that answers on a pty; yields the name of the client's side."""
    master, slave = os.openpty()
    tty.setraw(slave)
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.wire_responder", kind],
        stdin=master,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    os.close(master)
    try:
        os.write(slave, MODBUS_REQUEST if kind == "modbus" else next(requests()))
        os.read(slave, 512)  # it has started
        yield os.ttyname(slave)
    finally:
        os.close(slave)
        process.terminate()
        process.wait()


def raw_client(name: str, requests: Iterator[bytes]) -> Client:
    """Two system calls only."""
    descriptor = os.open(name, os.O_RDWR | os.O_NOCTTY)

    def ask() -> bytes:
        os.write(descriptor, next(requests))
        answer = os.read(descriptor, 512)
        while len(answer) < ANSWER:
            answer += os.read(descriptor, 512)
        return answer

    return ask


def pyserial_client(name: str, requests: Iterator[bytes]) -> Client:
    """Pyserial only; its read needs the number of bytes."""
    port = load("serial", "pyserial").Serial(name, TIMING.baud, timeout=1)

    def ask() -> bytes:
        port.write(next(requests))
        answer: bytes = port.read(ANSWER)
        return answer

    return ask


def pymodbus_client(name: str) -> Client:
    """The synchronous client of pymodbus."""
    client = load("pymodbus.client", "pymodbus").ModbusSerialClient(name, baudrate=TIMING.baud)
    client.connect()

    def ask() -> object:
        answer = client.read_holding_registers(0, count=5)
        if answer.isError():
            raise PeerMissing(f"pymodbus: {answer}")
        return answer

    return ask


def minimalmodbus_client(name: str) -> Client:
    """A client of minimalmodbus."""
    module = load("minimalmodbus")
    instrument = module.Instrument(name, 1)
    instrument.serial.baudrate = TIMING.baud
    return lambda: instrument.read_registers(0, 5)


def requests() -> Iterator[bytes]:
    """Motions to one node whose answers have no stuffed bytes."""
    answers = motion_answers()
    return itertools.cycle(
        qlink.MotionRequest(node=NODES[0], counter=counter, segments=WORDS).to_frame()
        for counter in range(256)
        if len(answers[NODES[0], counter]) == ANSWER
    )


class TimedPort(Port):
    """Records the caller's time from an answer to the next request."""

    def __init__(self, port: Port) -> None:
        self._port = port
        self.name, self.baud, self.capabilities = port.name, port.baud, port.capabilities
        self.gaps: list[float] = []
        self.sent = 0
        self.received = 0
        self._read_at = 0.0

    def read(self, timeout: float) -> bytes:
        """Read, and record the time of the last bytes."""
        data = self._port.read(timeout)
        if data:
            self._read_at = time.perf_counter()
            self.received += len(data)
        return data

    def write(self, data: bytes) -> None:
        """Write, and record the caller's time since the last read."""
        if self._read_at:
            self.gaps.append(time.perf_counter() - self._read_at)
        self.sent += len(data)
        self._port.write(data)

    def close(self) -> None:
        """Close."""
        self._port.close()


class Run:
    """One client, slice by slice."""

    def __init__(self, client: Client, size: int) -> None:
        self.client = client
        self.size = size
        self.wall = measure.Timing()
        self.cpu = measure.Timing()
        client()

    def once(self) -> None:
        """Time one slice of transactions."""
        client = self.client
        cpu, start = time.process_time(), time.perf_counter()
        for _ in range(self.size):
            client()
        self.wall.rounds.append((time.perf_counter() - start) / self.size)
        self.cpu.rounds.append((time.process_time() - cpu) / self.size)


def section(rounds: int) -> Section:
    """Measure all clients in turns."""
    result = Section("Transactions over a pty", INTRO, ["", "us", "x raw", "CPU us"])
    with contextlib.ExitStack() as stack:
        runs = dict(_runs(stack, result.missing))
        for _ in range(rounds):
            for run in runs.values():
                run.once()
    base = runs[RAW].wall
    result.rows = [_row(name, run, base) for name, run in runs.items()]
    gap, share = _streaming(rounds * 4 * len(NODES))
    result.rows.append(["gap while streaming, median", number(gap * 1e6), "", ""])
    result.goals = [
        Goal("motion through the public API", runs[OURS].wall.over(base), 4, "x raw round trip"),
        *_peer_goals(runs),
        Goal("answer read to next request written, median", gap * 1e6, 100, "us"),
        Goal("share of time that streaming keeps a 115200 line busy", share * 100, 97, "%", at_least=True),
    ]
    return result


def _runs(stack: contextlib.ExitStack, missing: list[str]) -> Iterator[tuple[str, Run]]:
    def line(kind: str) -> str:
        return stack.enter_context(responder(kind))

    yield RAW, Run(raw_client(line("motion"), requests()), SLICE)
    yield "pyserial", Run(pyserial_client(line("motion"), requests()), SLICE)
    bus = stack.enter_context(Bus(open_port(line("motion")), echo="none"))
    node = bus.node(NODES[0])
    yield OURS, Run(lambda: node.motion(segments=WORDS), SLICE)
    for name, make in (("pymodbus", pymodbus_client), ("minimalmodbus", minimalmodbus_client)):
        try:
            yield name, Run(make(line("modbus")), 2)
        except PeerMissing as reason:
            missing.append(str(reason))


def _row(name: str, run: Run, base: measure.Timing) -> list[str]:
    return [
        name,
        number(run.wall.best * 1e6),
        number(run.wall.over(base)),
        number(run.cpu.best * 1e6),
    ]


def _peer_goals(runs: dict[str, Run]) -> list[Goal]:
    ours = runs[OURS].wall
    return [
        Goal(f"motion against {name}", runs[name].wall.over(ours), 20, "x faster", at_least=True)
        for name in ("pymodbus", "minimalmodbus")
        if name in runs
    ]


def _streaming(transactions: int) -> tuple[float, float]:
    """Median gap in seconds, and the share of the time in which the line would be busy."""
    with responder("motion") as name, Bus(TimedPort(open_port(name)), echo="none") as bus:
        port = bus.port
        assert isinstance(port, TimedPort)
        words = {
            node: itertools.islice(itertools.cycle(WORDS), transactions // len(NODES) * len(WORDS))
            for node in NODES
        }
        for _ in bus.stream_motion(words):
            pass
        gap = median(port.gaps)
        count = len(port.gaps)
        busy = (port.sent + port.received) / count + QUIET_BYTES
    seconds = TIMING.on_wire(1) * busy
    return gap, seconds / (seconds + gap)
