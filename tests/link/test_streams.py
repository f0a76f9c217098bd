"""Answers that come until another command stops them."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import aclosing
from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.errors import NoReply, Refused
from qlinkgen.link import PENDING, MasterEngine, Monitor, SlaveEngine, Timing
from qlinkgen.link.events import Stray
from qlinkgen.link.monitor import Unanswered
from qlinkgen.schema import loads
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.transport.aio import AsyncMaster
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import drive

SCHEMA = """\
qlinkgen: 1
protocol: {name: lidar, title: Lidar, revision: "1", source: Manual}
frame:
  parts:
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/modbus, over: [node, code, length, data]}
bus: {kind: master_slave, nodes: 1..9, broadcast: 0, baud: 9600, response_within: 10 ms}
defaults: {addressing: node, repeat: safe}
replies:
  fault: {id: request.id + 0x80, fields: {reason: u8}}
  end: {id: 0x70, fields: {}, means: done}
  wait: {id: 0x71, fields: {}, means: pending, within: 500 ms}
commands:
  scan: {id: 1, request: {sensor: u8}, response: {value: u8}, many: {until: stop, within: 50 ms}}
  watch: {id: 3, request: {}, response: {value: u8}, many: {until: halt}}
  stop: {id: 2, request: {sensor: u8}, response: {}}
  halt: {id: 4, request: {}, response: none}
  read: {id: 5, request: {}, response: {value: u8}}
"""
SLACK = 0.002


@pytest.fixture(scope="module")
def lidar() -> ModuleType:
    protocol, faults = loads(SCHEMA, "lidar.yaml")
    assert protocol is not None, faults
    return load_codec(protocol)


class Lidar:
    """Measures as fast as the line allows, until it is stopped."""

    number = 3

    def __init__(self, lidar: ModuleType, most: int = 1000) -> None:
        self.lidar = lidar
        self.most = most
        self.asked: list[Any] = []
        self.deaf = 0  #: number of requests to stop that it does not hear

    def handle(self, request: Any, now: float) -> Any:
        lidar, kind = self.lidar, type(request)
        self.asked.append(request)
        if kind is lidar.ScanRequest and request.sensor == 9:
            return lidar.ScanFault(node=3, reason=7)
        if kind in {lidar.ScanRequest, lidar.WatchRequest}:
            return self.measure(kind.__name__.removesuffix("Request"))
        if kind is lidar.StopRequest:
            self.deaf -= 1
            return lidar.StopResponse(node=3) if self.deaf < 0 else None
        return lidar.ReadResponse(node=3, value=77) if kind is lidar.ReadRequest else None

    def measure(self, name: str) -> Iterator[Any]:
        make = getattr(self.lidar, f"{name}Response")
        return (make(node=3, value=value % 256) for value in range(self.most))


def connected(lidar: ModuleType, node: Any) -> tuple[BlockingMaster, Wire, SlaveEngine]:
    wire = Wire(baud=9600, collisions=False)  # both directions at once
    slave = SlaveEngine(lidar, node, baud=9600, turnaround=0.003)
    wire.attach(slave, "node 3")
    engine = MasterEngine(lidar, Timing.of(lidar, host_slack=SLACK))
    return BlockingMaster(engine, VirtualPort(wire)), wire, slave


def arrivals(messages: list[Any], first: float = 0.015, step: float = 0.012) -> list[tuple[float, bytes]]:
    return [(first + step * number, message.to_frame()) for number, message in enumerate(messages)]


def test_closing_the_iterator_sends_the_stop(lidar: ModuleType) -> None:
    node = Lidar(lidar)
    master, wire, slave = connected(lidar, node)
    values = []
    for each in master.stream(lidar.ScanRequest(node=3, sensor=5)):
        values.append(each.value)
        if len(values) == 20:
            break
    assert values == list(range(20))
    assert node.asked == [lidar.ScanRequest(node=3, sensor=5), lidar.StopRequest(node=3, sensor=5)]
    assert master.transact(lidar.ReadRequest(node=3)).response.value == 77
    engine: Any = master.engine
    assert not engine.streams
    assert engine.counters[3].answers > 20
    assert slave.counters.requests == 3
    assert wire.collisions == 0


def test_the_caller_may_stop_them_itself(lidar: ModuleType) -> None:
    node = Lidar(lidar)
    master, _, _ = connected(lidar, node)
    values = []
    for each in master.stream(lidar.WatchRequest(node=3)):
        values.append(each.value)
        if len(values) == 5:
            master.transact(lidar.HaltRequest(node=3))
    master.port.sleep(0.1)  # until the last request has arrived
    assert values[:5] == list(range(5))
    assert values == list(range(len(values)))
    assert len(values) < 9
    assert [type(each).__name__ for each in node.asked] == ["WatchRequest", "HaltRequest"]


def test_other_requests_are_answered_between_the_answers(lidar: ModuleType) -> None:
    master, _, _ = connected(lidar, Lidar(lidar))
    events: list[Any] = []
    master.on_event = events.append
    with_others = []
    for each in master.stream(lidar.ScanRequest(node=3, sensor=1)):
        with_others.append(each.value)
        if len(with_others) in {3, 6}:
            assert master.transact(lidar.ReadRequest(node=3)).response.value == 77
        if len(with_others) == 12:
            break
    assert with_others == list(range(12))
    assert not [each for each in events if isinstance(each, Stray)]


def test_a_lost_stop_is_sent_again_while_they_come(lidar: ModuleType) -> None:
    node = Lidar(lidar)
    node.deaf = 2
    master, _, _ = connected(lidar, node)
    answers = master.stream(lidar.ScanRequest(node=3, sensor=1))
    next(answers)
    answers.close()
    assert [type(each).__name__ for each in node.asked] == ["ScanRequest", *["StopRequest"] * 3]


def test_silence_ends_them(lidar: ModuleType) -> None:
    node = Lidar(lidar, most=4)
    master, _, _ = connected(lidar, node)
    values: list[int] = []
    with pytest.raises(NoReply, match=r"scan\.request: no further answer of node 3"):
        values.extend(each.value for each in master.stream(lidar.ScanRequest(node=3, sensor=1)))
    assert len(node.asked) == 1  # what is silent is not stopped
    assert master.transact(lidar.ReadRequest(node=3)).response.value == 77


@pytest.mark.parametrize("lost", [1, 3])
def test_a_lost_answer_is_no_error(lidar: ModuleType, lost: int) -> None:
    engine = MasterEngine(lidar, Timing.of(lidar, host_slack=SLACK))
    sent = [lidar.ScanResponse(node=3, value=value) for value in range(1 + lost)]
    request = lidar.ScanRequest(node=3, sensor=1)
    stream = drive(engine, request, arrivals([sent[0]])).response
    broken = bytearray(sent[1].to_frame())
    broken[-1] ^= 1
    engine.receive(bytes(broken), 0.04)
    engine.receive(lidar.ScanResponse(node=3, value=9).to_frame(), 0.07)
    assert [each.value for each in stream.answers] == [0, 9]
    assert not stream.ended
    engine.handle_timer(0.1)
    assert not stream.ended
    engine.handle_timer(0.15)  # 50 ms and the time of the longest answer
    assert stream.ended
    assert isinstance(stream.error, NoReply)


def test_a_refused_request_begins_nothing(lidar: ModuleType) -> None:
    master, _, _ = connected(lidar, Lidar(lidar))
    with pytest.raises(Refused, match="7"):
        next(master.stream(lidar.ScanRequest(node=3, sensor=9)))
    engine: Any = master.engine
    assert not engine.streams


@pytest.mark.parametrize("reply", ["fault", "end", "wait"])
def test_replies_in_between(lidar: ModuleType, reply: str) -> None:
    engine = MasterEngine(lidar, Timing.of(lidar, host_slack=SLACK))
    made = {"fault": lidar.ScanFault(node=3, reason=1), "end": lidar.End(node=3), "wait": lidar.Wait(node=3)}
    request = lidar.ScanRequest(node=3, sensor=1)
    stream = drive(engine, request, arrivals([lidar.ScanResponse(node=3, value=1)])).response
    engine.receive(made[reply].to_frame(), 0.03)
    assert stream.ended is (reply != "wait")
    assert isinstance(stream.error, Refused) is (reply == "fault")
    engine.handle_timer(0.3)
    assert stream.ended is (reply != "wait")


def test_no_answers_at_all(lidar: ModuleType) -> None:
    engine = MasterEngine(lidar, Timing.of(lidar, host_slack=SLACK))
    request = lidar.ScanRequest(node=3, sensor=1)
    stream = drive(engine, request, arrivals([lidar.End(node=3)])).response
    assert stream.ended
    assert not stream.answers
    assert not engine.streams


def test_a_request_whose_answers_have_an_end_is_no_stream(lidar: ModuleType) -> None:
    master, _, _ = connected(lidar, Lidar(lidar))
    with pytest.raises(TypeError, match="transact"):
        next(master.stream(lidar.ReadRequest(node=3)))


def test_tasks(lidar: ModuleType) -> None:
    async def run() -> list[int]:
        node = Lidar(lidar)
        blocking, _, _ = connected(lidar, node)
        master = AsyncMaster(blocking.engine, blocking.port)
        values = []
        async with aclosing(master.stream(lidar.ScanRequest(node=3, sensor=1))) as answers:
            async for each in answers:
                values.append(each.value)
                if len(values) == 6:
                    assert (await master.transact(lidar.ReadRequest(node=3))).response.value == 77
                if len(values) == 9:
                    break
        assert type(node.asked[-1]) is lidar.StopRequest
        return values

    assert asyncio.run(run()) == list(range(9))


class Slow(Lidar):
    """Measures now and then, with `SlaveEngine.answer`."""

    def measure(self, name: str) -> Any:
        return PENDING


def test_a_slave_answers_when_it_likes_until_the_stop(lidar: ModuleType) -> None:
    slave = SlaveEngine(lidar, Slow(lidar), baud=9600)
    scan = lidar.ScanRequest(node=3, sensor=1)
    slave.receive(scan.to_frame(), 0.0)
    (asked,) = slave.node.asked  # type: ignore[attr-defined]
    assert slave.bytes_to_send(0.1) == b""
    assert slave.next_timer() is None
    answers = [lidar.ScanResponse(node=3, value=value) for value in range(3)]
    assert slave.answer(asked, answers[:2], 0.2)
    slave.receive(lidar.ReadRequest(node=3).to_frame(), 0.3)  # which does not end them
    sent = [slave.bytes_to_send(0.4 + 0.1 * step) for step in range(4)]
    assert sent == [
        lidar.ReadResponse(node=3, value=77).to_frame(),
        *(a.to_frame() for a in answers[:2]),
        b"",
    ]
    slave.receive(lidar.StopRequest(node=3, sensor=2).to_frame(), 1.0)  # of another sensor
    assert slave.bytes_to_send(1.1) == lidar.StopResponse(node=3).to_frame()
    assert slave.answer(asked, answers[2], 1.2)
    assert slave.bytes_to_send(1.3) == answers[2].to_frame()
    slave.receive(lidar.StopRequest(node=3, sensor=1).to_frame(), 1.4)
    assert not slave.answer(asked, answers[2], 1.5)
    assert slave.bytes_to_send(1.6) == lidar.StopResponse(node=3).to_frame()
    assert slave.bytes_to_send(1.7) == b""


def test_two_requests_take_turns(lidar: ModuleType) -> None:
    slave = SlaveEngine(lidar, Lidar(lidar), baud=9600)
    slave.receive(lidar.ScanRequest(node=3, sensor=1).to_frame(), 0.0)
    slave.receive(lidar.WatchRequest(node=3).to_frame(), 0.1)
    sent = [lidar.decode_response(slave.bytes_to_send(1.0 + at)).NAME for at in range(4)]
    assert sent == ["scan.response", "watch.response"] * 2
    slave.receive(lidar.HaltRequest(node=3).to_frame(), 5.0)
    assert lidar.decode_response(slave.bytes_to_send(6.0)).NAME == "scan.response"
    assert lidar.decode_response(slave.bytes_to_send(7.0)).NAME == "scan.response"


def test_a_monitor_follows_them(lidar: ModuleType) -> None:
    monitor = Monitor(lidar, Timing.of(lidar, host_slack=SLACK))
    frames: list[tuple[float, Any]] = [
        (0.0, lidar.ScanRequest(node=3, sensor=1)),
        (0.01, lidar.ScanResponse(node=3, value=1)),
        (0.04, lidar.ScanResponse(node=3, value=2)),
        (0.05, lidar.ReadRequest(node=3)),
        (0.06, lidar.ScanResponse(node=3, value=3)),
        (0.063, lidar.ReadResponse(node=3, value=3)),
        (0.09, lidar.StopRequest(node=3, sensor=1)),
        (0.095, lidar.ScanResponse(node=3, value=4)),
        (0.1, lidar.StopResponse(node=3)),
        (1.0, lidar.WatchRequest(node=3)),
        (1.01, lidar.WatchResponse(node=3, value=6)),
        (1.02, lidar.HaltRequest(node=3)),
        (2.0, lidar.WatchRequest(node=3)),
        (2.01, lidar.WatchResponse(node=3, value=6)),
    ]
    for at, message in frames:
        monitor.receive(message.to_frame(), at)
    monitor.handle_timer(3.0)
    kinds = [type(event).__name__ for event in monitor.heard]
    first = ["Asked", *["Replied"] * 2, "Asked", "Replied", "Replied", "Asked", "Replied", "Replied"]
    assert kinds == [*first, "Asked", "Replied", "Asked", "Asked", "Replied", "Unanswered"]
    assert isinstance(monitor.heard[-1], Unanswered)
    assert monitor.next_timer() is None


def test_the_end_of_a_capture_is_not_silence(lidar: ModuleType) -> None:
    monitor = Monitor(lidar, Timing.of(lidar, host_slack=SLACK))
    monitor.receive(lidar.WatchRequest(node=3).to_frame(), 0.0)
    monitor.receive(lidar.WatchResponse(node=3, value=6).to_frame(), 0.01)
    monitor.finish(0.02)
    assert [type(event).__name__ for event in monitor.heard] == ["Asked", "Replied"]


def test_the_worst_case_is_that_of_the_first_answer(lidar: ModuleType) -> None:
    timing = Timing.of(lidar, host_slack=SLACK)
    assert timing.worst_case(lidar.COMMANDS["scan"]) <= timing.worst_case(lidar.COMMANDS["read"]) + 0.1


def test_answers_that_only_their_request_tells_apart() -> None:
    text = SCHEMA.replace("repeat: safe}", "repeat: safe, response: {id: 0x55}}", 1)
    text = text.replace("response: {value: u8}}\n", "response: {value: u16}}\n").replace(
        "response: {value: u8}, many: {until: stop", "response: {value: u24}, many: {until: stop"
    )
    protocol, faults = loads(text, "lidar.yaml")
    assert protocol is not None, faults
    codec = load_codec(protocol)
    engine = MasterEngine(codec, Timing.of(codec, host_slack=SLACK))
    first = codec.ScanResponse(node=3, value=1)
    stream = drive(engine, codec.ScanRequest(node=3, sensor=1), arrivals([first])).response
    between = [codec.ScanResponse(node=3, value=2), codec.ReadResponse(node=3, value=7)]
    engine.start(codec.ReadRequest(node=3), 0.02)
    assert engine.bytes_to_send(0.02)
    for at, message in enumerate(between):
        engine.receive(message.to_frame(), 0.028 + at / 500)
    assert engine.take().response == between[1]
    engine.receive(codec.ScanResponse(node=3, value=3).to_frame(), 0.04)
    assert [each.value for each in stream.answers] == [1, 2, 3]
    assert engine.total.strays == 0
