"""Records of which the last one takes all bytes that are left: interpreter, generated Python, construct."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.plan.content import Raw, Unsendable, pack
from tests.records.targets import Targets

SCHEMA = """
qlinkgen: 1
protocol: {name: resting, title: Resting, revision: "1", source: Example}
byteorder: big
types:
  item:
    fields:
      kind: u8
      size: {type: u8, counts: value, if: {kind: not 255}}
      value: {type: "bytes[0..8]", if: {kind: not 255}}
      rest: {type: "bytes[0..20]", if: {kind: 255}}
  tail:
    fields:
      kind: {type: u8, range: 0..2}
      value: {switch: kind, cases: {0: {}, 1: u16, 2: {mark: u8, rest: "u16[0..4]"}}}
  group: {fields: {flag: bool, item: {type: item, if: flag}}}
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
    request: {items: "item[0..4]", end: u8}
    response: {size: {type: u8, counts: items, counts_in: bytes}, items: "item[2..4]", end: u16}
  tell:
    id: 2
    request: {count: {type: u8, counts: tails}, tails: "tail[0..3]"}
    response: {n: u8, tails: {type: "tail[1..3]", last: {kind: [0, 2]}}}
  deep:
    id: 3
    request: {groups: "group[2]"}
    response: {groups: "group[1..3]", end: u8}
"""
A: dict[str, Raw] = {"kind": 1, "value": b"\xaa", "rest": None}
REST: dict[str, Raw] = {"kind": 255, "value": None, "rest": b"\x01\x02"}
EMPTY: dict[str, Raw] = {"kind": 255, "value": None, "rest": b""}
WORD: dict[str, Raw] = {"kind": 1, "value": 258}
LIST: dict[str, Raw] = {"kind": 2, "value": {"mark": 7, "rest": [3, 4]}}
NONE: dict[str, Raw] = {"kind": 0, "value": None}
CASES: list[tuple[str, dict[str, Raw], str]] = [
    ("put.request", {"items": [A, REST], "end": 9}, "01 01 AA FF 01 02 09"),
    ("put.request", {"items": [A, A], "end": 9}, "01 01 AA 01 01 AA 09"),
    ("put.response", {"items": [A, EMPTY], "end": 9}, "04 01 01 AA FF 00 09"),
    ("tell.request", {"tails": [WORD, NONE, LIST]}, "03 01 01 02 00 02 07 00 03 00 04"),
    ("tell.response", {"n": 5, "tails": [WORD, LIST]}, "05 01 01 02 02 07 00 03 00 04"),
    (
        "deep.request",
        {"groups": [{"flag": 1, "item": A}, {"flag": 1, "item": REST}]},
        "01 01 01 AA 01 FF 01 02",
    ),
    (
        "deep.response",
        {"groups": [{"flag": 0, "item": None}, {"flag": 1, "item": EMPTY}], "end": 4},
        "00 01 FF 04",
    ),
]
WRONG = [
    ("put.response", "02 01 00 00 09", "length"),
    ("tell.request", "02 02 07 00 03 00 04", "length"),
    ("tell.request", "01 02 07 00 03 00", "length"),
    ("tell.response", "05 00 00", "length"),
    ("deep.request", "01 FF 01 02 00", "length"),
]
#: Records of which one takes the rest, and another follows it.
UNSENT: list[tuple[str, dict[str, Raw], str]] = [
    ("put.request", {"items": [EMPTY, A], "end": 9}, "items"),
    ("put.response", {"items": [A, REST, A], "end": 9}, "items"),
    ("tell.request", {"tails": [LIST, NONE]}, "tails"),
    ("tell.response", {"n": 5, "tails": [LIST, NONE]}, "tails"),
    ("deep.request", {"groups": [{"flag": 1, "item": REST}, {"flag": 0, "item": None}]}, "groups"),
]
TARGETS = Targets(SCHEMA)
#: Classes of the records in fields.
CLASSES = {"items": "Item", "item": "Item", "tails": "Tail", "groups": "Group", "value": "TailValueCase2"}


def _native(values: Mapping[str, Raw]) -> dict[str, Any]:
    """The arguments of a class for raw values."""
    return {name: _record(name, raw) for name, raw in values.items()}


def _record(name: str, raw: Any) -> Any:
    if isinstance(raw, list):
        return [_record(name, each) for each in raw]
    return getattr(TARGETS.module, CLASSES[name])(**_native(raw)) if isinstance(raw, Mapping) else raw


@pytest.mark.parametrize(("name", "values", "data"), CASES)
def test_both_ways(name: str, values: dict[str, Raw], data: str) -> None:
    wire = bytes.fromhex(data)
    TARGETS.check_both_ways(name, values, wire)
    live = TARGETS.live
    assert live.payload(name, values) == wire
    assert live.parse(name.partition(".")[2], live.wrap(name, wire)).fields == live.messages[name].parse(wire)


def test_defaults_of_records_inside_of_others_are_known() -> None:
    payload = TARGETS.payload("deep.request")
    assert pack(payload, {"groups": [{"flag": 1, "item": {}}, {"flag": 1, "item": {}}]}).hex() == "010000" * 2


@pytest.mark.parametrize(("name", "data", "kind"), WRONG)
def test_wrong_payloads(name: str, data: str, kind: str) -> None:
    TARGETS.check_refused(name, bytes.fromhex(data), kind)


@pytest.mark.parametrize(("name", "values", "field"), UNSENT)
def test_encoders_refuse_records_after_the_rest(name: str, values: dict[str, Raw], field: str) -> None:
    with pytest.raises(Unsendable, match=field):
        pack(TARGETS.payload(name), values)
    with pytest.raises(TARGETS.module.EncodeError, match=field) as error:
        TARGETS.module.MESSAGES[name](**_native(values)).to_bytes()
    assert "only the last one" in str(error.value)
    with pytest.raises(ConstructError):
        TARGETS.live.payload(name, values)
