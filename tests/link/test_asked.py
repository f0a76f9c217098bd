"""Answers that only their request tells apart: they have one number."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.streams import open_stream
from qlinkgen.errors import BadReply, Refused
from qlinkgen.link import MasterEngine, Monitor, SlaveEngine, Timing
from qlinkgen.link.events import Damaged, Stray
from qlinkgen.link.monitor import Replied
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.dissect import dissect
from qlinkgen.schema import loads
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.sim.generic import GenericNode
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import Arrivals, Run, drive

SCHEMA = """\
qlinkgen: 1
protocol: {name: servo, title: Servo, revision: "1", source: Manual}
byteorder: little
frame:
  parts:
    start: FF FD
    node: {role: address, type: u8}
    length: {type: u8, counts: [data]}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..16}
    crc: {type: u16, algorithm: crc-16/umts, over: [node, length, code, data]}
bus: {kind: master_slave, nodes: 1..9, broadcast: 254, baud: 9600, response_within: 10 ms}
defaults: {addressing: node, repeat: unsafe, response: {id: 0x55}}
replies: {failed: {id: 0x55, fields: {error: {type: u8, range: 1..7, default: 1}}}}
commands:
  ping: {id: 1, request: {}, response: {status: {type: u8, const: 0}, model: u16}}
  read:
    id: 2
    request: {start: u8, size: {type: u8, range: 1..8}}
    response: {status: {type: u8, const: 0}, data: "bytes[request.size]"}
  write: {id: 3, addressing: either, request: {start: u8}, response: {status: {type: u8, const: 0}}}
"""
BYTE = 10 / 9600
SLACK = 0.002


@pytest.fixture(scope="module")
def protocol() -> Protocol:
    found, faults = loads(SCHEMA, "servo.yaml")
    assert found is not None, faults
    return found


@pytest.fixture(scope="module")
def servo(protocol: Protocol) -> ModuleType:
    return load_codec(protocol)


@pytest.fixture
def engine(servo: ModuleType) -> MasterEngine:
    return MasterEngine(servo, Timing.of(servo, host_slack=SLACK, attempts=2))


def run(servo: ModuleType, engine: MasterEngine, request: Any, *answers: bytes) -> Run:
    first = len(servo.encode(request)) * BYTE + 0.005
    arrivals: Arrivals = [(first + 0.001 * number, data) for number, data in enumerate(answers)]
    return drive(engine, request, arrivals)


def test_a_decoder_alone_gives_the_bytes_of_an_answer(servo: ModuleType) -> None:
    wire = servo.ReadResponse(node=3, data=b"\x07\x08").to_frame()
    decoder = servo.StreamDecoder("response")
    assert decoder.feed(wire) == [servo.Unasked(node=3, data=b"\0\x07\x08")]
    assert servo.decode_response(wire) == servo.Unasked(node=3, data=b"\0\x07\x08")


def test_the_request_tells_the_answer(servo: ModuleType) -> None:
    ask, wire = (
        servo.ReadRequest(node=3, start=1, size=2),
        servo.ReadResponse(node=3, data=b"\x07\x08").to_frame(),
    )
    assert servo.decode_response(wire, ask) == servo.ReadResponse(node=3, data=b"\x07\x08")
    assert servo.decode_response(wire, servo.PingRequest(node=3)) == servo.PingResponse(node=3, model=0x0807)
    refusal = servo.Failed(node=3, error=4)
    assert servo.answer_to(ask, servo.decode_response(refusal.to_frame())) == refusal
    with pytest.raises(servo.DecodeError, match=r"write\.response") as caught:
        servo.decode_response(wire, servo.WriteRequest(node=3, start=0))
    assert caught.value.kind == "length"


def test_a_master_decodes_by_its_request(servo: ModuleType, engine: MasterEngine) -> None:
    ask = servo.ReadRequest(node=3, start=1, size=2)
    answer = servo.ReadResponse(node=3, data=b"\x07\x08")
    done = run(servo, engine, ask, answer.to_frame())
    assert done.reply is not None
    assert done.reply.response == answer


def test_a_master_takes_no_answer_of_another_form(servo: ModuleType, engine: MasterEngine) -> None:
    ask = servo.WriteRequest(node=3, start=1)
    wrong = servo.ReadResponse(node=3, data=b"\x07\x08").to_frame()
    done = run(servo, engine, ask, wrong)
    assert isinstance(done.error, BadReply)
    [damaged] = [event for event in engine.events if isinstance(event, Damaged)]
    assert (damaged.fault.kind, damaged.fault.raw) == ("length", wrong)


def test_a_master_does_not_take_the_answer_of_another_node(servo: ModuleType, engine: MasterEngine) -> None:
    ask = servo.WriteRequest(node=3, start=1)
    other, own = servo.WriteResponse(node=4).to_frame(), servo.WriteResponse(node=3).to_frame()
    done = run(servo, engine, ask, other, own)
    assert done.reply is not None
    [stray] = [event for event in engine.events if isinstance(event, Stray)]
    assert stray.message == servo.Unasked(node=4, data=b"\0")


def test_a_reply_with_the_number_refuses(servo: ModuleType, engine: MasterEngine) -> None:
    ask = servo.ReadRequest(node=3, start=1, size=2)
    done = run(servo, engine, ask, servo.Failed(node=3, error=4).to_frame())
    assert isinstance(done.error, Refused)
    assert done.error.reason == "4"


def test_a_monitor_pairs_answers_with_requests(servo: ModuleType) -> None:
    monitor = Monitor(servo, Timing.of(servo, host_slack=SLACK))
    ask, answer = servo.ReadRequest(node=3, start=1, size=2), servo.ReadResponse(node=3, data=b"\x07\x08")
    monitor.receive(answer.to_frame(), 0.0)
    monitor.receive(ask.to_frame(), 1.0)
    monitor.receive(answer.to_frame(), 1.01)
    stray, _, replied = monitor.heard
    assert isinstance(stray, Stray)
    assert stray.message == servo.Unasked(node=3, data=b"\0\x07\x08")
    assert isinstance(replied, Replied)
    assert replied.response == answer


def test_a_simulated_slave_is_understood(servo: ModuleType) -> None:
    wire = Wire(baud=9600)
    wire.attach(SlaveEngine(servo, GenericNode(servo, 3)))
    master = BlockingMaster(MasterEngine(servo, Timing.of(servo, host_slack=SLACK)), VirtualPort(wire))
    reply = master.transact(servo.ReadRequest(node=3, start=0, size=4))
    assert reply.response == servo.ReadResponse(node=3, data=bytes(4))


def test_a_stream_of_both_directions_is_told(protocol: Protocol, servo: ModuleType) -> None:
    ask, answer = servo.ReadRequest(node=3, start=1, size=2), servo.ReadResponse(node=3, data=b"\x07\x08")
    stream = open_stream(protocol, servo, None)
    before, _, after = stream.feed(answer.to_frame() + ask.to_frame() + answer.to_frame())
    assert after == answer
    assert message_record(protocol, before) == {  # type: ignore[arg-type]
        "message": "unasked",
        "node": 3,
        "fields": {"data": "000708"},
        "request_seen": False,
    }


def test_an_explanation_names_the_answer(protocol: Protocol, servo: ModuleType) -> None:
    plan, wire = plan_of(protocol), servo.ReadResponse(node=3, data=b"\x07\x08").to_frame()
    ask = servo.ReadRequest(node=3, start=1, size=2).to_frame()
    found = dissect(plan, wire, "response", ask)
    assert found.message is plan.message("read.response")
    assert not found.kind
    found = dissect(plan, wire, "response", servo.WriteRequest(node=3, start=0).to_frame())
    assert found.message is plan.message("write.response")
    assert found.kind == "length"
