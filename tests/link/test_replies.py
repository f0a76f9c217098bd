"""Answers other than the response: refusals, and those that ask for a repeat or for patience."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.cli.decode import message_record
from qlinkgen.errors import BadReply, NoReply, Refused
from qlinkgen.link import PENDING, HealthPolicy, MasterEngine, Monitor, Refusal, SlaveEngine, Timing
from qlinkgen.link.events import Damaged, Failed, OtherAnswer, Stray
from qlinkgen.link.monitor import Replied, Unanswered
from qlinkgen.schema import loads
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.sim.generic import GenericNode
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import Arrivals, Run, drive

SCHEMA = """\
qlinkgen: 1
protocol: {name: pump, title: Pump, revision: "1", source: Manual}
enums:
  reason: {type: u8, values: {wrong: 1, busy: 2, wait: 3, nothing: 4}}
frame:
  parts:
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/modbus, over: [node, code, data]}
bus: {kind: master_slave, nodes: 1..9, baud: 9600, response_within: 10 ms}
defaults: {addressing: node, repeat: unsafe}
replies:
  fault:
    id: request.id + 0x80
    fields: {number: {type: u8, echo: true}, reason: reason}
    means: {switch: reason, cases: {busy: again, wait: pending, nothing: done}}
    within: 500 ms
    after: 50 ms
  nak: {id: 0x7F, fields: {}}
commands:
  read:
    id: 0x10
    request: {number: u8}
    response: {id: request.id + 0x40, fields: {number: {type: u8, echo: true}, value: u16}}
  set: {id: 0x11, request: {number: u8, value: u16}, response: {}, repeat: safe}
"""
BAUD = 9600
BYTE = 10 / BAUD
SLACK = 0.002


@pytest.fixture(scope="module")
def pump() -> ModuleType:
    protocol, faults = loads(SCHEMA, "pump.yaml")
    assert protocol is not None, faults
    return load_codec(protocol)


@pytest.fixture
def engine(pump: ModuleType) -> MasterEngine:
    return MasterEngine(pump, Timing.of(pump, host_slack=SLACK, attempts=3), health=HealthPolicy())


def ask(pump: ModuleType, number: int = 5) -> Any:
    return pump.ReadRequest(node=3, number=number)


def fault(pump: ModuleType, reason: int, number: int = 5, node: int = 3) -> bytes:
    frame: bytes = pump.ReadFault(node=node, number=number, reason=reason).to_frame()
    return frame


def answer(pump: ModuleType, value: int = 7) -> bytes:
    frame: bytes = pump.ReadResponse(node=3, number=5, value=value).to_frame()
    return frame


def run(engine: MasterEngine, request: Any, *arrivals: tuple[float, bytes], **options: Any) -> Run:
    found: Arrivals = arrivals
    return drive(engine, request, found, **options)


class TestRefused:
    def test_the_call_fails_at_once_with_the_decoded_reason(
        self, pump: ModuleType, engine: MasterEngine
    ) -> None:
        outcome = run(engine, ask(pump), (0.012, fault(pump, 1)))
        assert isinstance(outcome.error, Refused)
        assert (outcome.end, len(outcome.sent)) == (0.012, 1)
        assert outcome.error.reason == "number 5, reason wrong"
        assert outcome.error.reply == pump.ReadFault(node=3, number=5, reason=1)
        assert outcome.error.request == ask(pump)
        assert (outcome.error.node, outcome.error.attempts) == (3, 1)
        assert str(outcome.error) == "read.request: refused by node 3: number 5, reason wrong; 12.0 ms"

    def test_it_is_an_answer_of_a_node_that_is_well(self, pump: ModuleType, engine: MasterEngine) -> None:
        for _ in range(5):
            run(engine, ask(pump), (0.012, fault(pump, 1)))
        count = engine.counters[3]
        assert (count.answers, count.refusals, count.failures, count.timeouts) == (5, 5, 0, 0)
        assert engine.health.offline(3) is None

    def test_events(self, pump: ModuleType, engine: MasterEngine) -> None:
        engine.verbose = False
        outcome = run(engine, ask(pump), (0.012, fault(pump, 1)))
        reply = pump.ReadFault(node=3, number=5, reason=1)
        assert list(engine.events) == [
            OtherAnswer(0.012, 3, ask(pump), reply, "refused", 1),
            Failed(0.012, 3, ask(pump), outcome.error or ValueError()),
        ]

    def test_one_reply_for_all_commands(self, pump: ModuleType, engine: MasterEngine) -> None:
        nak = pump.Nak(node=3).to_frame()
        for request in (ask(pump), pump.SetRequest(node=3, number=1, value=2)):
            error = run(engine, request, (0.012, nak)).error
            assert isinstance(error, Refused)
            assert error.reason == "nak"

    @pytest.mark.parametrize("wrong", [{"node": 4}, {"number": 6}])
    def test_of_another_node_or_request(
        self, pump: ModuleType, engine: MasterEngine, wrong: dict[str, int]
    ) -> None:
        outcome = run(engine, ask(pump), (0.012, fault(pump, 1, **wrong)))
        assert isinstance(outcome.error, NoReply if "node" in wrong else BadReply)
        assert any(isinstance(event, Stray) for event in engine.events)

    def test_late(self, pump: ModuleType, engine: MasterEngine) -> None:
        run(engine, ask(pump))
        now = engine._deadline
        outcome = run(engine, ask(pump), (now + 0.001, fault(pump, 1)), (now + 0.03, answer(pump)), now=now)
        assert outcome.response.value == 7
        assert engine.counters[3].late == 1


class TestAgain:
    def test_the_request_is_sent_again_after_the_pause_even_if_unsafe(
        self, pump: ModuleType, engine: MasterEngine
    ) -> None:
        outcome = run(engine, ask(pump), (0.012, fault(pump, 2)), (0.08, answer(pump)))
        assert outcome.response.value == 7
        assert [at for at, _ in outcome.sent] == pytest.approx([0.0, 0.062])
        assert outcome.reply is not None
        assert outcome.reply.attempts == 2

    def test_but_not_for_ever(self, pump: ModuleType, engine: MasterEngine) -> None:
        busy = [(0.012 + 0.065 * number, fault(pump, 2)) for number in range(4)]
        outcome = run(engine, ask(pump), *busy)
        assert isinstance(outcome.error, Refused)
        assert (outcome.error.attempts, len(outcome.sent)) == (3, 3)
        assert run(engine, ask(pump), (10.012, fault(pump, 2)), now=10.0, attempts=1).error is not None


class TestPending:
    def test_the_master_waits_on(self, pump: ModuleType, engine: MasterEngine) -> None:
        outcome = run(engine, ask(pump), (0.012, fault(pump, 3)), (0.4, answer(pump)))
        assert outcome.response.value == 7
        assert (outcome.end, len(outcome.sent)) == (0.4, 1)

    def test_but_not_longer_for_more_of_them(self, pump: ModuleType, engine: MasterEngine) -> None:
        waits = [(0.012 + 0.1 * number, fault(pump, 3)) for number in range(20)]
        outcome = run(engine, ask(pump), *waits)
        assert isinstance(outcome.error, NoReply)
        assert outcome.end == pytest.approx(0.512 + 7 * BYTE + SLACK)

    def test_a_refusal_may_follow(self, pump: ModuleType, engine: MasterEngine) -> None:
        outcome = run(engine, ask(pump), (0.012, fault(pump, 3)), (0.4, fault(pump, 1)))
        assert isinstance(outcome.error, Refused)


def test_done_is_an_answer_of_another_form(pump: ModuleType, engine: MasterEngine) -> None:
    outcome = run(engine, ask(pump), (0.012, fault(pump, 4)))
    assert outcome.response == pump.ReadFault(node=3, number=5, reason=4)


@pytest.mark.parametrize("form", ["response", "defaults"])
def test_a_response_refuses_by_one_of_its_fields(form: str) -> None:
    means = "means: {switch: reason, cases: {busy: again, 1: refused}}"
    fields = "fields: {reason: reason, value: u16}"
    text = SCHEMA.replace(
        "id: request.id + 0x40, fields: {number: {type: u8, echo: true}, value: u16}",
        f"{fields}, {means}" if form == "response" else fields,
    )
    if form == "defaults":
        text = text.replace("repeat: unsafe}", f"repeat: unsafe, response: {{{means}}}}}")
        text = text.replace("response: {}", "response: {means: done, fields: {}}")
    protocol, faults = loads(text, "pump.yaml")
    assert protocol is not None, faults
    pump = load_codec(protocol)
    engine = MasterEngine(pump, Timing.of(pump, host_slack=SLACK))

    def told(reason: int) -> bytes:
        frame: bytes = pump.ReadResponse(node=3, reason=reason, value=7).to_frame()
        return frame

    error = run(engine, ask(pump), (0.012, told(1))).error
    assert isinstance(error, Refused)
    assert (error.reason, type(error.reply)) == ("wrong", pump.ReadResponse)
    again = run(engine, ask(pump), (1.012, told(2)), (1.03, told(0)), now=1.0)
    assert again.response.value == 7
    assert len(again.sent) == 2
    set_response = pump.SetResponse(node=3).to_frame()
    assert run(engine, pump.SetRequest(node=3), (2.012, set_response), now=2.0).reply is not None


def test_the_worst_case_has_room_for_patience_and_repeats(pump: ModuleType, engine: MasterEngine) -> None:
    command = pump.COMMANDS["read"]
    worst = engine.timing.worst_case(command)
    replies: list[Callable[[int], bytes]] = [lambda _: fault(pump, 3), lambda _: fault(pump, 2)]
    arrivals = []
    for number in range(3):
        begun = 0.6 * number
        arrivals += [(begun + 0.012 + 0.05 * (number > 0), replies[0](0)), (begun + 0.5, replies[1](0))]
    assert run(engine, ask(pump), *arrivals).end <= worst
    assert worst > 3 * 0.55


class Handlers:
    """A slave whose answers depend on the number in the request."""

    number = 3

    def __init__(self, pump: ModuleType) -> None:
        self._pump = pump
        self.later: list[Any] = []

    def handle(self, request: Any, now: float) -> Any:
        pump = self._pump
        if request.number == 1:
            return pump.ReadFault(node=3, number=1, reason=1)
        if request.number == 2:
            raise Refusal(pump.Nak(node=3))
        if request.number == 4:
            self.later.append(request)
            return PENDING
        if request.number == 3:
            self.later.append(request)
            return pump.ReadFault(node=3, number=3, reason=3)
        return pump.ReadResponse(node=3, number=request.number, value=int(now * 1000))


def test_a_slave_refuses_by_returning_or_raising(pump: ModuleType) -> None:
    wire = Wire(baud=BAUD)
    wire.attach(SlaveEngine(pump, Handlers(pump), baud=BAUD), "node 3")
    port = VirtualPort(wire)
    master = BlockingMaster(MasterEngine(pump, Timing.of(pump, host_slack=SLACK)), port)
    for number, name in ((1, "read.fault"), (2, "nak")):
        with pytest.raises(Refused) as caught:
            master.transact(ask(pump, number))
        reply: Any = caught.value.reply
        assert name == reply.NAME
    assert master.transact(ask(pump, 9)).response.number == 9


def test_a_slave_sends_nothing_before_it_answers(pump: ModuleType) -> None:
    node = Handlers(pump)
    slave = SlaveEngine(pump, node, baud=BAUD)
    slave.receive(ask(pump, 4).to_frame(), 0.0)
    assert slave.bytes_to_send(1.0) == b""
    late = pump.ReadResponse(node=3, number=4, value=1)
    slave.answer(node.later[0], late, 1.0)
    assert slave.bytes_to_send(1.0) == late.to_frame()


def test_a_slave_answers_later(pump: ModuleType) -> None:
    node = Handlers(pump)
    slave = SlaveEngine(pump, node, baud=BAUD)
    slave.receive(ask(pump, 3).to_frame(), 0.0)
    assert slave.bytes_to_send(0.0) == fault(pump, 3, number=3)
    late = pump.ReadResponse(node=3, number=3, value=1)
    slave.answer(node.later[0], late, 0.3)
    assert slave.bytes_to_send(0.3) == late.to_frame()
    slave.receive(ask(pump, 9).to_frame(), 0.4)
    slave.bytes_to_send(1.0)
    slave.answer(node.later[0], late, 1.1)
    assert slave.bytes_to_send(2.0) == b""
    assert slave.counters.replaced == 1


def test_a_monitor_knows_replies(pump: ModuleType) -> None:
    monitor = Monitor(pump, Timing.of(pump, host_slack=SLACK))
    monitor.receive(ask(pump).to_frame(), 0.006)
    monitor.receive(fault(pump, 3), 0.02)
    monitor.receive(answer(pump), 0.4)
    monitor.receive(ask(pump).to_frame(), 0.5)
    monitor.receive(fault(pump, 1), 0.51)
    monitor.finish(2.0)
    replied = [event.response for event in monitor.heard if isinstance(event, Replied)]
    assert [type(each).NAME for each in replied] == ["read.fault", "read.response", "read.fault"]
    assert not [event for event in monitor.heard if isinstance(event, Unanswered)]


SIZED = """\
qlinkgen: 1
protocol: {name: log, title: Log, revision: "1", source: Manual}
frame:
  parts:
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/modbus, over: [node, code, length, data]}
bus: {kind: master_slave, nodes: 1..9, baud: 9600, response_within: 10 ms}
defaults: {addressing: node, repeat: safe}
commands:
  read: {id: 1, request: {many: {type: u8, range: 0..4, default: 1}}, response: {values: "u16[request.many]"}}
"""


@pytest.fixture(scope="module")
def log() -> ModuleType:
    protocol, faults = loads(SIZED, "log.yaml")
    assert protocol is not None, faults
    return load_codec(protocol)


def test_an_answer_of_another_size_than_asked_for_is_wrong(log: ModuleType) -> None:
    engine = MasterEngine(log, Timing.of(log, host_slack=SLACK))
    answers = [log.ReadResponse(node=3, values=[7] * many).to_frame() for many in (3, 2)]
    assert run(engine, log.ReadRequest(node=3, many=2), (0.012, answers[1])).response.values == [7, 7]
    outcome = run(engine, log.ReadRequest(node=3, many=2), (1.012, answers[0]), now=1.0, attempts=1)
    assert isinstance(outcome.error, BadReply)


def test_a_slave_is_held_to_the_size(log: ModuleType) -> None:
    class Node:
        number = 3

        def handle(self, request: Any, now: float) -> Any:
            return log.ReadResponse(node=3, values=[1, 2])

    slave = SlaveEngine(log, Node(), baud=9600)
    slave.receive(log.ReadRequest(node=3, many=2).to_frame(), 0.0)
    assert slave.bytes_to_send(1.0)
    with pytest.raises(ValueError, match=r"values has 2 items; many of the request asks for 3"):
        slave.receive(log.ReadRequest(node=3, many=3).to_frame(), 2.0)


ROWS = SIZED.replace(
    'response: {values: "u16[request.many]"}',
    "response: {size: {type: u8, counts: bits, counts_in: bytes}, "
    'bits: {type: "bool[request.many]", packed: least}}',
).replace("0..4", "0..20")


@pytest.fixture(scope="module")
def rows() -> ModuleType:
    protocol, faults = loads(ROWS, "log.yaml")
    assert protocol is not None, faults
    return load_codec(protocol)


#: Three of 16 bits of the answer to a request for eleven are set, the last of them beyond those asked for.
ASKED, SENT = 11, [True, *[False] * 9, True, *[False] * 4, True]


def test_a_master_cuts_a_row_of_bits_to_the_number_asked_for(rows: ModuleType) -> None:
    sent = rows.ReadResponse(node=3, bits=SENT).to_frame()
    engine = MasterEngine(rows, Timing.of(rows, host_slack=SLACK))
    answer = run(engine, rows.ReadRequest(node=3, many=ASKED), (0.012, sent))
    assert answer.response.bits == SENT[:ASKED]


@pytest.mark.parametrize("number", [0, 8, 17])
def test_a_row_of_other_bytes_is_no_answer(rows: ModuleType, number: int) -> None:
    engine = MasterEngine(rows, Timing.of(rows, host_slack=SLACK))
    sent = rows.ReadResponse(node=3, bits=[True] * number).to_frame()
    outcome = run(engine, rows.ReadRequest(node=3, many=ASKED), (0.012, sent), attempts=1)
    assert isinstance(outcome.error, BadReply)
    assert "invalid replies (length)" in str(outcome.error)
    [damaged] = [event for event in engine.events if isinstance(event, Damaged)]
    assert damaged.fault.kind == "length"
    assert "many of the request asks for 11" in damaged.fault.message


def test_a_monitor_cuts_a_row_if_it_has_seen_the_request(rows: ModuleType) -> None:
    sent = rows.ReadResponse(node=3, bits=SENT).to_frame()
    for seen, bits in ((True, SENT[:ASKED]), (False, SENT)):
        monitor = Monitor(rows, Timing.of(rows, host_slack=SLACK))
        if seen:
            monitor.receive(rows.ReadRequest(node=3, many=ASKED).to_frame(), 0.0)
        monitor.receive(sent, 0.01)
        heard: Any = monitor.heard[-1]
        assert (heard.response if seen else heard.message).bits == bits


def test_a_slave_packs_the_number_asked_for(rows: ModuleType) -> None:
    class Node:
        number = 3

        def handle(self, request: Any, now: float) -> Any:
            return rows.ReadResponse(node=3, bits=SENT[:ASKED])

    slave = SlaveEngine(rows, Node(), baud=9600)
    slave.receive(rows.ReadRequest(node=3, many=ASKED).to_frame(), 0.0)
    assert slave.bytes_to_send(1.0)[3:6] == bytes([2, 0x01, 0x04])
    with pytest.raises(ValueError, match=r"bits has 11 items; many of the request asks for 16"):
        slave.receive(rows.ReadRequest(node=3, many=16).to_frame(), 2.0)


def test_a_simulated_node_answers_with_a_row(rows: ModuleType) -> None:
    made = GenericNode(rows, 3).handle(rows.ReadRequest(node=3, many=3), 0.0)
    assert made == rows.ReadResponse(node=3, bits=[False] * 3)


def test_a_simulated_node_answers_with_the_size(log: ModuleType) -> None:
    node = GenericNode(log, 3)
    assert node.handle(log.ReadRequest(node=3, many=3), 0.0) == log.ReadResponse(node=3, values=[0, 0, 0])


def test_commands_that_share_a_response() -> None:
    commands = """\
  read: {id: 1, request: {}, response: {value: u16}}
  set: {id: 2, request: {value: u16}, response: ack}
  reset: {id: 3, request: {}, response: ack, addressing: node}
messages:
  ack: {id: 6, direction: response, fields: {state: u8}, means: {switch: state, cases: {1: refused}}}
"""
    text = SIZED[: SIZED.index("  read:")] + commands
    protocol, faults = loads(text, "log.yaml")
    assert protocol is not None, faults
    codec = load_codec(protocol)
    assert [message.name for message in protocol.messages][-1] == "ack"
    engine = MasterEngine(codec, Timing.of(codec, host_slack=SLACK))
    ack = codec.Ack(node=3, state=9)
    for at, request in enumerate((codec.SetRequest(node=3, value=1), codec.ResetRequest(node=3))):
        assert run(engine, request, (at + 0.012, ack.to_frame()), now=float(at)).response == ack
    refusal = codec.Ack(node=3, state=1).to_frame()
    refused = run(engine, codec.ResetRequest(node=3), (3.012, refusal), now=3.0)
    assert isinstance(refused.error, Refused)
    assert refused.error.reason == "1"
    wrong = run(engine, codec.ReadRequest(node=3), (5.012, ack.to_frame()), now=5.0, attempts=1)
    assert isinstance(wrong.error, NoReply)


STATUS = """\
qlinkgen: 1
protocol: {name: servo, title: Servo, revision: "1", source: Manual}
enums: {error: {type: u8, values: {none: 0, range: 1, busy: 2}}}
frame:
  parts:
    start: FF FD
    node: {role: address, type: u8}
    length: {type: u8, counts: [data]}
    code: {role: message, type: u8}
    status: {type: u8, bits: {alert: 7, error: {at: 0..6, type: error}}}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/modbus, over: [node, length, code, status, data]}
bus: {kind: master_slave, nodes: 1..9, baud: 9600, response_within: 10 ms}
defaults:
  addressing: node
  repeat: safe
  response: {means: {switch: error, cases: {none: done, busy: again}, default: refused}}
commands:
  read: {id: 1, request: {}, response: {value: u16}}
"""


def test_a_value_of_the_frame_refuses() -> None:
    protocol, faults = loads(STATUS, "servo.yaml")
    assert protocol is not None, faults
    codec = load_codec(protocol)
    engine = MasterEngine(codec, Timing.of(codec, host_slack=SLACK))

    def told(error: int) -> bytes:
        frame: bytes = codec.ReadResponse(node=3, error=error, value=7, alert=True).to_frame()
        return frame

    request = codec.ReadRequest(node=3)
    assert run(engine, request, (0.02, told(0))).response.value == 7
    refused = run(engine, request, (1.02, told(2)), (1.04, told(1)), now=1.0)
    assert isinstance(refused.error, Refused)
    assert (refused.error.reason, refused.error.attempts) == ("range", 2)
    record = message_record(protocol, refused.error.reply)  # type: ignore[arg-type]
    assert record["refused"] is True
