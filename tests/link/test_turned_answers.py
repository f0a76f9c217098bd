"""Responses that only their turn tells, of commands without steps."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.errors import BadReply
from qlinkgen.link import MasterEngine, Monitor, SlaveEngine, Timing
from qlinkgen.link.monitor import Asked, Replied
from qlinkgen.schema import loads
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.sim.generic import GenericNode
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import drive

SLACK = 0.002
SCHEMA = """\
qlinkgen: 1
protocol: {name: drive, title: Motor drive, revision: "1", source: Manual}
byteorder: big
frames:
  command:
    parts:
      start: 7E
      node: {role: address, type: u8}
      code: {role: message, type: u8}
      data: {role: payload, size: 0..16}
  plain: {parts: {data: {role: payload, size: 1..16}}}
bus: {kind: master_slave, nodes: 1..9, baud: 38400, response_within: 10 ms}
defaults: {frame: command, addressing: node, repeat: safe, response: {id: none, frame: plain}}
commands:
  speed: {id: 30, request: {axis: u8}, response: {speed: i32, axis: {type: u8, echo: true}}}
  read: {id: 31, request: {number: {type: u8, range: 1..8}}, response: {data: "bytes[request.number]"}}
  go: {id: 32, request: {speed: i16}, response: {done: {type: u8, const: 0xFF}}}
"""


@pytest.fixture(scope="module")
def codec() -> ModuleType:
    protocol, faults = loads(SCHEMA, "drive.yaml")
    assert protocol is not None, faults
    return load_codec(protocol)


class Drive:
    """A node whose answers look like requests."""

    number = 3

    def __init__(self, codec: ModuleType) -> None:
        self._codec = codec

    def handle(self, request: Any, now: float) -> Any:
        if isinstance(request, self._codec.SpeedRequest):
            return self._codec.SpeedResponse(speed=0x7E031E00)
        if isinstance(request, self._codec.ReadRequest):
            return self._codec.ReadResponse(data=b"\x7e\x03\x20\x00"[: request.number])
        return self._codec.GoResponse()


def test_master_and_slave_talk(codec: ModuleType) -> None:
    wire = Wire(baud=38400)
    wire.attach(SlaveEngine(codec, Drive(codec)), "drive")
    master = BlockingMaster(MasterEngine(codec, Timing.of(codec, host_slack=SLACK)), VirtualPort(wire))
    told = master.transact(codec.SpeedRequest(node=3, axis=2)).response
    assert told == codec.SpeedResponse(speed=0x7E031E00, axis=2)
    assert master.transact(codec.ReadRequest(node=3, number=4)).response.data == b"\x7e\x03\x20\x00"
    assert master.transact(codec.GoRequest(node=3, speed=-1)).response == codec.GoResponse()


def test_a_simulated_node_answers(codec: ModuleType) -> None:
    wire = Wire(baud=38400)
    wire.attach(SlaveEngine(codec, GenericNode(codec, 3)), "drive")
    master = BlockingMaster(MasterEngine(codec, Timing.of(codec, host_slack=SLACK)), VirtualPort(wire))
    assert master.transact(codec.ReadRequest(node=3, number=2)).response == codec.ReadResponse(data=bytes(2))


def test_an_answer_to_something_else_is_no_answer(codec: ModuleType) -> None:
    engine = MasterEngine(codec, Timing.of(codec, host_slack=SLACK))
    right = codec.SpeedResponse(speed=5, axis=2)
    other = codec.SpeedResponse(speed=5, axis=1).to_bytes()
    request = codec.SpeedRequest(node=3, axis=2)
    assert isinstance(drive(engine, request, [(0.012, other)], attempts=1).error, BadReply)
    engine = MasterEngine(codec, Timing.of(codec, host_slack=SLACK))
    run = drive(engine, request, [(0.012, other), (0.027, right.to_bytes())], attempts=2)
    assert run.response == right


def test_a_monitor_pairs_them(codec: ModuleType) -> None:
    monitor = Monitor(codec, Timing.of(codec, host_slack=SLACK))
    read, go = codec.ReadRequest(node=3, number=4), codec.GoRequest(node=3, speed=1)
    told = codec.ReadResponse(data=go.to_frame()[:4])
    for number, data in enumerate((read.to_frame(), told.to_bytes(), go.to_frame(), b"\xff")):
        monitor.receive(data, 0.01 * number)
    assert [each.request for each in monitor.heard if isinstance(each, Asked)] == [read, go]
    answers = [each.response for each in monitor.heard if isinstance(each, Replied)]
    assert answers == [told, codec.GoResponse()]
    assert len(monitor.heard) == 4
