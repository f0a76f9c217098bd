"""Codings of frames that no terminator ends: decoded as they are read."""

from __future__ import annotations

import pytest

from qlinkgen.backends import python
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.receive import receiver
from qlinkgen.schema import loads

_SCHEMA = """
qlinkgen: 1
protocol: {{name: sample, revision: "1", source: Made up}}
frame:
  parts:
    start: 7E
    length: {{type: u8, counts: data}}
    code: {{role: message, type: u8}}
    data: {{role: payload, size: 0..20}}
    sum: {{type: u8, algorithm: sum8, over: [length, code, data]}}
    end: 0D
  coding: {coding}
bus: {{kind: host}}
defaults: {{repeat: safe}}
commands:
  go: {{id: 1, request: {{data: bytes}}, response: {{}}}}
"""
#: A coding, a frame of 7E 7D, and the beginning of one up to a wrong byte.
CODINGS = [
    ("{escape: 7D, xor: 20, of: [7E, 7D]}", "7E 02 01 7D 5E 7D 5D FE 0D", "7E 02 01 7D 7D"),
    ("{replace: {7E: DB DC, DB: DB DD}}", "7E 02 01 DB DC 7D FE 0D", "7E 02 01 DB 7D"),
    ("{digits: hex, over: [length, code, data, sum]}", "7E 30 32 30 31 37 45 37 44 46 45 0D", "7E 30 32 3A"),
    ("{pair: complement, over: [data, sum]}", "7E 02 01 7E 81 7D 82 FE 01 0D", "7E 02 01 05 05"),
    ("{add: 33, over: [code, data]}", "7E 02 34 B1 B0 FE 0D", ""),
]


def protocol(coding: str) -> Protocol:
    found, faults = loads(_SCHEMA.format(coding=coding), "sample.yaml")
    assert found is not None, faults
    return found


@pytest.mark.parametrize(("coding", "wire", "wrong"), CODINGS)
def test_each_byte_is_decoded_when_it_is_read(coding: str, wire: str, wrong: str) -> None:
    stated = protocol(coding)
    module, plan, frame = python.load(stated), plan_of(stated), bytes.fromhex(wire)
    assert module.MESSAGES["go.request"](data=b"\x7e\x7d").to_frame() == frame
    assert dissect(plan, frame, "request").faults == ()
    decoder, reference = module.StreamDecoder("request"), receiver(plan, "request")
    stream = bytes.fromhex(wrong) + frame
    for byte in stream:
        found = [getattr(each, "kind", "message") for each in decoder.feed(bytes((byte,)))]
        assert found == [each.kind for each in reference.feed(byte)]
    assert (decoder.counters.frames, decoder.counters.faults) == (1, {"stuffing": 1} if wrong else {})
    assert [
        each.data for each in module.StreamDecoder("request").feed(stream * 2) if hasattr(each, "data")
    ] == [b"\x7e\x7d"] * 2


def test_check_values_may_cover_coded_bytes() -> None:
    stated = protocol("{add: 33, checked: after}")
    module, plan, frame = python.load(stated), plan_of(stated), bytes.fromhex("7E 02 01 B1 34 E8 0D")
    made = module.MESSAGES["go.request"](data=b"\x7e\x01")
    assert (made.to_frame(), made.to_bytes()) == (frame, b"\x7e\x01")
    assert [each.data for each in module.StreamDecoder("request").feed(frame)] == [b"\x7e\x01"]
    assert dissect(plan, frame, "request").faults == ()


def test_a_byte_that_is_cut_off_is_missing() -> None:
    plan = plan_of(protocol(CODINGS[0][0]))
    found = dissect(plan, bytes.fromhex("7E 02 01 7D 5E 7D"), "request")
    assert (found.kind, [fault.kind for fault in found.faults]) == ("truncated", ["truncated"])
