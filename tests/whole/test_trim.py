"""Payloads without the zeros at their end: by hand, and the same in every output."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from qlinkgen.backends import construct
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.reading import BadFrame
from qlinkgen.schema import loads
from tests.support.whole.trial import Effort, run_text

_HEAD = """\
qlinkgen: 1
protocol: {name: tank, title: Tank, revision: "1", source: Example, doc: A tank}
byteorder: little
bus: {kind: master_slave}
attributes: {extra: {type: u8}}
messages:
  state:
    id: 6
    attributes: {extra: 7}
    fields: {level: u16, mode: {type: u16, range: 0..5}, name: {type: "text[6]", pad: 00}, rows: "u16[2]"}
  ready:
    id: 7
    attributes: {extra: 8}
    fields: {number: {type: u8, range: 1..9}, "on": {type: u8, range: 1..2}}
  empty: {id: 8, attributes: {extra: 9}, fields: {}}
  gap: {id: 9, attributes: {extra: 0}, fields: {spare: {type: u16, reserved: true}}}
frame:
  parts:
"""
_SHAPES = {
    "one byte is kept": """\
    start: FD
    length: {type: u8, counts: [data]}
    code: {role: message, type: u24}
    data: {role: payload, size: 0..40, trim: {zeros: true, keep: 1}}
    crc: {type: u16, algorithm: crc-16/mcrf4xx, over: [length, code, data, attribute.extra]}
""",
    "nothing is kept, and parts follow": """\
    length: {type: u16, counts: [length, data, crc], offset: 1}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..14, trim: zeros}
    crc: {type: u8, algorithm: sum8, over: [data, attribute.extra]}
    flags: {type: u8, bits: {urgent: 3}}
    stop: 03
""",
    "more bytes are kept than some messages have": """\
    start: FD
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..40, trim: {zeros: true, keep: 3}}
    crc: {type: u8, algorithm: sum8, over: [data, attribute.extra]}
""",
}


def codec(shape: str) -> Codec:
    protocol, faults = loads(_HEAD + _SHAPES[shape], "tank.yaml")
    assert protocol, faults
    return Codec(plan_of(protocol))


@pytest.mark.slow
@pytest.mark.parametrize("parts", _SHAPES.values(), ids=_SHAPES)
def test_outputs_agree(parts: str, require_tool: Callable[..., str]) -> None:
    for compiler, package in (("gcc", "gcc"), ("g++", "g++"), ("clang", "clang"), ("clang++", "clang")):
        require_tool(compiler, package=package)
    outcome = run_text(_HEAD + parts, effort=Effort(streams=40, every=True))
    assert not outcome.refused
    assert not outcome.differences, outcome.report()


def test_zeros_at_the_end_are_not_sent() -> None:
    mavlink, bare = codec("one byte is kept"), codec("nothing is kept, and parts follow")
    assert mavlink.encode("state", {"level": 0x100, "mode": 3})[:8].hex(" ") == "fd 03 06 00 00 00 01 03"
    assert mavlink.encode("state", {})[:6].hex(" ") == "fd 01 06 00 00 00"
    assert mavlink.encode("empty", {})[:5].hex(" ") == "fd 00 08 00 00"
    assert bare.encode("state", {}).hex(" ") == "02 00 06 07 00 03"


def test_a_receiver_adds_them() -> None:
    found = codec("one byte is kept")
    values = {"level": 5, "mode": 0, "name": b"", "rows": [0, 0]}
    for payload in (b"\5", b"\5\0\0", b"\5" + bytes(13)):
        decoded = found.decode(found.wrap("state", payload), "message")
        assert (decoded.values, decoded.payload) == (values, payload)
    assert found.decode(found.wrap("state", b""), "message").values == {**values, "level": 0}
    with pytest.raises(BadFrame, match="length"):
        found.decode(found.wrap("state", bytes(15)), "message")
    with pytest.raises(BadFrame, match="range"):
        found.decode(found.wrap("ready", b"\1"), "message")


def test_explain_knows_them() -> None:
    found = codec("one byte is kept")
    seen = dissect(found.plan, found.encode("state", {"level": 1, "rows": [0x100, 0]}), "message")
    assert not seen.faults
    spans = {getattr(span.of, "name", ""): span for span in seen.spans}
    assert spans["level"].number == 1
    assert (len(spans["rows"].raw), spans["rows"].size) == (2, 4)
    seen = dissect(found.plan, found.wrap("ready", b"\1"), "message")
    assert [(fault.kind, getattr(fault.of, "name", ""), fault.seen) for fault in seen.faults] == [
        ("range", "on", 0)
    ]


def test_construct_builds_payloads_as_sent() -> None:
    protocol, _ = loads(_HEAD + _SHAPES["one byte is kept"], "tank.yaml")
    assert protocol
    live = construct.live(protocol)
    assert live.payload("ready", {"number": 3, "on": 1}) == b"\3\1"
    assert live.payload("state", {"level": 0}) == b"\0"
