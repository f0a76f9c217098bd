"""Frames with a destination and a source: masters know whom they asked, slaves who asked them."""

from __future__ import annotations

from typing import Any

import pytest

from qlinkgen.backends import python
from qlinkgen.link import MasterEngine, PeerEngine, SlaveEngine, Timing
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.schema.loader import loads
from tests.link.line import Setter, drive

SCHEMA = """\
qlinkgen: 1
protocol: {{name: sample, revision: "1", source: Made up}}
byteorder: big
frame:
  parts:
    start: FD
    length: {{type: u8, counts: data}}
    {parts}
    code: {{role: message, type: u8}}
    data: {{role: payload, size: 0..8}}
    check: {{type: u8, algorithm: sum8, over: [length, code, data]}}
bus: {{kind: master_slave, nodes: 1..7, broadcast: 15, master: 9, baud: 9600}}
commands: {{set: {{id: 5, addressing: either, repeat: safe, request: {{value: u8}}, response: {{}}}}}}
"""
#: In the bits of one byte, or in parts of their own beside an address.
BITS = (
    "head: {type: u8, bits: {destination: {at: 0..3, role: destination}, source: {at: 4..7, role: source}}}"
)
BESIDE = "node: {role: address, type: u8}\n    host: {role: destination, type: u8, if: {direction: response}}"


def made(parts: str) -> Any:
    protocol, faults = loads(SCHEMA.format(parts=parts), "sample")
    assert protocol is not None, [str(fault) for fault in faults]
    return python.load(protocol)


def test_the_node_is_the_destination_of_a_request_and_the_source_of_a_response() -> None:
    protocol, _ = loads(SCHEMA.format(parts=BITS), "sample")
    assert protocol is not None
    codec = Codec(plan_of(protocol))
    request = codec.encode("set.request", {"value": 1, "master": 9}, 3)
    response = codec.encode("set.response", {"master": 9}, 3)
    assert (request[2], response[2]) == (0x93, 0x39)
    found = codec.decode(response, "response")
    assert (found.address, found.beside) == (3, {"master": 9})
    assert codec.decode(codec.encode("set.request", {"value": 1, "master": 2}, 15), "request").address == 15


@pytest.mark.parametrize(("parts", "name"), [(BITS, "master"), (BESIDE, "host")])
def test_a_master_takes_no_answer_to_another_one(parts: str, name: str) -> None:
    module = made(parts)
    engine = MasterEngine(module, Timing.of(module, host_slack=0.05))
    request = module.SetRequest(node=3, value=1)
    answers = [(0.03, module.SetResponse(node=3, **{name: number}).to_frame()) for number in (4, 9)]
    run = drive(engine, request, answers, 0.0)
    assert getattr(run.response, name) == 9
    assert engine.total.strays == 1


def test_a_slave_answers_to_the_master_that_asked() -> None:
    module = made(BITS)
    engine = SlaveEngine(module, Setter(module))
    found = []
    for number in (9, 4):
        engine.receive(module.SetRequest(node=3, master=number, value=1).to_frame(), float(number))
        found.append(engine.bytes_to_send(number + 0.5)[2])
    assert found == [0x39, 0x34]


def test_a_link_has_both_as_values() -> None:
    text = SCHEMA.format(parts=BITS).replace("master_slave", "link").replace(" master: 9,", "")
    protocol, faults = loads(
        text.partition("commands:")[0] + "messages: {set: {id: 5, fields: {}}}\n", "sample"
    )
    assert protocol is not None, faults
    codec = Codec(plan_of(protocol))
    frame = codec.encode("set", {"destination": 15, "source": 7})
    assert frame[2] == 0x7F
    assert codec.decode(frame, "request").beside == {"destination": 15, "source": 7}


ASKING = "id: 5, from: either,"
LINK = SCHEMA.replace("master_slave", "link").replace(" master: 9,", "").replace("id: 5,", ASKING)
WAY = "way: {role: direction, type: u8, values: {request: 1, response: 0}}"


def test_the_ends_of_a_link_ask_each_other() -> None:
    text = LINK.format(parts=f"{BITS}\n    {WAY}")
    protocol, faults = loads(text, "sample")
    assert protocol is not None, [str(fault) for fault in faults]
    module: Any = python.load(protocol)
    assert module.SetRequest(node=3, value=1).master == 1
    timing = Timing.of(module, host_slack=0.05)
    ends = [PeerEngine(module, timing, Setter(module, number)) for number in (2, 5)]
    for engine, other in zip(ends, (5, 2), strict=True):
        engine.start(module.SetRequest(node=other, value=other), 0.0)
    asked = [engine.bytes_to_send(0.0) for engine in ends]
    assert [frame[2] for frame in asked] == [0x25, 0x52]
    stray = module.SetResponse(node=5, master=7).to_frame()
    ends[0].receive(asked[1] + stray, 0.02)
    ends[1].receive(asked[0], 0.02)
    answers = [engine.bytes_to_send(0.03) for engine in ends]
    assert [frame[2] for frame in answers] == [0x25, 0x52]
    assert ends[0].busy
    for engine, frame in zip(ends, reversed(answers), strict=True):
        engine.receive(frame, 0.04)
    replies = [engine.take().response for engine in ends]
    assert [(each.node, each.master) for each in replies] == [(5, 2), (2, 5)]
    assert [engine.total.strays for engine in ends] == [1, 0]


def test_a_master_has_a_number_of_its_own() -> None:
    module = made(BITS)
    engine = MasterEngine(module, Timing.of(module, host_slack=0.05), number=4)
    answers = [(0.03, module.SetResponse(node=3, master=number).to_frame()) for number in (9, 4)]
    run = drive(engine, module.SetRequest(node=3, value=1), answers, 0.0)
    assert run.frames[0][2] == 0x43
    assert run.response.master == 4


def test_messages_of_a_link_that_asks_have_a_direction() -> None:
    text = LINK.format(parts=BITS).replace("    code:", f"    {WAY}\n    code:")
    _, faults = loads(text + "messages: {event: {id: 6, fields: {}}}\n", "sample")
    assert "event has no direction, which its frame states" in str(faults[0])
    protocol, faults = loads(text + "messages: {event: {id: 6, direction: request, fields: {}}}\n", "sample")
    assert protocol is not None, faults
    frame = Codec(plan_of(protocol)).encode("event", {"master": 7}, 5)
    assert frame[2] == 0x75
