"""The line on a real pty: programs on the other side, real time, and a clean end."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from qlinkgen.errors import PortLost
from qlinkgen.sim import SimulationError, VirtualPort, Wire
from qlinkgen.sim import pty_bus as module
from qlinkgen.sim.pty_bus import PtyBus
from qlinkgen.transport import PtyPort, open_pty
from tests.sim.lines import ANSWER, REQUEST, Answerer, Talker

# Time limit in seconds; a longer wait has failed.
PATIENCE = 20.0
ROOT = Path(__file__).parents[2]


class Client:
    """A program that has opened the port and reads, recording the time of each chunk."""

    def __init__(self, path: str) -> None:
        self.descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY)
        self.pieces: list[tuple[float, bytes]] = []

    def write(self, data: bytes) -> None:
        os.write(self.descriptor, data)

    def read(self, size: int) -> bytes:
        """Return exactly that many bytes."""
        self.pieces = []
        missing = size
        while missing > 0:
            assert select.select([self.descriptor], [], [], PATIENCE)[0], (
                f"{missing} of {size} bytes never came"
            )
            data = os.read(self.descriptor, missing)
            self.pieces.append((time.monotonic(), data))
            missing -= len(data)
        return b"".join(data for _, data in self.pieces)

    def close(self) -> None:
        os.close(self.descriptor)


def descriptors() -> set[str]:
    return {entry.name for entry in Path("/proc/self/fd").iterdir()}


@pytest.fixture(autouse=True)
def nothing_left() -> Iterator[None]:
    before, threads = len(descriptors()), threading.active_count()
    yield
    assert len(descriptors()) == before
    assert threading.active_count() == threads


@pytest.mark.parametrize(
    ("baud", "chunks"),
    [(None, "frame"), (None, "byte"), (115200, "frame"), (115200, "byte"), (9600, "random")],
)
def test_round_trips(baud: int | None, chunks: str) -> None:
    wire = Wire(baud=baud, chunks=chunks)  # type: ignore[arg-type]
    station = Answerer()
    wire.attach(station)
    with PtyBus(wire) as bus:
        client = Client(bus.path)
        for _ in range(20):
            client.write(REQUEST)
            assert client.read(len(ANSWER)) == ANSWER
        client.close()
    assert station.requests == 20


def test_bytes_come_when_a_line_would_bring_them() -> None:
    wire = Wire(baud=2400, chunks="byte")
    wire.attach(Answerer(turnaround=0.01))
    with PtyBus(wire) as bus:
        client = Client(bus.path)
        begin = time.monotonic()
        client.write(REQUEST)
        client.read(len(ANSWER))
        client.close()
    byte = 10 / 2400
    arrived = 0
    for at, data in client.pieces:
        # Never early; how late it may be depends on the machine.
        arrived += len(data)
        assert at - begin >= len(REQUEST) * byte + 0.01 + arrived * byte
    assert len(client.pieces) > 1


def test_it_has_an_echo_where_it_is_asked_for() -> None:
    wire = Wire(baud=None, echo=True)
    wire.attach(Answerer())
    with PtyBus(wire) as bus:
        client = Client(bus.path)
        client.write(REQUEST)
        assert client.read(len(REQUEST) + len(ANSWER)) == REQUEST + ANSWER
        client.close()


def test_what_is_due_without_a_question_comes_by_itself() -> None:
    wire = Wire(baud=None)
    wire.attach(Talker((time.monotonic() + 0.05, b"hello")))
    with PtyBus(wire) as bus:
        client = Client(bus.path)
        assert client.read(5) == b"hello"
        client.close()


def test_programs_come_and_go() -> None:
    wire = Wire(baud=None)
    wire.attach(Answerer())
    with PtyBus(wire) as bus:
        for _ in range(5):
            client = Client(bus.path)
            client.write(REQUEST)
            assert client.read(len(ANSWER)) == ANSWER
            client.close()


def test_a_program_that_never_reads_stops_nobody() -> None:
    wire = Wire(baud=None, echo=True)
    station = Answerer()
    wire.attach(station)
    with PtyBus(wire) as bus:
        client = Client(bus.path)
        for _ in range(2000):  # more than the kernel holds for one reader
            client.write(bytes(50))
        client.write(REQUEST)
        end = time.monotonic() + PATIENCE
        while not station.requests and time.monotonic() < end:
            time.sleep(0.005)
        client.close()
    assert station.requests == 1
    assert bus.port.dropped > 0  # type: ignore[attr-defined]


def test_a_link(tmp_path: Path) -> None:
    link = tmp_path / "bus"
    wire = Wire(baud=None)
    wire.attach(Answerer())
    with PtyBus(wire, link=link) as bus:
        assert str(link.resolve()) == bus.path
        client = Client(str(link))
        client.write(REQUEST)
        assert client.read(len(ANSWER)) == ANSWER
        client.close()
    assert not os.path.lexists(link)


def test_stop_is_immediate_and_close_may_come_twice() -> None:
    bus = PtyBus(Wire(baud=None)).start()
    bus.stop()
    bus.stop()
    bus.close()
    bus.close()


def test_stop_before_run() -> None:
    bus = PtyBus(Wire(baud=None))
    bus.request_stop()
    bus.run()
    with pytest.raises(SimulationError, match="make a new one"):
        bus.start()
    bus.close()


def test_start_twice() -> None:
    with PtyBus(Wire(baud=None)) as bus, pytest.raises(SimulationError, match="already started"):
        bus.start()


def test_stop_while_something_is_due_all_the_time() -> None:
    class Restless(Talker):
        def next_timer(self) -> float:
            return time.monotonic()

    wire = Wire(baud=300)
    wire.attach(Restless())
    with PtyBus(wire) as bus:
        client = Client(bus.path)
        client.write(b"x")
        client.close()


def test_the_failure_of_a_station_is_raised_where_the_bus_is_stopped() -> None:
    class Faulty(Talker):
        def receive(self, data: bytes, now: float) -> None:
            raise ZeroDivisionError("a fault of the station")

    wire = Wire(baud=None)
    wire.attach(Faulty())
    bus = PtyBus(wire).start()
    client = Client(bus.path)
    client.write(b"x")
    assert bus._thread is not None
    bus._thread.join(PATIENCE)
    client.close()
    with pytest.raises(ZeroDivisionError, match="a fault of the station"):
        bus.close()


def test_calls_are_made_by_the_thread_of_the_line() -> None:
    wire = Wire(baud=None)
    station = Answerer()
    with PtyBus(wire) as bus:
        done = threading.Event()
        names: list[str] = []
        bus.call(lambda: wire.attach(station))
        bus.call(lambda: names.append(threading.current_thread().name))
        bus.call(done.set)
        assert done.wait(PATIENCE)
        client = Client(bus.path)
        client.write(REQUEST)
        assert client.read(len(ANSWER)) == ANSWER
        client.close()
    assert names == [f"bus {bus.path}"]


def test_many_calls_do_not_block() -> None:
    bus = PtyBus(Wire(baud=None))
    made: list[int] = []
    for n in range(100_000):  # more than the pipe holds
        bus.call(lambda n=n: made.append(n))  # type: ignore[misc]
    bus.start()
    done = threading.Event()
    bus.call(done.set)
    assert done.wait(PATIENCE)
    bus.close()
    assert made == list(range(100_000))


def test_any_port_with_a_descriptor_will_do() -> None:
    wire = Wire(baud=None)
    wire.attach(Answerer())
    port = open_pty()
    with PtyBus(wire, port=port) as bus:
        client = Client(port.path)
        client.write(REQUEST)
        assert client.read(len(ANSWER)) == ANSWER
        client.close()
        assert bus.path == port.path
    with pytest.raises(SimulationError, match="no descriptor"):
        PtyBus(wire, port=VirtualPort(wire))


def test_a_port_that_is_lost_ends_the_run() -> None:
    class Unplugged(PtyPort):
        def read(self, timeout: float) -> bytes:
            raise PortLost(f"{self.name} was unplugged", port=self.name)

    bus = PtyBus(Wire(baud=None), port=Unplugged())
    client = Client(bus.path)
    client.write(b"x")
    with pytest.raises(PortLost, match="unplugged"):
        bus.run()
    client.close()
    bus.close()


def test_descriptors_that_select_does_not_take(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_SELECT_LIMIT", 0)
    wire = Wire(baud=9600, chunks="byte")
    wire.attach(Answerer(turnaround=0.003))
    with PtyBus(wire) as bus:
        client = Client(bus.path)
        for _ in range(3):
            client.write(REQUEST)
            assert client.read(len(ANSWER)) == ANSWER
        client.close()


PROGRAM = """
import signal, sys
from qlinkgen.sim import Wire
from qlinkgen.sim.pty_bus import PtyBus
from tests.sim.lines import Answerer
wire = Wire(baud=None)
wire.attach(Answerer())
bus = PtyBus(wire)
signal.signal(signal.SIGTERM, lambda *_: bus.request_stop())
print(bus.path, flush=True)
try:
    bus.run()
except KeyboardInterrupt:
    print("interrupted")
finally:
    bus.close()
print("closed")
"""


@pytest.mark.parametrize(("number", "last"), [(signal.SIGTERM, ""), (signal.SIGINT, "interrupted\n")])
def test_a_signal_ends_a_run(number: signal.Signals, last: str) -> None:
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert program.stdout is not None
    client = Client(program.stdout.readline().strip())
    client.write(REQUEST)
    assert client.read(len(ANSWER)) == ANSWER
    program.send_signal(number)
    output, errors = program.communicate(timeout=PATIENCE)
    client.close()
    assert (output, errors, program.returncode) == (f"{last}closed\n", "", 0)
