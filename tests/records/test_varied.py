"""Records of variable size, and arrays that end with a record: interpreter, generated Python, construct."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import construct, python
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, MoreNeeded, Raw, Unsendable, measure, pack, unpack
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.payload import PayloadPlan
from qlinkgen.schema import loads

SCHEMA = """
qlinkgen: 1
protocol: {name: varied, title: Varied, revision: "1", source: Example}
byteorder: big
types:
  option:
    fields:
      {kind: {type: u8, range: 1..9}, size: {type: u8, counts: [kind, size, value]}, value: "bytes[0..8]"}
  digits: {fields: {byte: {type: u8, bits: {value: 0..6, more: 7}}}}
  pair: {fields: {first: option, flag: bool, second: {type: option, if: flag}}}
frame:
  parts:
    sync: B5 62
    length: {type: u16, counts: data}
    number: {role: message, type: u8}
    data: {role: payload, size: 0..24}
    check: {type: u16, algorithm: crc-16/modbus, over: [length, number, data]}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands:
  counted:
    id: 1
    request: {count: {type: u8, counts: options}, options: "option[0..4]", end: u8}
    response: {size: {type: u8, counts: [size, options]}, options: "option[1..4]", end: u8}
  open:
    id: 2
    request: {options: "option[0..2]", end: u8}
    response: {number: {type: "digits[1..3]", last: {more: 0}}, pairs: "pair[2]"}
"""
A: dict[str, Raw] = {"kind": 1, "value": b"\xaa"}
B: dict[str, Raw] = {"kind": 9, "value": b""}
SHORT: dict[str, Raw] = {"first": B, "flag": 0, "second": None}
LONG: dict[str, Raw] = {"first": A, "flag": 1, "second": B}
CASES: list[tuple[str, dict[str, Raw], str]] = [
    ("counted.request", {"options": [A, B], "end": 7}, "02 0103AA 0902 07"),
    ("counted.request", {"options": [], "end": 7}, "00 07"),
    ("counted.response", {"options": [B, A], "end": 7}, "06 0902 0103AA 07"),
    ("open.request", {"options": [A], "end": 7}, "0103AA 07"),
    (
        "open.response",
        {"number": [{"value": 1, "more": 1}, {"value": 2, "more": 0}], "pairs": [SHORT, LONG]},
        "81 02 0902 00 0103AA 01 0902",
    ),
]
WRONG = [
    ("counted.request", "02 0103AA 09", "length"),
    ("counted.request", "01 0102 07 07", "length"),
    ("counted.request", "01 0103AA 0902 07", "length"),
    ("counted.request", "02 0003AA 0902 07", "range"),
    ("counted.request", "02 0101AA 0902 07", "length"),
    ("counted.response", "05 0902 0103AA 07", "length"),
    ("counted.response", "01 07", "length"),
    ("open.request", "0902 0902 0902 07", "length"),
    ("open.response", "81 82 83 0902 00 0902 00", "length"),
    ("open.response", "01 0902 02 0902 00", "range"),
    ("open.response", "01 0902 01 0902", "length"),
]


@cache
def protocol() -> Protocol:
    found, faults = loads(SCHEMA, "varied.yaml")
    assert found is not None, faults
    return found


def payload_of(name: str) -> PayloadPlan:
    return plan_of(protocol()).message(name).payload


@cache
def module() -> Any:
    return python.load(protocol())


@cache
def live() -> construct.Live:
    return construct.live(protocol())


def frame(name: str, payload: bytes) -> bytes:
    return live().wrap(name, payload)


@pytest.mark.parametrize(("name", "values", "data"), CASES)
def test_both_ways(name: str, values: dict[str, Raw], data: str) -> None:
    payload, wire = payload_of(name), bytes.fromhex(data)
    assert pack(payload, values) == wire
    assert unpack(payload, wire) == values
    assert module().MESSAGES[name].from_bytes(wire).to_bytes() == wire
    assert live().payload(name, values) == wire
    assert live().parse(name.partition(".")[2], frame(name, wire)).fields == live().messages[name].parse(wire)


@pytest.mark.parametrize(("name", "data", "kind"), WRONG)
def test_wrong_payloads(name: str, data: str, kind: str) -> None:
    wire = bytes.fromhex(data)
    with pytest.raises(BadContent) as caught:
        unpack(payload_of(name), wire)
    assert caught.value.kind == kind
    with pytest.raises(module().DecodeError) as refused:
        module().MESSAGES[name].from_bytes(wire)
    assert refused.value.kind == kind
    with pytest.raises(ConstructError):
        live().messages[name].parse(wire)


def test_faults_name_the_record() -> None:
    with pytest.raises(BadContent) as caught:
        unpack(payload_of("open.response"), bytes.fromhex("01 0902 00 0003AA 01 0902"))
    assert (caught.value.field, caught.value.offset) == ("pairs[1].first.kind", 4)
    wire = bytes.fromhex("01 0902 00 0003AA 01 0902")
    with pytest.raises(module().DecodeError) as refused:
        module().MESSAGES["open.response"].from_bytes(wire)
    assert (refused.value.field, refused.value.offset) == ("pairs[1].first.kind", 4)


def test_encoders_refuse_a_wrong_last_record() -> None:
    kind = module().MESSAGES["open.response"]
    pairs = [module().Pair(first=module().Option(kind=1))] * 2
    for more in ([], [0, 0], [1, 1], [1, 1, 1]):
        number = [module().Digits(more=each == 1) for each in more]
        with pytest.raises(module().EncodeError, match="number"):
            kind(number=number, pairs=pairs).to_bytes()
        raws: Raw = [{"value": 0, "more": each} for each in more]
        with pytest.raises(Unsendable):
            pack(payload_of("open.response"), {"number": raws, "pairs": [SHORT, SHORT]})


def test_encoders_refuse_more_than_the_frame_allows() -> None:
    long: dict[str, Raw] = {"kind": 1, "value": bytes(8)}
    assert payload_of("counted.request").most == 24
    with pytest.raises(Unsendable):
        pack(payload_of("counted.request"), {"options": [long, long, long], "end": 1})
    options = [module().Option(kind=1, value=bytes(8))] * 3
    with pytest.raises(module().EncodeError):
        module().MESSAGES["counted.request"](options=options).to_bytes()
    with pytest.raises(ConstructError):
        live().payload("counted.request", {"options": [{"kind": 1, "value": bytes(8)}] * 3, "end": 1})


def test_sizes_follow_from_the_beginning() -> None:
    payload = payload_of("counted.request")
    with pytest.raises(MoreNeeded) as more:
        measure(payload, bytes.fromhex("02 0103AA"))
    assert more.value.needed == 6
    assert measure(payload, bytes.fromhex("02 0103AA 0902")) == 7
    assert measure(payload_of("counted.response"), b"\x06") == 7
    with pytest.raises(BadContent):
        measure(payload, bytes.fromhex("04 0101"))


def test_dissection_names_the_records() -> None:
    wire = frame("open.response", bytes.fromhex("81 02 0902 00 0103AA 01 0902"))
    spans = dissect(plan_of(protocol()), wire, "response").spans
    inside = [each.inside for each in spans if each.inside]
    assert "number[1]." in inside
    assert "pairs[1].second." in inside
