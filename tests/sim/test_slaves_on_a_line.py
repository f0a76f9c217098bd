"""Slave engines of a real protocol on the line: sixteen of them, also under endless noise."""

from __future__ import annotations

from typing import Any

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.link.slave import SlaveEngine
from qlinkgen.sim import FaultPlan, VirtualPort, Wire
from qlinkgen.sim.wire import Chunks


class Repeater:
    """Repeats the data of a loop_back, as the protocol requires."""

    def __init__(self, number: int) -> None:
        self.number = number

    def handle(self, request: Any, now: float) -> Any | None:
        if isinstance(request, qlink.LoopBackRequest):
            return qlink.LoopBackResponse(node=self.number, offset=request.offset, data=request.data)
        return None


def bus(wire: Wire, numbers: range = range(1, 17)) -> list[SlaveEngine]:
    engines = [SlaveEngine(qlink, Repeater(number)) for number in numbers]
    for engine in engines:
        wire.attach(engine)
    return engines


def loop(port: VirtualPort, node: int, data: bytes, within: float = 0.02) -> list[Any]:
    """Send a request to a node, and return every frame received within a time."""
    decoder = qlink.StreamDecoder("response")
    port.write(qlink.LoopBackRequest(node=node, offset=0, data=data).to_frame())
    end = port.now() + within
    found = []
    while port.now() < end:
        found += [event for event in decoder.feed(port.read(end - port.now())) if hasattr(event, "to_frame")]
    return found


def test_sixteen_nodes() -> None:
    pieces: tuple[Chunks, ...] = ("frame", "byte")
    for chunks in pieces:
        wire = Wire(baud=115200, chunks=chunks)
        engines = bus(wire)
        port = VirtualPort(wire)
        for number in range(1, 17):
            answers = loop(port, number, b"\xa5" * number)
            assert [(answer.node, bytes(answer.data)) for answer in answers] == [(number, b"\xa5" * number)]
        assert [engine.counters.answers for engine in engines] == [1] * 16
        # Each hears the requests to the others and the answers of the others.
        assert [engine.counters.foreign for engine in engines] == [30] * 16
        assert wire.collisions == 0


def test_nothing_but_intact_frames_is_answered() -> None:
    plan = FaultPlan.parse("flip=0.2,truncate=0.2,noise=0.2,duplicate=0.1:0.005,seed=3")
    wire = Wire(baud=115200, faults=plan)
    engines = bus(wire, range(1, 5))
    port = VirtualPort(wire)
    for n in range(500):
        for answer in loop(port, n % 4 + 1, bytes([n % 256, 0xA5])):
            assert bytes(answer.data) == bytes([n % 256, 0xA5])
    assert 200 < sum(engine.counters.answers for engine in engines) < 500
    assert sum(sum(engine.counters.damaged.values()) for engine in engines) > 100


def test_endless_garbage_ends_when_the_time_is_over() -> None:
    class Babbler:
        """A station with a stuck transmitter."""

        def __init__(self) -> None:
            self.due = 0.0

        def receive(self, data: bytes, now: float) -> None:
            pass

        def bytes_to_send(self, now: float) -> bytes:
            self.due = now + 10 * 10 / 115200
            return b"\xa5\xa5\x55garbage"

        def next_timer(self) -> float:
            return self.due

    wire = Wire(baud=115200)
    bus(wire, range(1, 4))
    wire.attach(Babbler())
    port = VirtualPort(wire)
    for _ in range(20):
        begin = port.now()
        loop(port, 1, b"hello?", within=0.05)
        # A read takes available bytes within its timeout, so a deadline holds under any traffic.
        assert port.now() - begin == pytest.approx(0.05)
    assert wire.collisions >= 20
    assert len(wire._queue) < 20
    assert len(wire._sending) < 5
