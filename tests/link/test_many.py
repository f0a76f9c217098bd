"""Several answers to one request."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.errors import NoReply, Refused
from qlinkgen.link import MasterEngine, Monitor, SlaveEngine, Timing
from qlinkgen.link.events import OtherAnswer
from qlinkgen.link.monitor import Unanswered
from qlinkgen.schema import loads
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import drive

SCHEMA = """\
qlinkgen: 1
protocol: {name: log, title: Log, revision: "1", source: Manual}
frame:
  parts:
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/modbus, over: [node, code, length, data]}
bus: {kind: master_slave, nodes: 1..9, broadcast: 0, baud: 9600, response_within: 10 ms}
enums: {more: {type: u8, values: {last: 0, follows: 1}}}
defaults: {addressing: node, repeat: safe}
replies:
  fault: {id: request.id + 0x80, fields: {}}
  end: {id: 0x70, fields: {}, means: done}
commands:
  pair: {id: 1, request: {}, response: {value: u8}, many: {count: 2}}
  some:
    id: 2
    request: {number: {type: u8, range: 1..4}}
    response: {value: u8}
    many: {count: request.number}
  list: {id: 3, request: {}, response: {more: more, value: u8}, many: {until: {more: last}}}
  dump: {id: 4, request: {}, response: {value: u8}, many: {until: end}}
  sync:
    id: 6
    request: {size: {type: u8, range: 1..3}, nodes: "u8[1..5]"}
    response: {data: "bytes[request.size]"}
    addressing: answered_broadcast
    many: {each: request.nodes}
  scan: {id: 5, request: {}, response: {value: u8}, addressing: answered_broadcast, many: {within: 200 ms}}
"""
SLACK = 0.002


@pytest.fixture(scope="module")
def log() -> ModuleType:
    protocol, faults = loads(SCHEMA, "log.yaml")
    assert protocol is not None, faults
    return load_codec(protocol)


@pytest.fixture
def engine(log: ModuleType) -> MasterEngine:
    return MasterEngine(log, Timing.of(log, host_slack=SLACK))


def values(response: Any) -> list[int]:
    return [each.value for each in response]


def arrivals(messages: list[Any], first: float = 0.015, step: float = 0.012) -> list[tuple[float, bytes]]:
    return [(first + step * number, message.to_frame()) for number, message in enumerate(messages)]


def test_a_number_of_answers(log: ModuleType, engine: MasterEngine) -> None:
    run = drive(
        engine, log.PairRequest(node=3), arrivals([log.PairResponse(node=3, value=v) for v in (7, 8)])
    )
    assert values(run.response) == [7, 8]
    assert (run.end, len(run.sent)) == (0.027, 1)
    assert [event.means for event in engine.events if isinstance(event, OtherAnswer)] == ["more"]
    assert engine.counters[3].answers == 1


@pytest.mark.parametrize("number", [1, 3, 4])
def test_a_number_that_the_request_says(log: ModuleType, engine: MasterEngine, number: int) -> None:
    sent = [log.SomeResponse(node=3, value=v) for v in range(number)]
    run = drive(engine, log.SomeRequest(node=3, number=number), arrivals(sent))
    assert values(run.response) == list(range(number))


def test_up_to_an_answer_that_says_so(log: ModuleType, engine: MasterEngine) -> None:
    sent = [log.ListResponse(node=3, more=more, value=v) for v, more in ((1, 1), (2, 1), (3, 0))]
    assert values(drive(engine, log.ListRequest(node=3), arrivals(sent)).response) == [1, 2, 3]


@pytest.mark.parametrize("number", [0, 2])
def test_up_to_a_reply_that_is_not_one_of_them(log: ModuleType, engine: MasterEngine, number: int) -> None:
    sent = [*(log.DumpResponse(node=3, value=v) for v in range(number)), log.End(node=3)]
    assert values(drive(engine, log.DumpRequest(node=3), arrivals(sent)).response) == list(range(number))


def test_all_that_come_in_a_time(log: ModuleType, engine: MasterEngine) -> None:
    sent = [log.ScanResponse(node=node, value=node) for node in (2, 5, 9)]
    run = drive(engine, log.ScanRequest(node=0), arrivals(sent, step=0.05))
    assert values(run.response) == [2, 5, 9]
    assert 0.2 < run.end < 0.25
    assert len(run.sent) == 1


def test_a_node_that_is_asked_alone_answers_once(log: ModuleType, engine: MasterEngine) -> None:
    run = drive(engine, log.ScanRequest(node=5), arrivals([log.ScanResponse(node=5, value=5)]))
    assert values(run.response) == [5]
    assert run.end < 0.02
    monitor = Monitor(log, engine.timing)
    monitor.receive(log.ScanRequest(node=5).to_frame(), 0.005)
    monitor.handle_timer(0.1)
    assert [type(event).__name__ for event in monitor.heard] == ["Asked", "Unanswered"]


def test_nobody_answers_in_the_time(log: ModuleType, engine: MasterEngine) -> None:
    assert isinstance(drive(engine, log.ScanRequest(node=0), attempts=1).error, NoReply)


def test_the_time_to_the_next_answer_is_that_to_the_first(log: ModuleType, engine: MasterEngine) -> None:
    one = arrivals([log.PairResponse(node=3, value=7)])
    both = arrivals([log.PairResponse(node=3, value=v) for v in (1, 2)], first=0.05)
    run = drive(engine, log.PairRequest(node=3), [*one, *both])
    assert values(run.response) == [1, 2]  # those of the repeat alone
    assert len(run.sent) == 2


def test_each_node_in_a_list_answers_in_any_order(log: ModuleType, engine: MasterEngine) -> None:
    answers = {node: log.SyncResponse(node=node, data=bytes([node, 0])) for node in (2, 5, 9, 7)}
    twice = [answers[9], answers[9], answers[7], answers[2], answers[5]]  # one too often, one of no such node
    request = log.SyncRequest(node=0, size=2, nodes=[2, 5, 9])
    run = drive(engine, request, arrivals(twice, step=0.004))
    assert run.response == {2: answers[2], 5: answers[5], 9: answers[9]}
    assert list(run.response) == [2, 5, 9]
    assert (len(run.sent), engine.total.strays) == (1, 2)


def test_a_repeat_asks_for_the_missing_ones_and_the_result_names_them(
    log: ModuleType, engine: MasterEngine
) -> None:
    answers = {node: log.SyncResponse(node=node, data=bytes([node])) for node in (2, 5)}
    request = log.SyncRequest(node=0, size=1, nodes=[2, 5, 9])
    again = drive(engine, request, [*arrivals([answers[5]]), *arrivals([answers[2]], first=0.1)], attempts=2)
    assert again.response == {2: answers[2], 5: answers[5], 9: None}
    assert len(again.sent) == 2
    silent = MasterEngine(log, engine.timing)
    assert isinstance(drive(silent, request, attempts=1).error, NoReply)


def test_slaves_answer_in_the_order_of_the_list(log: ModuleType) -> None:
    class Each:
        def __init__(self, number: int) -> None:
            self.number = number

        def handle(self, request: Any, now: float) -> Any:
            return log.SyncResponse(node=self.number, data=bytes([self.number, 0, 1]))

    wire = Wire(baud=9600)
    for number in range(1, 6):
        wire.attach(SlaveEngine(log, Each(number), baud=9600, turnaround=0.003), f"node {number}")
    master = BlockingMaster(MasterEngine(log, Timing.of(log, host_slack=SLACK)), VirtualPort(wire))
    found = master.transact(log.SyncRequest(node=0, size=3, nodes=[4, 1, 3, 8])).response
    assert [each and each.node for each in found.values()] == [4, 1, 3, None]
    assert wire.collisions == 0


def test_a_monitor_expects_an_answer_of_each_node(log: ModuleType) -> None:
    monitor = Monitor(log, Timing.of(log, host_slack=SLACK))
    monitor.receive(log.SyncRequest(node=0, size=1, nodes=[2, 5]).to_frame(), 0.01)
    for at, node in ((0.02, 5), (0.03, 5), (0.04, 2)):
        monitor.receive(log.SyncResponse(node=node, data=b"1").to_frame(), at)
    monitor.finish(3.0)
    kinds = [type(event).__name__ for event in monitor.heard]
    assert kinds == ["Asked", "Replied", "Stray", "Replied"]


def test_a_refusal_ends_them(log: ModuleType, engine: MasterEngine) -> None:
    sent = [log.PairResponse(node=3, value=7), log.PairFault(node=3)]
    assert isinstance(drive(engine, log.PairRequest(node=3), arrivals(sent)).error, Refused)


def test_the_worst_case(log: ModuleType, engine: MasterEngine) -> None:
    times = {name: engine.timing.worst_case(command) for name, command in log.COMMANDS.items()}
    assert times["pair"] < times["some"] < float("inf")
    assert times["list"] == times["dump"] == float("inf")
    assert times["scan"] > 0.6


class Node:
    number = 3

    def __init__(self, log: ModuleType) -> None:
        self._log = log

    def handle(self, request: Any, now: float) -> Any:
        log = self._log
        if type(request) is log.DumpRequest:
            return [*(log.DumpResponse(node=3, value=v) for v in (4, 5, 6)), log.End(node=3)]
        return [] if type(request) is log.PairRequest else None


def test_a_slave_sends_a_list(log: ModuleType) -> None:
    wire = Wire(baud=9600)
    wire.attach(SlaveEngine(log, Node(log), baud=9600, turnaround=0.003), "node 3")
    master = BlockingMaster(MasterEngine(log, Timing.of(log, host_slack=SLACK)), VirtualPort(wire))
    assert values(master.transact(log.DumpRequest(node=3)).response) == [4, 5, 6]
    with pytest.raises(NoReply):
        master.transact(log.PairRequest(node=3), attempts=1)


def test_another_request_ends_the_answers_of_a_slave(log: ModuleType) -> None:
    slave = SlaveEngine(log, Node(log), baud=9600)
    slave.receive(log.DumpRequest(node=3).to_frame(), 0.0)
    assert slave.bytes_to_send(0.1)
    slave.receive(log.PairRequest(node=3).to_frame(), 0.1)
    assert slave.bytes_to_send(9.9) == b""


def test_a_monitor_waits_for_the_last_one(log: ModuleType) -> None:
    monitor = Monitor(log, Timing.of(log, host_slack=SLACK))
    monitor.receive(log.PairRequest(node=3).to_frame(), 0.005)
    monitor.receive(log.PairResponse(node=3, value=1).to_frame(), 0.015)
    monitor.receive(log.PairRequest(node=3).to_frame(), 1.0)
    for now in (1.015, 1.03):
        monitor.receive(log.PairResponse(node=3, value=1).to_frame(), now)
    monitor.receive(log.ScanRequest(node=0).to_frame(), 2.0)
    for node in (4, 5):
        monitor.receive(log.ScanResponse(node=node, value=1).to_frame(), 2.0 + node / 50)
    monitor.finish(3.0)
    kinds = [type(event).__name__ for event in monitor.heard]
    assert kinds == ["Asked", "Replied", "Unanswered", *["Asked", "Replied", "Replied"] * 2]
    assert isinstance(monitor.heard[2], Unanswered)
