"""Check values of responses that cover pieces of the request."""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.errors import BadReply
from qlinkgen.link import MasterEngine, Monitor, SlaveEngine, Timing
from qlinkgen.link.events import Damaged
from qlinkgen.link.monitor import Asked, Replied
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.spans import Rule
from qlinkgen.schema import loads
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.sim.generic import GenericNode
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import drive

SLACK = 0.002
SCHEMA = """\
qlinkgen: 1
protocol: {name: claw, title: Motor controller, revision: "1", source: Manual}
byteorder: big
frames:
  command:
    parts:
      node: {role: address, type: u8}
      code: {role: message, type: u8}
      data: {role: payload, size: 0..16}
      crc: {type: u16, algorithm: crc-16/xmodem, over: [node, code, data]}
  plain: {parts: {data: {role: payload, size: 1..16}}}
bus: {kind: master_slave, nodes: 0x80..0x87, baud: 38400, response_within: 10 ms}
defaults: {frame: command, addressing: node, repeat: safe, response: {id: none, frame: plain}}
types: {crc: {type: u16, doc: Check value of the request and this response}}
commands:
  speed:
    id: 30
    request: {}
    response:
      speed: i32
      status: u8
      crc: {type: crc, algorithm: crc-16/xmodem, over: [request.node, request.code, speed, status]}
  name:
    id: 31
    request: {part: u16}
    response:
      head: {type: u8, default: 9}
      size: {type: u8, counts: text}
      text: "text[0..10]"
      crc: {type: crc, algorithm: crc-16/xmodem, over: [request.code, request.data, size, text]}
  go: {id: 32, request: {speed: i16}, response: {done: {type: u8, const: 0xFF}}}
"""


@cache
def loaded() -> tuple[Protocol, ModuleType]:
    protocol, faults = loads(SCHEMA, "claw.yaml")
    assert protocol is not None, faults
    return protocol, load_codec(protocol)


@pytest.fixture
def codec() -> ModuleType:
    return loaded()[1]


class Claw:
    number = 0x81

    def __init__(self, codec: ModuleType) -> None:
        self._codec = codec

    def handle(self, request: Any, now: float) -> Any:
        if isinstance(request, self._codec.SpeedRequest):
            return self._codec.SpeedResponse(speed=-2, status=7)
        if isinstance(request, self._codec.NameRequest):
            return self._codec.NameResponse(text="abc")
        return self._codec.GoResponse()


def answered(codec: ModuleType, request: Any) -> bytes:
    """What a slave answers."""
    slave = SlaveEngine(codec, Claw(codec))
    slave.receive(request.to_frame(), 0.0)
    at = slave.next_timer()
    assert at is not None
    return slave.bytes_to_send(at)


def test_a_slave_gives_it_and_a_master_takes_it(codec: ModuleType) -> None:
    wire = Wire(baud=38400)
    wire.attach(SlaveEngine(codec, Claw(codec)), "claw")
    master = BlockingMaster(MasterEngine(codec, Timing.of(codec, host_slack=SLACK)), VirtualPort(wire))
    assert master.transact(codec.SpeedRequest(node=0x81)).response.status == 7
    assert master.transact(codec.NameRequest(node=0x81, part=4)).response.text == "abc"
    assert master.transact(codec.GoRequest(node=0x81, speed=1)).response == codec.GoResponse()
    # 81 1E FF FF FF FE 07, and 1F 00 04 03 61 62 63
    assert answered(codec, codec.SpeedRequest(node=0x81)).hex() == "fffffffe0717f9"
    assert answered(codec, codec.NameRequest(node=0x81, part=4)).hex() == "0903616263329e"


def test_a_simulated_node_gives_it(codec: ModuleType) -> None:
    wire = Wire(baud=38400)
    wire.attach(SlaveEngine(codec, GenericNode(codec, 0x82, plan_of(loaded()[0]))), "claw")
    master = BlockingMaster(MasterEngine(codec, Timing.of(codec, host_slack=SLACK)), VirtualPort(wire))
    assert master.transact(codec.NameRequest(node=0x82, part=1)).response.head == 9


def test_the_answer_to_another_request_is_damaged(codec: ModuleType) -> None:
    engine = MasterEngine(codec, Timing.of(codec, host_slack=SLACK))
    other = answered(codec, codec.NameRequest(node=0x81, part=4))
    run = drive(engine, codec.NameRequest(node=0x81, part=5), [(0.012, other)], attempts=1)
    assert isinstance(run.error, BadReply)
    assert "invalid replies (crc)" in str(run.error)
    (fault,) = [each.fault for each in engine.events if isinstance(each, Damaged)]
    assert fault.message.startswith("name.response: crc: received 0x329e, expected 0x98cf")


def test_a_monitor_knows_the_request(codec: ModuleType) -> None:
    monitor = Monitor(codec, Timing.of(codec, host_slack=SLACK))
    speed = codec.SpeedRequest(node=0x81)
    right = answered(codec, speed)
    wrong = right[:-1] + bytes((right[-1] ^ 1,))
    for number, data in enumerate((speed.to_frame(), right, speed.to_frame(), wrong)):
        monitor.receive(data, 0.01 * number)
    assert [type(each).__name__ for each in monitor.heard] == [
        Asked.__name__, Replied.__name__, Asked.__name__, Damaged.__name__,
    ]  # fmt: skip


def test_explain_compares_it_where_the_request_is_known(codec: ModuleType) -> None:
    plan = plan_of(loaded()[0])
    request = codec.SpeedRequest(node=0x81)
    right, message = answered(codec, request), plan.message("speed.response")
    assert not dissect(plan, right, "response", request.to_frame(), turned=message).faults
    assert not dissect(plan, right[:-1] + b"\0", "response", turned=message).faults
    found = dissect(plan, right[:-1] + b"\0", "response", request.to_frame(), turned=message)
    assert [(each.kind, each.rule, each.at, each.right) for each in found.faults] == [
        ("crc", Rule.PROOF, 5, int.from_bytes(right[-2:], "big"))
    ]


def test_a_kind_may_state_it_for_all_its_responses() -> None:
    check = "crc: {type: u16, algorithm: crc-16/xmodem, over: [request.node, request.code, %s]}"
    text = """\
qlinkgen: 1
protocol: {name: claw, revision: "1", source: Manual}
frames:
  command:
    parts:
      node: {role: address, type: u8}
      code: {role: message, type: u8}
      sum: {type: u8, algorithm: sum8, over: [node, code]}
  plain: {parts: {data: {role: payload, size: 0..6}, %s}}
  short: {parts: {data: {role: payload, size: 1..8}}}
bus: {kind: master_slave, nodes: 0x80..0x87, response_within: 10 ms}
defaults: {frame: command, addressing: node, repeat: safe, response: {id: none, frame: plain}}
commands:
  speed: {id: 30, request: {}, response: {speed: u32, mode: {switch: speed, cases: {0: u8}, default: u16}%s}}
  none: {id: 31, request: {}, response: {frame: plain, fields: {%s}}}
  steps: {id: 32, request: {}, steps: [{receive: {frame: plain, fields: {state: u8%s}}}]}
  go: {id: 33, request: {}, response: {frame: short, fields: {done: u8}}}
"""
    one = loads(text % (check % "data", "", "", ""), "claw.yaml")
    # Written out.
    plain = text.replace("0..6}, %s}", "2..8}}")
    each = (", " + check % "speed, mode", check.replace(", %s", ""), ", " + check % "state")
    other = loads(plain % each, "claw.yaml")
    for protocol, faults in (one, other):
        assert protocol is not None, faults
    assert one[0] is not None
    assert other[0] is not None
    assert one[0].frame == other[0].frame
    assert one[0].commands == other[0].commands
    assert one[0].messages == other[0].messages
    assert one[0].by_name["none.response"].values[-1].field.proves == ("node", "code")
