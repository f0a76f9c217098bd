"""Records of variable size, and arrays that end with a record: interpreter, generated Python, construct."""

from __future__ import annotations

import pytest
from construct import ConstructError

from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, MoreNeeded, Raw, Unsendable, measure, pack
from qlinkgen.plan.dissect import dissect
from tests.records.targets import Targets

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
TARGETS = Targets(SCHEMA)


@pytest.mark.parametrize(("name", "values", "data"), CASES)
def test_both_ways(name: str, values: dict[str, Raw], data: str) -> None:
    wire = bytes.fromhex(data)
    TARGETS.check_both_ways(name, values, wire)
    live = TARGETS.live
    assert live.payload(name, values) == wire
    frame = live.wrap(name, wire)
    assert live.parse(name.partition(".")[2], frame).fields == live.messages[name].parse(wire)


@pytest.mark.parametrize(("name", "data", "kind"), WRONG)
def test_wrong_payloads(name: str, data: str, kind: str) -> None:
    TARGETS.check_refused(name, bytes.fromhex(data), kind)


def test_faults_name_the_record() -> None:
    TARGETS.check_fault_at(
        "open.response", bytes.fromhex("01 0902 00 0003AA 01 0902"), "pairs[1].first.kind", 4
    )


def test_encoders_refuse_a_wrong_last_record() -> None:
    kind = TARGETS.module.MESSAGES["open.response"]
    pairs = [TARGETS.module.Pair(first=TARGETS.module.Option(kind=1))] * 2
    for more in ([], [0, 0], [1, 1], [1, 1, 1]):
        number = [TARGETS.module.Digits(more=each == 1) for each in more]
        with pytest.raises(TARGETS.module.EncodeError, match="number"):
            kind(number=number, pairs=pairs).to_bytes()
        raws: Raw = [{"value": 0, "more": each} for each in more]
        with pytest.raises(Unsendable):
            pack(TARGETS.payload("open.response"), {"number": raws, "pairs": [SHORT, SHORT]})


def test_encoders_refuse_more_than_the_frame_allows() -> None:
    long: dict[str, Raw] = {"kind": 1, "value": bytes(8)}
    assert TARGETS.payload("counted.request").most == 24
    with pytest.raises(Unsendable):
        pack(TARGETS.payload("counted.request"), {"options": [long, long, long], "end": 1})
    options = [TARGETS.module.Option(kind=1, value=bytes(8))] * 3
    with pytest.raises(TARGETS.module.EncodeError):
        TARGETS.module.MESSAGES["counted.request"](options=options).to_bytes()
    with pytest.raises(ConstructError):
        TARGETS.live.payload("counted.request", {"options": [{"kind": 1, "value": bytes(8)}] * 3, "end": 1})


def test_sizes_follow_from_the_beginning() -> None:
    payload = TARGETS.payload("counted.request")
    with pytest.raises(MoreNeeded) as more:
        measure(payload, bytes.fromhex("02 0103AA"))
    assert more.value.needed == 6
    assert measure(payload, bytes.fromhex("02 0103AA 0902")) == 7
    assert measure(TARGETS.payload("counted.response"), b"\x06") == 7
    with pytest.raises(BadContent):
        measure(payload, bytes.fromhex("04 0101"))


def test_dissection_names_the_records() -> None:
    wire = TARGETS.live.wrap("open.response", bytes.fromhex("81 02 0902 00 0103AA 01 0902"))
    spans = dissect(plan_of(TARGETS.protocol), wire, "response").spans
    inside = [each.inside for each in spans if each.inside]
    assert "number[1]." in inside
    assert "pairs[1].second." in inside
