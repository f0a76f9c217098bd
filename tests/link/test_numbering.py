"""Counters of frames, which masters and slaves fill."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from qlinkgen.backends import python
from qlinkgen.link import MasterEngine, SlaveEngine, Timing
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
    node: {{role: address, type: u8}}
    code: {{role: message, type: u8}}
    {counter}
    data: {{role: payload, size: 0..8}}
    check: {{type: u8, algorithm: sum8, over: [length, node, code, data]}}
bus: {{kind: master_slave, nodes: 1..7, baud: 9600}}
commands: {{set: {{id: 5, addressing: node, repeat: safe, request: {{value: u8}}, response: {{}}}}}}
"""
OF_REQUESTS = "seq: {role: counter, type: u8}"
OF_FRAMES = "seq: {role: counter, type: u8, per: frame}"
ECHOED = "seq: {type: u8, bits: {one: {at: 7, const: 1}, tag: {at: 0..1, role: counter, echo: true}}}"

#: When each transaction begins.
_CLOCK = itertools.count(1.0, 10.0)


def made(counter: str) -> Any:
    protocol, faults = loads(SCHEMA.format(counter=counter), "sample")
    assert protocol is not None, [str(fault) for fault in faults]
    return python.load(protocol)


def numbers(engine: MasterEngine, module: Any, *answers: Any, attempts: int = 3) -> list[int]:
    """The byte with the counter in each frame of a transaction."""
    now = next(_CLOCK)
    arrivals = [(now + 0.03, answer.to_frame()) for answer in answers]
    run = drive(engine, module.SetRequest(node=3, value=1), arrivals, now, attempts=attempts)
    assert (run.reply is not None) == bool(answers)
    return [frame[4] for frame in run.frames]


def master(module: Any) -> MasterEngine:
    return MasterEngine(module, Timing.of(module, host_slack=0.05))


def test_a_repeat_keeps_the_number_of_its_request() -> None:
    module = made(OF_REQUESTS)
    engine = master(module)
    assert [numbers(engine, module) for _ in range(2)] == [[0, 0, 0], [1, 1, 1]]
    assert numbers(engine, module, module.SetResponse(node=3, seq=77)) == [2]


def test_every_frame_has_a_number_of_its_own() -> None:
    module = made(OF_FRAMES)
    engine = master(module)
    assert [numbers(engine, module) for _ in range(2)] == [[0, 1, 2], [3, 4, 5]]


def test_the_number_wraps() -> None:
    module = made(ECHOED)
    engine = master(module)
    assert [numbers(engine, module, attempts=1)[0] & 3 for _ in range(5)] == [0, 1, 2, 3, 0]


def test_an_echoed_counter_pairs_requests_and_answers() -> None:
    module = made(ECHOED)
    engine = master(module)
    assert numbers(engine, module, module.SetResponse(node=3, tag=0), attempts=1) == [0x80]
    wrong, right = (module.SetResponse(node=3, tag=tag) for tag in (0, 1))
    assert numbers(engine, module, wrong, right, attempts=1) == [0x81]
    assert engine.total.strays == 1


@pytest.mark.parametrize(
    ("counter", "expected"), [(OF_REQUESTS, [0, 0]), (OF_FRAMES, [0, 1]), (ECHOED, [0x82, 0x83])]
)
def test_answers_of_a_slave(counter: str, expected: list[int]) -> None:
    module = made(counter)
    engine = SlaveEngine(module, Setter(module))
    found, name = [], module.SetRequest.COUNTER[0]
    for number in (2, 3):
        request = module.SetRequest(node=3, value=1)
        setattr(request, name, number)
        engine.receive(request.to_frame(), float(number))
        found.append(engine.bytes_to_send(number + 0.5)[4])
    assert found == expected


def test_codecs_take_the_counter_as_a_value() -> None:
    protocol, _ = loads(SCHEMA.format(counter=OF_REQUESTS), "sample")
    assert protocol is not None
    codec = Codec(plan_of(protocol))
    frame = codec.encode("set.request", {"value": 1, "seq": 9}, 3)
    assert frame[4] == 9
    assert codec.decode(frame, "request").beside == {"seq": 9}


TOGGLING = """\
control:
      type: u8
      bits:
        function: {{at: 0..3, role: message}}
        fcv: {{at: 4, role: message, if: {{way: request}}}}
        full: {{at: 4, if: {{way: response}}}}
        fcb: {{at: 5, role: counter, if: {{way: request, fcv: 1}}}}
        way: {{at: 6, role: direction, values: {{request: 1, response: 0}}}}"""
ALTERNATING = (
    SCHEMA.replace("code: {{role: message, type: u8}}\n    {counter}", TOGGLING)
    .replace("node, code, data]", "node, control, data]")
    .replace("nodes: 1..7,", "nodes: 1..7, broadcast: 0,")
    .replace("id: 5,", "id: {{function: 5, fcv: 1}},")
    .replace(
        "response: {{}}}}}}",
        "response: {{}}}},\n"
        "  ask: {{id: 4, addressing: node, repeat: safe, request: {{}}, response: {{}}}},\n"
        "  reset: {{id: 0, addressing: either, restart: 1, repeat: safe, request: {{}}, response: {{}}}}}}",
    )
)


def alternating() -> Any:
    protocol, faults = loads(ALTERNATING.format(), "sample")
    assert protocol is not None, [str(fault) for fault in faults]
    return python.load(protocol)


def controls(engine: MasterEngine, request: Any, *, attempts: int = 1) -> list[int]:
    """The control byte of each frame of a transaction that is not answered."""
    run = drive(engine, request, [], next(_CLOCK), attempts=attempts)
    return [frame[3] for frame in run.frames]


def test_a_bit_alternates_with_each_new_request_to_a_node() -> None:
    module = alternating()
    engine = master(module)
    assert controls(engine, module.SetRequest(node=3), attempts=3) == [0x75, 0x75, 0x75]
    found = [controls(engine, module.SetRequest(node=node))[0] for node in (3, 4, 3, 4)]
    assert found == [0x55, 0x75, 0x75, 0x55]


def test_a_bit_stays_where_it_does_not_count_and_a_reset_sets_it() -> None:
    module = alternating()
    engine = master(module)
    wanted = []
    for request in (
        module.SetRequest(node=3, value=1),
        module.AskRequest(node=3),
        module.SetRequest(node=3, value=1),
    ):
        wanted += controls(engine, request)
    assert wanted == [0x75, 0x44, 0x55]
    assert controls(engine, module.SetRequest(node=4, value=1)) == [0x75]
    assert controls(engine, module.ResetRequest(node=4)) == [0x40]
    assert [controls(engine, module.SetRequest(node=node, value=1)) for node in (4, 3)] == [[0x75], [0x75]]
    controls(engine, module.ResetRequest(node=0))  # to all nodes
    assert [controls(engine, module.SetRequest(node=node, value=1)) for node in (4, 3)] == [[0x75], [0x75]]


def test_bits_of_one_direction_are_values_of_its_frames_alone() -> None:
    protocol, _ = loads(ALTERNATING.format(), "sample")
    assert protocol is not None
    codec, module = Codec(plan_of(protocol)), alternating()
    frame = codec.encode("set.response", {"full": 1}, 3)
    assert frame[3] == 0x15
    assert codec.decode(frame, "response").beside == {"full": 1}
    assert codec.decode(codec.encode("set.request", {"value": 1, "fcb": 1}, 3), "request").beside == {
        "fcb": 1
    }
    assert module.decode_response(frame).full
    assert not hasattr(module.decode_response(frame), "fcb")
    wrong = bytearray(module.AskRequest(node=3).to_frame())
    wrong[3] |= 0x10  # not a message with this bit
    wrong[-1] = (wrong[-1] + 0x10) & 0xFF
    with pytest.raises(module.DecodeError) as caught:
        module.decode_request(bytes(wrong))
    assert caught.value.kind == "unknown"
