"""Addresses in digits: by hand, and the same in every output."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from construct import ConstructError

from qlinkgen.backends import python
from qlinkgen.backends.construct.live import live
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.reading import BadFrame
from qlinkgen.plan.receive import receiver
from qlinkgen.plan.tree import Plan
from qlinkgen.schema import loads
from tests.support.whole.trial import Effort, run_text

#: The requests of DCON, with the sum of their bytes.
_DCON = """\
    start: {text: "$"}
    node: {role: address, type: u8, as: "hex[2]"}
    code: {role: message, type: "text[1]"}
    data: {role: payload, size: 0..20}
    sum: {type: u8, as: "hex[2]", algorithm: sum8, over: [start, node, code, data]}
    end: 0D
"""
#: The end of a frame follows from its length, and nothing but the address and the id tell its beginning.
_PUMP = """\
    node: {role: address, type: u16, as: "decimal[3]"}
    length: {type: u8, counts: [node, data]}
    code: {role: message, type: "text[1]"}
    data: {role: payload, size: 0..20}
    sum: {type: u8, algorithm: sum8, over: [node, length, code, data]}
"""
#: The address follows the payload.
_BEHIND = """\
    start: 02
    code: {role: message, type: "text[1]"}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..20}
    node: {role: address, type: u8, as: "decimal[2]"}
    sum: {type: u8, algorithm: sum8, over: [code, data, node]}
"""
_SHAPES = {"before a terminator": _DCON, "at the beginning": _PUMP, "after the payload": _BEHIND}


def _text(parts: str) -> str:
    return f"""\
qlinkgen: 1
protocol: {{name: pump, title: Pump, revision: "1", source: Example, doc: A pump}}
bus: {{kind: master_slave, nodes: 1..60, broadcast: 99}}
defaults: {{addressing: node, repeat: safe}}
frame:
  parts:
{parts}\
commands:
  speed: {{id: "2", request: {{}}, response: {{speed: {{type: u16, as: "decimal[5]"}}}}}}
  stop: {{id: "S", addressing: broadcast, request: {{}}, response: none}}
"""


def _plan(parts: str) -> Plan:
    protocol, faults = loads(_text(parts), "pump.yaml")
    assert protocol, faults
    return plan_of(protocol)


@pytest.mark.slow
@pytest.mark.parametrize("parts", _SHAPES.values(), ids=_SHAPES)
def test_outputs_agree(parts: str, require_tool: Callable[..., str]) -> None:
    for compiler, package in (("gcc", "gcc"), ("g++", "g++"), ("clang", "clang"), ("clang++", "clang")):
        require_tool(compiler, package=package)
    outcome = run_text(_text(parts), effort=Effort(streams=40, every=True))
    assert not outcome.refused
    assert not outcome.differences, outcome.report()


@pytest.mark.parametrize(
    ("parts", "frame"),
    [
        (_DCON, b"$1A201234C2\r"),
        (_PUMP, b"026\x08" + b"201234" + b"\xcc"),
        (_BEHIND, b"\x022\x05" + b"01234" + b"26" + b"\x94"),
    ],
    ids=_SHAPES,
)
def test_frames_by_hand(parts: str, frame: bytes) -> None:
    found = _plan(parts)
    assert Codec(found).encode("speed.response", {"speed": 1234}, 26) == frame
    codec = python.load(found.protocol)
    assert codec.SpeedResponse(speed=1234, node=26).to_frame() == frame
    assert codec.decode_response(frame).node == Codec(found).decode(frame, "response").address == 26


@pytest.mark.parametrize("form", ["hex[2]", "decimal[2]"])
def test_another_character_is_refused(form: str) -> None:
    found = _plan(_DCON.replace("hex[2]", form, 1))
    codec, right = python.load(found.protocol), Codec(found).encode("speed.response", {"speed": 1}, 1)
    reader = live(found.protocol).frames["response"]
    assert reader.parse(right)["node"] == 1
    for digits in (b"1G", b"+1", b"1.", b" 1", b"\xb21"):
        wrong = right[:1] + digits + right[3:]
        with pytest.raises(BadFrame, match="frame"):
            Codec(found).decode(wrong, "response")
        with pytest.raises(codec.DecodeError) as raised:
            codec.decode_response(wrong)
        assert raised.value.kind == "frame"
        with pytest.raises(ConstructError, match="node is"):
            reader.parse(wrong)
        cut = dissect(found, wrong, "response")
        assert (cut.kind, cut.address) == ("frame", None)


def test_a_receiver_does_not_wait_for_a_frame_with_a_wrong_digit() -> None:
    found = _plan('    start: {text: "$"}\n' + _PUMP.replace("decimal[3]", "hex[2]"))
    right = Codec(found).encode("speed.response", {"speed": 1}, 1)
    stream = b"$1X\x16" + right  # it announces more bytes than follow
    events = receiver(found, "response").run(stream)
    assert [(event.kind, event.offset) for event in events if event.kind == "message"] == [("message", 4)]
    decoder = python.load(found.protocol).StreamDecoder("response")
    assert [each.node for each in decoder.feed(stream)] == [1]


def test_lower_case_digits_are_received() -> None:
    found = _plan(_DCON.replace(", over: [start, node, code, data]", ", over: [code, data]"))
    frame = Codec(found).encode("speed.response", {"speed": 1}, 0x1A).replace(b"1A", b"1a")
    assert Codec(found).decode(frame, "response").address == 0x1A
    assert python.load(found.protocol).decode_response(frame).node == 0x1A
