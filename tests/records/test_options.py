"""Choices and terminated texts in records, and counts of choices, in the interpreter and generated code."""

from __future__ import annotations

import pytest

from qlinkgen.plan.content import Raw, Unsendable, measure, pack
from tests.records.targets import Targets

SCHEMA = """
qlinkgen: 1
protocol: {name: chosen, title: Chosen, revision: "1", source: Example}
byteorder: big
types:
  option:
    fields:
      kind: u8
      size: {type: u8, counts: [kind, size, value]}
      value:
        switch: kind
        cases:
          1: {mru: {type: u16, range: 64..1500}}
          5: u32
          6: {}
          7: "u16[0..2]"
          8: {number: u8, name: {type: "text[1..4]", terminator: 00}}
        default: "bytes[0..4]"
  tail: {fields: {first: u8, rest: "bytes[0..4]", last: u8}}
  advert:
    fields:
      size: {type: u8, counts: [tag, data]}
      tag: u8
      data: {switch: tag, cases: {1: u8}, default: bytes}
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
  options:
    id: 1
    request: {options: "option[0..5]"}
    response: {size: {type: u8, counts: options, counts_in: bytes}, options: "option[0..5]", end: u8}
  adverts:
    id: 2
    request: {adverts: "advert[0..9]"}
    response: {number: u8, tail: tail}
  values:
    id: 3
    request: {}
    response:
      kind: u8
      size: {type: u8, counts: value}
      value: {switch: kind, cases: {1: u16, 2: option}, default: {}}
      end: u8
"""
TAIL: Raw = {"first": 1, "rest": b"\x02\x03", "last": 4}
MRU: dict[str, Raw] = {"kind": 1, "value": {"mru": 1500}}
MAGIC: dict[str, Raw] = {"kind": 5, "value": 7}
NAMED: dict[str, Raw] = {"kind": 8, "value": {"number": 2, "name": b"ab"}}
OTHER: dict[str, Raw] = {"kind": 9, "value": b"\xaa"}
CASES: list[tuple[str, dict[str, Raw], str]] = [
    ("options.request", {"options": [MRU, MAGIC, OTHER]}, "0104 05DC 0506 00000007 0903 AA"),
    ("options.request", {"options": [NAMED, {"kind": 6, "value": None}]}, "0806 02 616200 0602"),
    ("options.response", {"options": [{"kind": 7, "value": [1, 2]}], "end": 3}, "06 0706 0001 0002 03"),
    ("adverts.request", {"adverts": [{"tag": 1, "data": 4}, {"tag": 9, "data": b""}]}, "02 01 04 01 09"),
    ("adverts.response", {"number": 9, "tail": TAIL}, "09 01 0203 04"),
    ("values.response", {"kind": 2, "value": MRU, "end": 3}, "02 04 0104 05DC 03"),
    ("values.response", {"kind": 7, "value": None, "end": 3}, "07 00 03"),
]
WRONG = [
    ("options.request", "0103 05", "length"),
    ("options.request", "0105 05DC 00", "length"),
    ("options.request", "0105 0000 00", "range"),
    ("options.request", "0104 0000", "range"),
    ("options.request", "0105 05DC", "length"),
    ("options.request", "0603 00", "length"),
    ("options.request", "0705 0001 00", "length"),
    ("options.request", "0805 02 6162 00", "length"),
    ("options.request", "0806 02 00 6162", "length"),
    ("options.request", "0101", "length"),
    ("options.request", "0907 0000000000", "length"),
    ("options.response", "05 0706 0001 0002 03", "length"),
    ("adverts.response", "09 01", "length"),
    ("adverts.response", "09 01 0203 0405 06 07", "length"),
    ("values.response", "07 01 00 03", "length"),
    ("values.response", "02 05 0104 05DC 03", "length"),
]
TARGETS = Targets(SCHEMA)


@pytest.mark.parametrize(("name", "values", "data"), CASES)
def test_both_ways(name: str, values: dict[str, Raw], data: str) -> None:
    TARGETS.check_both_ways(name, values, bytes.fromhex(data))


def test_sizes_follow_from_the_beginning() -> None:
    assert measure(TARGETS.payload("values.response"), b"\x02\x04") == 7


@pytest.mark.parametrize(("name", "data", "kind"), WRONG)
def test_wrong_payloads(name: str, data: str, kind: str) -> None:
    TARGETS.check_refused(name, bytes.fromhex(data), kind)


def test_faults_name_the_choice_in_its_record() -> None:
    TARGETS.check_fault_at("options.request", bytes.fromhex("0602 0104 0000"), "options[1].value.mru", 4)


def test_encoders_refuse_the_value_of_another_case() -> None:
    option = TARGETS.module.Option
    with pytest.raises(TARGETS.module.EncodeError, match="value"):
        option(kind=1, value=5).to_bytes()
    with pytest.raises(TARGETS.module.EncodeError, match="value"):
        option(kind=6, value=5).to_bytes()
    with pytest.raises(Unsendable) as caught:
        pack(TARGETS.payload("options.request"), {"options": [MRU, {"kind": 6, "value": 5}]})
    assert caught.value.field == "options[1].value"
