"""Records three levels deep: interpreter, generated Python, construct."""

from __future__ import annotations

import pytest

from qlinkgen.plan.content import Raw
from tests.records.targets import Targets

SCHEMA = """
qlinkgen: 1
protocol: {name: levels, title: Levels, revision: "1", source: Example}
byteorder: big
types:
  point: {fields: {x: u8, y: {type: u8, range: 0..9}}}
  line: {fields: {ends: "point[2]", width: u8}}
  shape: {fields: {first: line, others: "line[1]"}}
  option: {fields: {kind: u8, rest: {type: "bytes[0..4]", if: {kind: 3}}}}
  group: {fields: {size: {type: u8, counts: options, counts_in: bytes}, options: "option[0..2]", end: u8}}
  list: {fields: {count: {type: u8, counts: groups}, groups: "group[0..2]"}}
frame:
  parts:
    sync: B5 62
    length: {type: u16, counts: data}
    number: {role: message, type: u8}
    data: {role: payload, size: 0..60}
    check: {type: u16, algorithm: crc-16/modbus, over: [length, number, data]}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands:
  draw: {id: 1, request: {shapes: "shape[0..3]"}, response: {shape: shape}}
  tell: {id: 2, request: {lists: "list[0..2]", end: u8}, response: {list: list}}
"""
LINE: dict[str, Raw] = {"ends": [{"x": 1, "y": 2}, {"x": 3, "y": 4}], "width": 5}
SHAPE: dict[str, Raw] = {"first": LINE, "others": [LINE]}
GROUP: dict[str, Raw] = {"options": [{"kind": 1, "rest": None}, {"kind": 3, "rest": b"\x07"}], "end": 8}
CASES: list[tuple[str, dict[str, Raw], str]] = [
    ("draw.request", {"shapes": [SHAPE, SHAPE]}, "0102030405 0102030405 0102030405 0102030405"),
    ("draw.response", {"shape": SHAPE}, "0102030405 0102030405"),
    ("tell.request", {"lists": [{"groups": [GROUP]}, {"groups": []}], "end": 9}, "01 03 01 03 07 08 00 09"),
    ("tell.response", {"list": {"groups": [GROUP, GROUP]}}, "02 03 01 03 07 08 03 01 03 07 08"),
]
TARGETS = Targets(SCHEMA)


@pytest.mark.parametrize(("name", "values", "data"), CASES)
def test_both_ways(name: str, values: dict[str, Raw], data: str) -> None:
    TARGETS.check_both_ways(name, values, bytes.fromhex(data))


def test_faults_name_all_records() -> None:
    wrong = bytes.fromhex("0102030405 0102030A05")
    TARGETS.check_fault_at("draw.response", wrong, "shape.others[0].ends[1].y", 8)
    TARGETS.check_refused("tell.response", bytes.fromhex("01 02 01 03 08 08"), "length")
