"""Ports that are closed while other threads and tasks use them.

The numbers of the closed descriptors go to socket pairs at once. These must neither lose a byte nor get one.
"""

from __future__ import annotations

import asyncio
import os
import socket
import termios
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from qlinkgen.codecs import qlink, trio
from qlinkgen.errors import PortLost
from qlinkgen.link import MasterEngine, SlaveEngine
from qlinkgen.link.ring import RingNode
from qlinkgen.protocols.qlink.matching import ACCEPTS
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.sim.port_ring import PortRing
from qlinkgen.sim.pty_bus import PtyBus
from qlinkgen.transport import Port, ReopeningPort, SerialPort, memory_pair, open_port, open_pty
from qlinkgen.transport import aio as aio_module
from qlinkgen.transport.aio import AsyncMaster
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.conversation import timing_of
from qlinkgen.transport.ring import NodeThread
from qlinkgen.transport.ring_aio import AsyncNode
from qlinkgen.transport.serving import serve, serve_async
from tests.link.line import Node
from tests.transport.conftest import PATIENCE

pytestmark = pytest.mark.pty

FOREIGN = b"bytes of another file"
CLOSED = "was closed here"


class Opened(NamedTuple):
    """A port, and the resources to close after it."""

    port: Port
    rest: ExitStack


def open_memory() -> Opened:
    near, far = memory_pair()
    rest = ExitStack()
    rest.callback(far.close)
    return Opened(near, rest)


def open_pty_end() -> Opened:
    return Opened(open_pty(), ExitStack())


def open_serial() -> Opened:
    rest = ExitStack()
    return Opened(SerialPort(rest.enter_context(open_pty()).path), rest)


def open_switched() -> Opened:
    rest = ExitStack()
    path = rest.enter_context(open_pty()).path
    return Opened(SerialPort(path, direction=lambda sending: None), rest)


def open_again() -> Opened:
    rest = ExitStack()
    port = open_port(rest.enter_context(open_pty()).path, reopen=True)
    assert isinstance(port, ReopeningPort)
    return Opened(port, rest)


def open_socket() -> Opened:
    rest = ExitStack()
    server = rest.enter_context(socket.create_server(("127.0.0.1", 0)))
    port = open_port(f"socket://127.0.0.1:{server.getsockname()[1]}")
    rest.enter_context(server.accept()[0])
    return Opened(port, rest)


def open_loop() -> Opened:
    return Opened(SerialPort("loop://"), ExitStack())


#: How often each is closed; pyserial sleeps for 0.3 s after it has closed a socket.
KINDS: dict[str, tuple[Callable[[], Opened], int]] = {
    "memory": (open_memory, 20),
    "pty": (open_pty_end, 20),
    "serial": (open_serial, 20),
    "switched": (open_switched, 20),
    "reopening": (open_again, 20),
    "socket": (open_socket, 2),
    "pyserial": (open_loop, 10),
}
with_descriptor = pytest.mark.parametrize(
    "kind", [each for each in KINDS if each not in {"memory", "pyserial"}]
)


def numbers() -> set[int]:
    """The open descriptors, without that of the folder they are listed from."""
    found = [int(each.name) for each in Path("/proc/self/fd").iterdir()]
    return {each for each in found if os.path.lexists(f"/proc/self/fd/{each}")}


class Foreign:
    """Socket pairs that reuse the numbers of closed descriptors, with some bytes to read at each end."""

    def __init__(self, wanted: set[int]) -> None:
        self.ends: list[socket.socket] = []
        while wanted - {end.fileno() for end in self.ends}:
            assert len(self.ends) < 64, f"{wanted} are still open"
            self.ends += socket.socketpair()
        for end in self.ends:
            end.setblocking(False)
            end.sendall(FOREIGN)

    def check(self) -> None:
        """Nothing was read, nothing was written."""
        for end in self.ends:
            assert end.recv(4096) == FOREIGN
            with pytest.raises(BlockingIOError):
                end.recv(1)
        for end in self.ends:
            end.close()


class Opening:
    """One opening of a port, with the numbers that it uses."""

    def __init__(self, kind: str) -> None:
        before = numbers()
        self.port, rest = KINDS[kind][0]()
        with rest:
            self.rest = rest.pop_all()
        self.used = numbers() - before

    def foreign(self) -> Foreign:
        """Reuse the free descriptor numbers among those of the port."""
        return Foreign(self.used - numbers())


@contextmanager
def opened(kind: str) -> Iterator[Opening]:
    opening = Opening(kind)
    with opening.rest:
        yield opening


class Users:
    """Threads that use a port until it refuses."""

    def __init__(self, *calls: Callable[[], object]) -> None:
        self.errors: list[BaseException] = []
        self.begun = threading.Barrier(len(calls) + 1)
        self.threads = [threading.Thread(target=self._use, args=[each], daemon=True) for each in calls]
        for each in self.threads:
            each.start()
        self.begun.wait(PATIENCE)
        time.sleep(0.002)  # so that the calls are waiting

    def _use(self, call: Callable[[], object]) -> None:
        self.begun.wait(PATIENCE)
        try:
            while True:
                call()
        except BaseException as error:  # noqa: BLE001  # checked by the test
            self.errors.append(error)

    def check(self, *, closed: str = CLOSED) -> None:
        """All calls have ended, with the expected error."""
        for each in self.threads:
            each.join(PATIENCE)
            assert not each.is_alive()
        assert len(self.errors) == len(self.threads)
        for error in self.errors:
            assert type(error) is PortLost
            assert closed in str(error)


def hold(port: Port) -> None:
    """Wait on a port's descriptor and a waker, as drivers do."""
    woken = threading.Event()
    with port.hold(woken.set) as descriptor:
        assert descriptor is not None
        while not woken.wait(0.0005):
            os.fstat(descriptor)


CALLS: dict[str, Callable[[Port], Callable[[], object]]] = {
    "wait": lambda port: lambda: port.read(PATIENCE),
    "look": lambda port: lambda: port.read(0),
    "short": lambda port: lambda: port.read(0.0001),
    "write": lambda port: lambda: port.write(b"\xa5\xa5frame"),
    "long": lambda port: lambda: port.write(bytes(70_000)),
}


#: pyserial's loop:// waits for room without a limit, unlike real ports.
PAIRS = [
    (kind, call)
    for kind in KINDS
    for call in [*CALLS, "all"]
    if kind != "pyserial" or call in {"wait", "look", "short"}
]


@pytest.mark.parametrize(("kind", "call"), PAIRS)
def test_users_are_told_and_no_foreign_descriptor_is_touched(kind: str, call: str) -> None:
    for _ in range(KINDS[kind][1]):
        with opened(kind) as opening:
            port = opening.port
            makers = CALLS.values() if call == "all" else [CALLS[call]] * 3
            users = Users(*(make(port) for make in makers))
            port.close()
            foreign = opening.foreign()
            with pytest.raises(PortLost, match=CLOSED):
                port.read(0)
            with pytest.raises(PortLost, match=CLOSED):
                port.write(b"x")
            users.check()
            assert port.fileno() is None
            foreign.check()


def test_a_drain_is_woken(monkeypatch: pytest.MonkeyPatch) -> None:
    flushed, begun = threading.Event(), threading.Event()
    numbers_flushed: list[int] = []

    def drain(descriptor: int) -> None:
        begun.set()
        assert flushed.wait(PATIENCE)
        raise termios.error(5, "Input/output error")

    def flush(descriptor: int, queue: int) -> None:
        assert queue == termios.TCOFLUSH
        numbers_flushed.append(descriptor)
        flushed.set()

    switched: list[bool] = []
    with open_pty() as far:
        port = SerialPort(far.path, direction=switched.append)
        number = port.fileno()
        assert number is not None
        monkeypatch.setattr(termios, "tcdrain", drain)
        monkeypatch.setattr(termios, "tcflush", flush)
        users = Users(lambda: port.write(b"x"))
        assert begun.wait(PATIENCE)
        port.close()
        foreign = Foreign({number})
        users.check()
        foreign.check()
    assert (switched, numbers_flushed) == ([False, True, False], [number])


def test_closed_by_the_call_itself() -> None:
    with open_pty() as far:
        port = SerialPort(far.path, direction=lambda sending: port.close() if sending else None)
        number = port.fileno()
        with pytest.raises(PortLost, match=CLOSED):
            port.write(b"x")
        assert far.read(0) == b""
        assert number not in numbers()


def test_a_holder_that_stays_keeps_the_descriptor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("qlinkgen.transport.gate.PATIENCE", 0.01)
    with open_pty() as far:
        port = SerialPort(far.path)
        inside, leave = threading.Event(), threading.Event()
        woken: list[int] = []

        def stay() -> None:
            with port.hold(lambda: woken.append(1)) as number:
                assert number is not None
                inside.set()
                assert leave.wait(PATIENCE)
                os.fstat(number)

        thread = threading.Thread(target=stay)
        thread.start()
        assert inside.wait(PATIENCE)
        number = port.fileno()
        port.close()
        port.close()
        assert (woken, number in numbers()) == ([1, 1], True)
        leave.set()
        thread.join(PATIENCE)
        assert number not in numbers()
        with pytest.raises(PortLost, match=CLOSED), port.hold(leave.set):
            pass


def ask(master: BlockingMaster) -> object:
    return master.transact(qlink.MotorPositionRequest(node=3))


def master_of(maker: Any, port: Port) -> Any:
    engine = MasterEngine(qlink, timing_of(qlink, port, slack=PATIENCE), accepts=ACCEPTS, echo="none")
    return maker(engine, port)


@pytest.mark.parametrize("kind", [each for each in KINDS if each != "pyserial"])
def test_a_transaction_is_told(kind: str) -> None:
    with opened(kind) as opening:
        master = master_of(BlockingMaster, opening.port)
        users = Users(*[lambda: ask(master)] * 3)
        master.close()
        foreign = opening.foreign()
        users.check()
        foreign.check()


@pytest.mark.parametrize("kind", KINDS)
def test_a_server_is_told(kind: str) -> None:
    with opened(kind) as opening:
        users = Users(lambda: serve(opening.port, SlaveEngine(qlink, Node(3))))
        opening.port.close()
        foreign = opening.foreign()
        users.check()
        foreign.check()


@pytest.mark.parametrize("kind", KINDS)
def test_the_thread_of_a_ring_node_is_told(kind: str) -> None:
    with opened(kind) as opening:
        node = NodeThread(opening.port, RingNode(trio))
        users = Users(*[lambda: node.until(lambda now: None, None)] * 2)
        opening.port.close()
        foreign = opening.foreign()
        users.check()
        with pytest.raises(PortLost, match=CLOSED):
            node.act(lambda now: None)
        foreign.check()
        node.close()


async def _in_loop(opening: Opening, begin: Callable[[], Any], *, elsewhere: bool) -> None:
    """Close a port while tasks use it, and check that the loop still watches sockets with its old numbers."""
    tasks = [asyncio.ensure_future(begin()) for _ in range(2)]
    await asyncio.sleep(0.005)
    if elsewhere:
        await asyncio.to_thread(opening.port.close)
    else:
        opening.port.close()
    foreign = opening.foreign()
    loop = asyncio.get_running_loop()
    seen: list[int] = []
    for end in foreign.ends:
        loop.add_reader(end, seen.append, end.fileno())
    results = await asyncio.wait_for(asyncio.gather(*tasks, return_exceptions=True), PATIENCE)
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert {end.fileno() for end in foreign.ends} <= set(seen)
    for end in foreign.ends:
        assert loop.remove_reader(end)
    for result in results:
        assert type(result) is PortLost
        assert CLOSED in str(result)
    foreign.check()


async def _forever(call: Callable[[], Any]) -> None:
    while True:
        await call()


@pytest.mark.parametrize("elsewhere", [False, True], ids=["loop", "thread"])
@pytest.mark.parametrize("use", ["read", "transact", "serve", "ring"])
@pytest.mark.parametrize("kind", KINDS)
def test_tasks_are_told(kind: str, use: str, elsewhere: bool) -> None:
    async def run(opening: Opening) -> None:
        port = opening.port
        if use == "read":
            single = asyncio.Lock()  # an event loop watches a descriptor for one task at a time

            async def read() -> None:
                async with single:
                    await aio_module.read(port, PATIENCE)

            await _in_loop(opening, lambda: _forever(read), elsewhere=elsewhere)
        elif use == "transact":
            master = master_of(AsyncMaster, port)
            await _in_loop(opening, lambda: _forever(lambda: ask(master)), elsewhere=elsewhere)
        elif use == "serve":
            begun: list[int] = []

            async def answer() -> None:
                if not begun:
                    begun.append(1)
                    await serve_async(port, SlaveEngine(qlink, Node(3)))
                port.read(0)
                await asyncio.sleep(0.001)

            await _in_loop(opening, lambda: _forever(answer), elsewhere=elsewhere)
        else:
            node = AsyncNode(port, RingNode(trio))
            await _in_loop(opening, lambda: node.until(lambda now: None, None), elsewhere=elsewhere)
            await node.close()

    if kind == "pyserial" and use == "transact":
        return  # it receives its own bytes
    with opened(kind) as opening:
        asyncio.run(run(opening))


def test_a_watch_outlives_its_loop() -> None:
    with open_pty() as far:
        port = SerialPort(far.path)
        number = port.fileno()
        closed: list[int] = []

        async def watch() -> None:
            aio_module.watch(port, lambda: None, lambda: closed.append(1))

        asyncio.run(watch())
        port.close()
        assert closed == [1]
        assert number not in numbers()


@pytest.mark.parametrize("ring", [False, True], ids=["line", "ring"])
@pytest.mark.parametrize("started", [False, True], ids=["run", "start"])
def test_a_simulated_line_is_told(ring: bool, started: bool) -> None:
    for _ in range(5):
        before = numbers()
        bus: PtyBus = PortRing(["port", "keypad", "port"]) if ring else PtyBus(Wire(baud=None))
        used = numbers() - before
        if started:
            bus.start()
            time.sleep(0.002)
            bus.port.close()
            with pytest.raises(PortLost, match=CLOSED):
                bus.close()
        else:
            thread = threading.Thread(target=bus.run)
            thread.start()
            time.sleep(0.002)
            bus.close()
            thread.join(PATIENCE)
            assert not thread.is_alive()
        foreign = Foreign(used)
        bus.request_stop()
        bus.call(lambda: None)
        bus.close()
        foreign.check()


def test_a_simulated_port() -> None:
    port = VirtualPort(Wire(baud=None), name="sim")
    port.close()
    with pytest.raises(PortLost, match=f"sim {CLOSED}"):
        port.read(0)


def test_reopening_after_a_loss_by_several_threads() -> None:
    """A thread that learns of a loss late must not close the port reopened by another thread."""
    made: list[Port] = []

    def opener() -> Port:
        near, far = memory_pair()
        made.append(far)
        return near

    port = ReopeningPort(opener)
    stop = threading.Event()
    faults: list[BaseException] = []

    def use() -> None:
        while not stop.is_set():
            try:
                port.read(0.001)
            except PortLost as error:
                if "other end was closed" not in str(error):
                    faults.append(error)

    threads = [threading.Thread(target=use) for _ in range(3)]
    for each in threads:
        each.start()
    for _ in range(50):
        count = port.reopened
        made[-1].close()
        while port.reopened == count:
            time.sleep(0.0001)
    stop.set()
    for each in threads:
        each.join(PATIENCE)
    assert (faults, port.reopened) == ([], 50)
    port.close()
