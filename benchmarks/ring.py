"""Cost of a node in the ring: added latency for each hop, CPU, and messages round a ring of 15.

The latency in byte times is that of the engine on a simulated line with line time; the latency of the host is
measured with a node in a second process, over a pty.
"""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import sys
import time
import tty
from collections.abc import Iterator
from decimal import Decimal
from functools import partial
from statistics import median

from benchmarks import ROOT, measure
from benchmarks.report import Goal, Section, number
from qlinkgen.codecs import trio
from qlinkgen.link.ring import RingNode
from qlinkgen.protocols.trio import CoordinatorNode, MotionCoordinator
from qlinkgen.sim.virtual_ring import VirtualRing
from qlinkgen.transport import memory_ring
from qlinkgen.transport.ring import NodeIo

BAUD = 38400
NODES = 15
#: A variable to the previous node: it passes 14 others.
FARTHEST = trio.DirectVariableTransfer(address=NODES - 1, number=1, value=Decimal("1.5"))
#: The same as received by a node in between.
PASSING = trio.DirectVariableTransfer(address=2, number=1, value=Decimal("1.5")).to_frame()
SLICE = 100
INTRO = """\
A variable of 16 bytes. The latency in byte times is the delay that a node adds to a message on a simulated
line with line time, by cut-through (each byte is forwarded when it is received) and by store-and-forward (a
message is forwarded when its end is received). The host's own is measured over a pty, with the node in a
second process whose program sleeps: from writing the message to reading its first forwarded byte, less the
same for a process of only `os.read` and `os.write`; the median. The ring of 15 is on memory ports, once
served by one thread in turns and once by a thread for each node, as with 15 programs in one process."""


def hop_latency(*, cut_through: bool) -> float:
    """Byte times that one more node adds to the delay of a message."""
    return (_way(NODES - 1, cut_through) - _way(1, cut_through)) / (NODES - 2)


def _way(address: int, cut_through: bool) -> float:
    ring = VirtualRing(["coordinator"] * NODES, baud=BAUD, cut_through=cut_through)
    mc, target = ring.coordinator(0), ring.coordinator(address)
    mc.transmit(trio.DirectVariableTransfer(address=address, number=1, value=Decimal("1.5")))
    target.wait_until(lambda: target.vr[1] == 1.5)
    return ring.now * BAUD / trio.BUS.bits_per_byte


class Slices:
    """Times one operation, slice by slice."""

    def __init__(self) -> None:
        self.wall = measure.Timing()
        self.cpu = measure.Timing()

    @contextlib.contextmanager
    def once(self, count: int) -> Iterator[None]:
        """Time a slice of `count` operations."""
        cpu, start = time.process_time(), time.perf_counter()
        yield
        self.wall.rounds.append((time.perf_counter() - start) / count)
        self.cpu.rounds.append((time.process_time() - cpu) / count)


def pass_whole(node: RingNode) -> None:
    """Forward messages received in one piece."""
    for _ in range(SLICE):
        node.receive(PASSING, 0.0)
        node.bytes_to_send(0.0)


def pass_bytes(node: RingNode) -> None:
    """Forward messages received byte by byte."""
    for _ in range(SLICE):
        for at in range(len(PASSING)):
            node.receive(PASSING[at : at + 1], 0.0)
            node.bytes_to_send(0.0)


class MemoryRing:
    """15 nodes on memory ports, served by one thread."""

    def __init__(self) -> None:
        self.nodes = [CoordinatorNode() for _ in range(NODES)]
        ports = memory_ring(NODES)
        self.io = [NodeIo(port, node.link) for port, node in zip(ports, self.nodes, strict=True)]

    def once(self) -> None:
        """Send messages to the farthest node, one after the other."""
        first = self.io[0]
        for _ in range(SLICE):
            first.node.send(FARTHEST, 0.0)
            first.step(b"")
            for io in self.io[1:]:
                io.step(io.port.read(0))


def threads_round(clients: list[MotionCoordinator]) -> None:
    """Messages to the farthest node, one after the other, each node in a thread."""
    last = clients[NODES - 1]
    for turn in range(SLICE):
        clients[0].send(10 + NODES - 2, 1, 0, turn)
        last.wait_until(partial(_holds, last, turn), 10.0)


def _holds(client: MotionCoordinator, value: int) -> bool:
    return client.vr[0] == value


@contextlib.contextmanager
def responder(kind: str) -> Iterator[int]:
    """A process at a pty; yields the descriptor of our end."""
    master, slave = os.openpty()
    tty.setraw(slave)
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.ring_responder", kind],
        stdin=slave,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    try:
        start(master)
        yield master
    finally:
        process.kill()
        process.wait()
        os.close(slave)
        os.close(master)


def start(descriptor: int) -> None:
    """Wait until a process forwards; bytes sent before it has opened its end may be lost."""
    while not select.select([descriptor], (), (), 0.2)[0]:
        os.write(descriptor, PASSING)
    while select.select([descriptor], (), (), 0.2)[0]:
        os.read(descriptor, 4096)


def drain(descriptor: int) -> float:
    """Read one message; return the time of its first byte."""
    got = os.read(descriptor, 512)
    first = time.perf_counter()
    while len(got) < len(PASSING):
        got += os.read(descriptor, 512)
    return first


def first_byte(descriptor: int) -> float:
    """Seconds from writing a message to its first forwarded byte."""
    start = time.perf_counter()
    os.write(descriptor, PASSING)
    return drain(descriptor) - start


def host_latency(rounds: int) -> tuple[float, float]:
    """Median seconds of a raw process and of a node, interleaved."""
    raw: list[float] = []
    node: list[float] = []
    with responder("raw") as plain, responder("node") as ours:
        for _ in range(rounds * 5):
            raw.append(first_byte(plain))
            node.append(first_byte(ours))
    return median(raw), median(node)


def section(rounds: int) -> Section:
    """All measurements of the ring."""
    result = Section("A node of the Trio ring", INTRO, ["", "figure", "unit"])
    cut, store = hop_latency(cut_through=True), hop_latency(cut_through=False)
    whole, bytewise, turns, threads = Slices(), Slices(), Slices(), Slices()
    node, ring = RingNode(trio), MemoryRing()
    clients = [MotionCoordinator(port) for port in memory_ring(NODES)]
    try:
        for _ in range(rounds):
            with whole.once(SLICE):
                pass_whole(node)
            with bytewise.once(SLICE):
                pass_bytes(node)
            with turns.once(SLICE):
                ring.once()
        for _ in range(max(1, rounds // 10)):
            with threads.once(SLICE):
                threads_round(clients)
    finally:
        for client in clients:
            client.close()
    raw, ours = host_latency(rounds)
    own = (ours - raw) * 1e6
    result.rows = [
        ["added latency for each hop, cut-through", number(cut), "byte times"],
        ["added latency for each hop, store-and-forward", number(store), "byte times"],
        ["CPU for each hop, message in one piece", number(whole.cpu.best * 1e6), "us"],
        ["CPU for each hop, message byte by byte", number(bytewise.cpu.best * 1e6), "us"],
        ["first byte forwarded over a pty, raw process", number(raw * 1e6), "us"],
        ["first byte forwarded over a pty, node", number(ours * 1e6), "us"],
        ["messages round 15 nodes, one thread", number(1 / turns.wall.best), "1/s"],
        ["messages round 15 nodes, a thread each", number(1 / threads.wall.best), "1/s"],
    ]
    result.goals = [
        Goal("added latency for each hop", cut, 2, "byte times"),
        Goal("the host's own share of it", own, 100, "us"),
    ]
    return result
