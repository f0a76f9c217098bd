"""A child forked while other threads use ports and drivers never waits for them."""

from __future__ import annotations

import os
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from typing import Any

import pytest

from qlinkgen.codecs import qlink, trio
from qlinkgen.errors import NoReply, PortError, PortLost
from qlinkgen.link.ring import RingNode
from qlinkgen.protocols.qlink import Bus
from qlinkgen.sim import Wire
from qlinkgen.sim.pty_bus import PtyBus
from qlinkgen.transport import Port, ReopeningPort, SerialPort, memory_pair, open_pty
from qlinkgen.transport.port import Capabilities, closed_here
from qlinkgen.transport.ring import NodeThread, PumpedNode
from qlinkgen.transport.waker import Waker
from tests.transport.conftest import PATIENCE

pytestmark = pytest.mark.pty

ASK = qlink.MotorPositionRequest(node=3)


def in_child(check: Callable[[], object]) -> None:
    """Fork, check something in the child within a time limit, and fail if the child fails."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        os.close(reader)
        signal.setitimer(signal.ITIMER_REAL, PATIENCE)  # SIGALRM ends a child that waits
        try:
            check()
        except BaseException:  # noqa: BLE001  # the test must not continue in the child
            os.write(writer, traceback.format_exc().encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        told = pipe.read().decode()
    _, status = os.waitpid(child, 0)
    assert (told, status) == ("", 0)


class Slow(Port):
    """A port whose calls take long, and signal their start."""

    name, baud, capabilities = "slow", 115200, Capabilities()

    def __init__(self) -> None:
        self.begun = threading.Event()
        self.end = threading.Event()

    def read(self, timeout: float) -> bytes:
        if not timeout:
            return b""
        self.begun.set()
        if self.end.wait(timeout):
            raise closed_here(self.name)
        return b""

    def write(self, data: bytes) -> None:
        pass

    def close(self) -> None:
        self.end.set()


@pytest.fixture
def threads() -> Iterator[Callable[[Callable[[], object]], None]]:
    """Returns a function that calls something in a thread; errors of ports and links are expected."""
    running: list[threading.Thread] = []

    def start(call: Callable[[], object]) -> None:
        def run() -> None:
            with suppress(PortError, NoReply):
                call()

        running.append(threading.Thread(target=run))
        running[-1].start()

    yield start
    for each in running:
        each.join(PATIENCE)
        assert not each.is_alive()


Start = Callable[[Callable[[], object]], None]


@pytest.mark.parametrize("use", ["transact", "motion", "close"])
def test_a_bus_during_a_transaction(threads: Start, use: str) -> None:
    port = Slow()
    bus = Bus(port, slack=PATIENCE, attempts=1, echo="none")
    threads(lambda: bus.motion(3) if use == "motion" else bus.transact(ASK))
    assert port.begun.wait(PATIENCE)

    def check() -> None:
        if use != "close":
            assert not bus.engine.busy
            assert bus._lock.acquire(timeout=1)
        bus.close()

    in_child(check)
    bus.close()


def test_a_bus_in_the_child_asks(threads: Start) -> None:
    """The pending transaction of the parent is aborted, and the bus works."""
    with open_pty() as far, SerialPort(far.path) as port:
        bus = Bus(port, slack=0.0, attempts=1, echo="none")
        asked = threading.Event()
        held = threading.Event()

        def on_event(event: object) -> None:
            asked.set()
            held.wait(PATIENCE)

        bus.on_event = on_event
        threads(lambda: bus.transact(ASK))
        assert asked.wait(PATIENCE)

        def check() -> None:
            bus.on_event = None
            with pytest.raises(NoReply):
                bus.transact(ASK)

        in_child(check)
        held.set()


def test_ports(threads: Start) -> None:
    """Every kind of port can be closed in the child at once, and still works in the parent."""
    with ExitStack() as rest:
        pty = rest.enter_context(open_pty())
        serial = SerialPort(pty.path)
        far = rest.enter_context(open_pty())
        again = ReopeningPort(lambda: SerialPort(far.path))
        memory, other = memory_pair()
        ports: list[Port] = [serial, again, memory]
        for port in ports:
            threads(lambda port=port: port.read(PATIENCE))  # type: ignore[misc]
        time.sleep(0.01)

        def check() -> None:
            began = time.monotonic()
            for port in ports:
                assert port.read(0) == b""
                port.close()
                with pytest.raises(PortLost, match="was closed here"):
                    port.read(PATIENCE)
            assert time.monotonic() - began < 1.0  # nothing was waited for

        in_child(check)
        pty.write(b"x")  # the threads still wait: the child has not woken them
        far.write(b"x")
        other.write(b"x")
        for port in ports:
            port.write(b"x")
            port.close()


def test_locks_that_are_held() -> None:
    """Locks are held by another thread during the fork."""
    memory, _ = memory_pair()
    again = ReopeningPort(lambda: memory_pair()[0])
    waker = Waker()
    pumped = PumpedNode(memory_pair()[0], RingNode(trio))
    bus = PtyBus(Wire(baud=None))
    locks: list[Any] = [memory._incoming.changed, again._lock, waker._lock, pumped._lock, bus._running]
    held, done = threading.Event(), threading.Event()

    def hold() -> None:
        with ExitStack() as stack:
            for lock in locks:
                stack.enter_context(lock)
            held.set()
            done.wait(PATIENCE)

    thread = threading.Thread(target=hold)
    thread.start()
    assert held.wait(PATIENCE)

    def check() -> None:
        assert memory.read(0) == b""
        again.close()
        waker.wake()
        pumped.act(lambda now: None)
        bus.close()

    try:
        in_child(check)
    finally:
        done.set()
        thread.join(PATIENCE)
        waker.clear()
        waker.close()
        bus.close()


def test_a_ring_node_has_no_thread_in_the_child() -> None:
    near, far = memory_pair()
    node = NodeThread(near, RingNode(trio))

    def check() -> None:
        with pytest.raises(PortLost, match="parent process; open the port after the fork"):
            node.until(lambda now: None, None)
        node.close()

    in_child(check)
    message = trio.CharacterTransfer(address=5, characters="AB").to_frame()
    far.write(message)
    assert far.read(PATIENCE)
    node.close()
