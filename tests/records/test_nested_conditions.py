"""Conditions on values that may be absent themselves: interpreter, generated Python, construct."""

from __future__ import annotations

import pytest
from construct import ConstructError

from qlinkgen.plan.content import BadContent, MoreNeeded, Raw, Unsendable, measure, pack
from tests.records.targets import Targets

SCHEMA = """
qlinkgen: 1
protocol: {name: nested, title: Nested, revision: "1", source: Example}
byteorder: big
types:
  item:
    fields:
      head: {type: u8, bits: {size: 0..3, stored: 7}}
      vif: {type: u8, bits: {unit: 0..6, more: 7}, if: {size: not 15}}
      text_size: {type: u8, counts: text, if: {vif.unit: 0x7C}}
      text: {type: "text[0..4]", if: {unit: 0x7C}}
      vife: {type: u8, range: 0..9, if: vif.more}
      rest: {type: "bytes[0..10]", if: {size: 15}}
frame:
  parts:
    sync: B5 62
    length: {type: u16, counts: data}
    number: {role: message, type: u8}
    data: {role: payload, size: 0..40}
    check: {type: u16, algorithm: crc-16/modbus, over: [length, number, data]}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands:
  put:
    id: 1
    request:
      mode: u8
      level: {type: i8, if: {mode: 1..9}}
      limit: {type: u16, if: {level: not 0..5}}
      end: u8
    response: {items: "item[0..3]"}
  tell:
    id: 2
    request:
      flag: bool
      kind: {type: u8, range: 0..3, if: flag}
      value: {switch: kind, cases: {0: {}, 1: u16, 2..3: {a: u8, b: i16}}}
    response:
      flag: bool
      kind: {type: u8, if: flag}
      size: {type: u8, counts: value}
      value: {switch: kind, cases: {1: u16}, default: "bytes[0..9]"}
      end: u8
"""
NONE: dict[str, Raw] = {"size": 15, "stored": 0, "unit": None, "more": None, "text": None, "vife": None}
PLAIN: dict[str, Raw] = {
    "size": 0,
    "stored": 0,
    "unit": 1,
    "more": 0,
    "text": None,
    "vife": None,
    "rest": None,
}
FULL: dict[str, Raw] = {
    "size": 0,
    "stored": 1,
    "unit": 0x7C,
    "more": 1,
    "text": b"ab",
    "vife": 7,
    "rest": None,
}
CASES: list[tuple[str, dict[str, Raw], str]] = [
    ("put.request", {"mode": 0, "level": None, "limit": None, "end": 9}, "00 09"),
    ("put.request", {"mode": 1, "level": 3, "limit": None, "end": 9}, "01 03 09"),
    ("put.request", {"mode": 1, "level": -1, "limit": 258, "end": 9}, "01 FF 01 02 09"),
    ("put.response", {"items": [PLAIN, FULL, {**NONE, "rest": b"\1"}]}, "00 01 80 FC 02 61 62 07 0F 01"),
    ("tell.request", {"flag": 0, "kind": None, "value": None}, "00"),
    ("tell.request", {"flag": 1, "kind": 0, "value": None}, "01 00"),
    ("tell.request", {"flag": 1, "kind": 3, "value": {"a": 4, "b": -2}}, "01 03 04 FF FE"),
    ("tell.response", {"flag": 0, "kind": None, "value": None, "end": 7}, "00 00 07"),
    ("tell.response", {"flag": 1, "kind": 5, "value": b"\1\2", "end": 7}, "01 05 02 01 02 07"),
]
WRONG = [
    ("put.request", "00 03 09", "length"),
    ("put.request", "01 06 09", "length"),
    ("put.response", "00 7C", "length"),
    ("put.response", "00 81 0A", "range"),
    ("tell.request", "00 01 00 01", "length"),
    ("tell.response", "00 01 02 07", "length"),
]
#: Values that are given where they must be absent, or the reverse.
UNSENT: list[tuple[str, dict[str, Raw]]] = [
    ("put.request", {"mode": 0, "level": None, "limit": 1, "end": 9}),
    ("put.request", {"mode": 1, "level": None, "limit": None, "end": 9}),
    ("put.request", {"mode": 0, "level": 7, "limit": 1, "end": 9}),
    ("tell.request", {"flag": 0, "kind": None, "value": 5}),
    ("tell.request", {"flag": 1, "kind": None, "value": None}),
    ("tell.request", {"flag": 1, "kind": 1, "value": None}),
]
TARGETS = Targets(SCHEMA)


@pytest.mark.parametrize(("name", "values", "data"), CASES)
def test_both_ways(name: str, values: dict[str, Raw], data: str) -> None:
    TARGETS.check_both_ways(name, values, bytes.fromhex(data))


@pytest.mark.parametrize(("name", "data", "kind"), WRONG)
def test_wrong_payloads(name: str, data: str, kind: str) -> None:
    TARGETS.check_refused(name, bytes.fromhex(data), kind)


@pytest.mark.parametrize(("name", "values"), UNSENT)
def test_encoders_refuse_absent_values(name: str, values: dict[str, Raw]) -> None:
    with pytest.raises(Unsendable):
        pack(TARGETS.payload(name), values)
    with pytest.raises(TARGETS.module.EncodeError):
        TARGETS.module.MESSAGES[name](**values).to_bytes()
    with pytest.raises(ConstructError):
        TARGETS.live.payload(name, values)


def test_sizes_follow_from_the_beginning() -> None:
    payload = TARGETS.payload("put.request")
    assert measure(payload, b"\0") == 2
    with pytest.raises(MoreNeeded):
        measure(payload, b"\1")
    assert measure(payload, b"\1\3") == 3
    assert measure(payload, b"\1\6") == 5
    with pytest.raises(BadContent):
        measure(TARGETS.payload("tell.response"), b"\0\x10")


def test_the_greatest_size_is_that_of_fields_which_can_be_together() -> None:
    assert TARGETS.payload("tell.request").most == 5
    assert TARGETS.payload("put.request").most == 5
