"""Answers in frames of another kind than their requests, some of them without an address."""

from __future__ import annotations

from types import ModuleType

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.errors import Refused
from qlinkgen.link import MasterEngine, Monitor, SlaveEngine, Timing
from qlinkgen.link.monitor import Asked, Replied
from qlinkgen.schema import find, load
from qlinkgen.schema.loader import loads
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.sim.generic import GenericNode
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import drive

SLACK = 0.002


@pytest.fixture(scope="module")
def mbus() -> ModuleType:
    return load_codec(load(find("mbus")))


def bus(mbus: ModuleType) -> BlockingMaster:
    wire = Wire(baud=2400)
    wire.attach(SlaveEngine(mbus, GenericNode(mbus, 3), turnaround=3 * wire.byte_time), "node 3")
    return BlockingMaster(MasterEngine(mbus, Timing.of(mbus, host_slack=SLACK)), VirtualPort(wire))


def test_a_master_takes_answers_of_each_kind(mbus: ModuleType) -> None:
    master = bus(mbus)
    assert master.transact(mbus.InitialiseRequest(node=3)).response == mbus.Ack()
    assert master.transact(mbus.ReadRequest(node=3)).response.node == 3


def test_an_answer_without_an_address_is_that_of_the_node_asked(mbus: ModuleType) -> None:
    engine = MasterEngine(mbus, Timing.of(mbus, host_slack=SLACK))
    run = drive(engine, mbus.InitialiseRequest(node=7), [(0.05, b"\xe5")])
    assert run.response == mbus.Ack()
    wrong = drive(engine, mbus.ReadRequest(node=7), [(1.05, b"\xe5")], 1.0, attempts=1)
    assert wrong.error is not None


def test_a_monitor_pairs_them(mbus: ModuleType) -> None:
    monitor = Monitor(mbus, Timing.of(mbus, host_slack=SLACK))
    monitor.receive(mbus.InitialiseRequest(node=7).to_frame(), 0.0)
    monitor.receive(b"\xe5", 0.05)
    asked, replied = monitor.heard
    assert isinstance(asked, Asked)
    assert isinstance(replied, Replied)
    assert replied.response == mbus.Ack()


COUNTED = """
qlinkgen: 1
protocol: {name: counted, revision: "1", source: Made up}
byteorder: big
attributes: {salt: {type: u8}}
frames:
  ask:
    parts:
      start: 10
      code: {role: message, type: u8}
      control: {type: u8, bits: {urgent: 0, turn: {at: 5, role: counter}}}
      sum: {type: u8, algorithm: sum8, over: [code, control, attribute.salt]}
  tell:
    parts:
      start: 68
      code: {role: message, type: u8}
      level: {type: i8, scale: 1/2}
      data: {role: payload, size: 0..8}
      sum: {type: u8, algorithm: sum8, over: [code, level, data, attribute.salt]}
  taken: {parts: {byte: E5}}
bus: {kind: master_slave, baud: 9600}
defaults: {frame: ask, repeat: safe, attributes: {salt: 3}}
messages: {taken: {frame: taken, direction: response, attributes: {salt: 0}, fields: {}}}
commands:
  begin: {id: 1, request: {}, response: taken}
  read: {id: 2, attributes: {salt: 4}, request: {}, response: {frame: tell, id: 9, fields: {value: u16}}}
"""


def test_requests_are_numbered_in_the_kinds_that_have_a_counter() -> None:
    protocol, faults = loads(COUNTED, "counted.yaml")
    assert protocol is not None, faults
    counted = load_codec(protocol)
    wire = Wire(baud=9600)
    wire.attach(SlaveEngine(counted, GenericNode(counted, 0), turnaround=0.001), "node")
    master = BlockingMaster(MasterEngine(counted, Timing.of(counted, host_slack=SLACK)), VirtualPort(wire))
    requests = [counted.BeginRequest(urgent=True), counted.BeginRequest(), counted.ReadRequest()]
    answers = [master.transact(each).response for each in requests]
    assert [each.turn for each in requests] == [0, 1, 0]
    assert answers[0] == counted.Taken()
    assert answers[2].level == 0
    wire_bytes = counted.ReadResponse(level=-1.5, value=258).to_frame()
    assert wire_bytes == bytes.fromhex("68 09 FD 01 02 0D")
    assert counted.decode_response(wire_bytes) == counted.ReadResponse(level=-1.5, value=258)


def test_another_crc_replaces_those_of_all_kinds() -> None:
    vesc, other = load_codec(load(find("vesc"))), load_codec(load(find("vesc"), crc="crc-16/modbus"))
    codec = vesc.Codec("crc-16/modbus")
    for size in (53, 300):
        payload = bytes(range(256)) * 2
        wire = codec.encode(vesc.GetValuesResponse.from_bytes(payload[:size]))
        assert wire == other.GetValuesResponse.from_bytes(payload[:size]).to_frame()
        assert codec.decode_response(wire).to_bytes() == payload[:size]
        assert [each.to_bytes() for each in codec.StreamDecoder("response").feed(wire)] == [payload[:size]]
        with pytest.raises(vesc.DecodeError, match="received checksum"):
            vesc.decode_response(wire)


REFUSING = """
qlinkgen: 1
protocol: {name: refusing, revision: "1", source: Made up}
byteorder: big
frames:
  ask: {parts: {start: 10, code: {role: message, type: u8}, sum: {type: u8, algorithm: sum8, over: [code]}}}
  ack: {parts: {byte: 79}}
  nack: {parts: {byte: 1F}}
bus: {kind: master_slave, baud: 9600, response_within: 50 ms}
defaults: {frame: ask, repeat: safe}
messages: {ack: {frame: ack, direction: response, fields: {}}}
replies: {nack: {frame: nack, fields: {}}}
commands: {begin: {id: 1, request: {}, response: ack}, end: {id: 2, request: {}, response: ack}}
"""


def test_a_byte_refuses_every_command() -> None:
    protocol, faults = loads(REFUSING, "refusing.yaml")
    assert protocol is not None, faults
    codec = load_codec(protocol)
    for request in (codec.BeginRequest(), codec.EndRequest()):
        engine = MasterEngine(codec, Timing.of(codec, host_slack=SLACK))
        assert drive(engine, request, [(0.02, b"\x79")]).response == codec.Ack()
        refused = drive(MasterEngine(codec, Timing.of(codec, host_slack=SLACK)), request, [(0.02, b"\x1f")])
        assert isinstance(refused.error, Refused)
        assert refused.error.reply == codec.Nack()


PARTED = """
qlinkgen: 1
protocol: {name: parted, revision: "1", source: Made up}
byteorder: big
frames:
  short:
    parts:
      start: 10
      code: {role: message, type: u8}
      node: {role: address, type: u8}
      state: {type: u8, bits: {error: 0..6, busy: 7}, if: {direction: response}}
      data: {role: payload, size: 0..4}
      sum: {type: u8, algorithm: sum8, over: [code, node, state, data]}
  ask:
    if: {direction: request}
    parts:
      start: A5
      code: {role: message, type: u8}
      node: {role: address, type: u8}
      data: {role: payload, size: 0..4}
  tell:
    if: {direction: response}
    parts:
      start: A5 5A
      length: {type: u8, counts: data}
      node: {role: address, type: u8}
      code: {role: message, type: u8}
      data: {role: payload, size: 0..100}
bus: {kind: master_slave, nodes: 1..8, baud: 9600, response_within: 50 ms}
defaults: {addressing: node, repeat: safe}
commands:
  begin: {id: 1, frame: short, request: {speed: u8}, response: {position: u16}}
  scan: {id: 2, request: {}, response: {points: "u16[0..50]"}}
"""


def test_kinds_of_one_direction_begin_alike_and_share_messages() -> None:
    protocol, faults = loads(PARTED, "parted.yaml")
    assert protocol is not None, faults
    codec = load_codec(protocol)
    wire = Wire(baud=9600)
    wire.attach(SlaveEngine(codec, GenericNode(codec, 3), turnaround=0.001), "node 3")
    master = BlockingMaster(MasterEngine(codec, Timing.of(codec, host_slack=SLACK)), VirtualPort(wire))
    assert master.transact(codec.BeginRequest(node=3, speed=9)).response.node == 3
    assert master.transact(codec.ScanRequest(node=3)).response.node == 3
    assert codec.BeginRequest(node=3, speed=9).to_frame() == bytes.fromhex("10 01 03 09 0D")
    answer = codec.BeginResponse(node=3, busy=True, position=1)
    assert answer.to_frame() == bytes.fromhex("10 01 03 80 00 01 85")
    assert codec.decode_response(answer.to_frame()) == answer
    with pytest.raises(codec.DecodeError):
        codec.decode_request(answer.to_frame())
    # The bytes of an answer that a receiver of requests takes for a request, and the other way round.
    assert codec.decode_request(bytes.fromhex("A5 02 05")) == codec.ScanRequest(node=5)
    told = codec.ScanResponse(node=5, points=[0xA502])
    assert told.to_frame() == bytes.fromhex("A5 5A 02 05 02 A5 02")
    assert codec.StreamDecoder("response").feed(b"\xa5" + told.to_frame()) == [told]
