"""One side of a link whose sides both ask, on a line in both directions at once."""

from __future__ import annotations

import random
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.errors import LinkError
from qlinkgen.link import Dialogue, Monitor, PeerEngine, Timing
from qlinkgen.link.monitor import Asked, Replied
from qlinkgen.schema import loads
from qlinkgen.transport import memory_pair
from qlinkgen.transport.conversation import timing_of
from qlinkgen.transport.peers import BlockingPeer

SCHEMA = """\
qlinkgen: 1
protocol: {name: both, title: Both, revision: "1", source: Manual}
frame:
  parts:
    start: AA
    length: {type: u8, counts: [data]}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/modbus, over: [length, code, data]}
bus: {kind: link, sides: [host, device], baud: 115200, response_within: 5 ms}
defaults: {addressing: none, repeat: safe, response: {id: request.id + 0x80}}
commands:
  ping:
    id: 1
    from: either
    request: {number: u32}
    response: {number: {type: u32, echo: true}, twice: u32}
  fetch:
    id: 3
    from: device
    request: {block: u8}
    response: {block: {type: u8, echo: true}, data: "u8[1..4]"}
  store:
    id: 5
    request: {number: u8}
    steps:
      - {receive: ack}
      - {name: place, send: {id: 0x31, fields: {start: u16}}, within: 50 ms}
      - {receive: ack}
      - {name: done, receive: {id: 0x33, fields: {number: {type: u8, echo: true}, start: u16}}}
messages:
  ack: {id: 0x79, from: device, fields: {}}
  event: {id: 0x40, from: device, fields: {kind: u8}}
"""
BYTE = 10 / 115200


@pytest.fixture(scope="module")
def both() -> ModuleType:
    protocol, faults = loads(SCHEMA, "both.yaml")
    assert protocol is not None, faults
    return load_codec(protocol)


@dataclass
class Side:
    """Answers of one side."""

    codec: Any
    number: int = 0
    handled: int = 0

    def handle(self, request: Any, now: float) -> Any:
        self.handled += 1
        if isinstance(request, self.codec.PingRequest):
            return self.codec.PingResponse(number=request.number, twice=(2 * request.number) & 0xFFFFFFFF)
        if isinstance(request, self.codec.FetchRequest):
            return self.codec.FetchResponse(block=request.block, data=[request.block] * 3)
        return self.store(request) if isinstance(request, self.codec.StoreRequest) else None

    def store(self, request: Any) -> Any:
        place = yield self.codec.Ack()
        return [self.codec.Ack(), self.codec.StoreDone(number=request.number, start=place.start)]


@dataclass
class Line:
    """Both directions of a link in virtual time; ``spoil`` changes the bytes of a write."""

    engines: tuple[PeerEngine, PeerEngine]
    spoil: Callable[[bytes], bytes] = bytes
    now: float = 0.0
    #: Bytes on their way to each side, with the times of their arrival.
    coming: tuple[deque[tuple[float, int]], deque[tuple[float, int]]] = field(
        default_factory=lambda: (deque(), deque())
    )
    tapped: Callable[[bytes, float], None] = lambda *_: None

    def step(self) -> None:
        for engine, there in zip(self.engines, reversed(self.coming), strict=True):
            frame = engine.bytes_to_send(self.now)
            start = max(self.now, there[-1][0] if there else 0.0)
            there += [(start + BYTE * at, byte) for at, byte in enumerate(self.spoil(frame), 1)]
        timers = [engine.next_timer() for engine in self.engines]
        timers += [line[0][0] for line in self.coming if line]
        self.now = max(self.now, min((each for each in timers if each is not None), default=self.now + 0.001))
        for engine, line in zip(self.engines, self.coming, strict=True):
            while line and line[0][0] <= self.now:
                piece = bytes([line.popleft()[1]])
                self.tapped(piece, self.now)
                engine.receive(piece, self.now)
            timer = engine.next_timer()
            if timer is not None and timer <= self.now:
                engine.handle_timer(self.now)


def peers(codec: ModuleType) -> tuple[PeerEngine, PeerEngine]:
    def make() -> PeerEngine:
        return PeerEngine(codec, Timing.of(codec, host_slack=0.001), Side(codec))

    return make(), make()


def run(line: Line, requests: tuple[list[Any], list[Any]]) -> tuple[list[Any], list[Any]]:
    """Both sides perform their requests at once; return their answers, or errors."""
    done: tuple[list[Any], list[Any]] = ([], [])
    while any(len(found) < len(asked) for found, asked in zip(done, requests, strict=True)):
        for engine, asked, found in zip(line.engines, requests, done, strict=True):
            if not engine.busy and len(found) < len(asked):
                engine.start(asked[len(found)], line.now)
        line.step()
        for engine, asked, found in zip(line.engines, requests, done, strict=True):
            if not engine.busy and len(found) < len(asked):
                try:
                    found.append(engine.take().response)
                except LinkError as error:
                    found.append(error)
    return done


def requests(codec: Any, count: int, seed: int) -> tuple[list[Any], list[Any]]:
    chance = random.Random(seed)
    host: list[Any] = [codec.PingRequest(number=chance.getrandbits(32)) for _ in range(count)]
    host[::3] = [
        Dialogue(codec.StoreRequest(number=number % 256), [codec.StorePlace(start=chance.getrandbits(16))])
        for number in range(0, count, 3)
    ]
    device = [
        codec.FetchRequest(block=chance.getrandbits(8))
        if chance.random() < 0.5
        else codec.PingRequest(number=chance.getrandbits(32))
        for _ in range(count)
    ]
    return host, device


def right(codec: Any, request: Any, answer: Any) -> bool:
    """Whether an answer is that to a request."""
    if isinstance(request, Dialogue):
        begun: Any = request.request
        place: Any = request.further[0]
        last = codec.StoreDone(number=begun.number, start=place.start)
        return bool(answer[-1] == last)
    if isinstance(request, codec.FetchRequest):
        return bool(answer == codec.FetchResponse(block=request.block, data=[request.block] * 3))
    return bool(answer == codec.PingResponse(number=request.number, twice=(2 * request.number) & 0xFFFFFFFF))


def test_both_sides_ask_at_once(both: ModuleType) -> None:
    line = Line(peers(both))
    asked = requests(both, 40, 1)
    done = run(line, asked)
    for mine, found, engine in zip(asked, done, line.engines, strict=True):
        assert all(right(both, request, answer) for request, answer in zip(mine, found, strict=True))
        assert engine.total.repeats == engine.total.strays == sum(engine.total.damaged.values()) == 0
        assert engine.slave.node.handled == 40  # type: ignore[attr-defined]


def test_no_answer_is_wrong_under_faults(both: ModuleType) -> None:
    chance = random.Random(2)

    def spoil(frame: bytes) -> bytes:
        if not frame or chance.random() >= 0.18:
            return frame
        at, kind = chance.randrange(len(frame)), chance.randrange(4)
        changed = bytes([frame[at] ^ (1 << chance.randrange(8))])
        pieces = {0: b"", 1: changed, 2: frame[at : at + 1] * 2, 3: b"\xaa\x08" + frame[at : at + 1]}
        return b"" if kind == 0 and at == 0 else frame[:at] + pieces[kind] + frame[at + 1 :]

    line = Line(peers(both), spoil)
    asked = requests(both, 150, 3)
    done = run(line, asked)
    for mine, found in zip(asked, done, strict=True):
        answers = [(request, answer) for request, answer in zip(mine, found, strict=True)]
        lost = sum(isinstance(answer, LinkError) for _, answer in answers)
        assert all(
            isinstance(answer, LinkError) or right(both, request, answer) for request, answer in answers
        )
        assert lost < 40  # three attempts, each with up to five frames


def test_a_monitor_tells_the_requests_of_both_sides_from_the_answers(both: ModuleType) -> None:
    monitor = Monitor(both, Timing.of(both, host_slack=0.001))
    first, second = both.PingRequest(number=1), both.FetchRequest(block=2)
    answers = both.FetchResponse(block=2, data=[1]), both.PingResponse(number=1, twice=2)
    for at, message in enumerate((first, second, *answers)):
        monitor.receive(message.to_frame(), 0.001 * at)
    told = [type(each) for each in monitor.heard]
    assert told == [Asked, Asked, Replied, Replied]
    asked = [each.request for each in monitor.heard if isinstance(each, Replied)]
    assert asked == [second, first]


def test_threads_ask_and_serve_on_both_sides(both: ModuleType) -> None:
    sides = [
        BlockingPeer(PeerEngine(both, timing_of(both, port, slack=0.5), Side(both)), port)
        for port in memory_pair()
    ]
    over = threading.Event()
    serving = [threading.Thread(target=side.serve, args=(over.is_set,)) for side in sides]
    for thread in serving:
        thread.start()
    try:
        for number in range(10):
            assert sides[0].transact(both.PingRequest(number=number)).response.twice == 2 * number
            assert sides[1].transact(both.FetchRequest(block=number)).response.data == [number] * 3
    finally:
        over.set()
        for thread in serving:
            thread.join()
