"""A count of the bytes of several fields, which may be one of them."""

from __future__ import annotations

import pytest

from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, Raw, pack, unpack
from qlinkgen.plan.payload import PayloadPlan
from qlinkgen.schema import loads

SCHEMA = """
qlinkgen: 1
protocol: {name: several, revision: "1", source: Example}
byteorder: big
frame:
  parts:
    sync: B5 62
    length: {type: u16, counts: data}
    number: {role: message, type: u8}
    data: {role: payload, size: 0..64}
    check: {type: u16, algorithm: crc-16/modbus, over: [length, number, data]}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands:
  set:
    id: 1
    request: {code: u8, size: {type: u16, counts: [code, size, levels, end]}, levels: "u16[0..4]", end: u8}
    response:
      {size: {type: u8, counts: [size, row]}, kind: u8, row: "bytes[0..4]", more: {type: u8, if: {kind: 1}}}
"""


def _payload(direction: str) -> PayloadPlan:
    found, faults = loads(SCHEMA, "several.yaml")
    assert found is not None, faults
    return next(each.payload for each in plan_of(found).messages if each.direction == direction)


def test_count_is_filled_and_checked() -> None:
    payload = _payload("request")
    values: dict[str, Raw] = {"code": 7, "levels": [1, 2], "end": 9}
    data = bytes.fromhex("07 0008 0001 0002 09")
    assert pack(payload, values) == data
    assert unpack(payload, data) == values


@pytest.mark.parametrize(
    "data", ["07 0007 0001 0002 09", "07 0003 09", "07 000A 0001 0002 09", "07 0006 0001 0002 09"]
)
def test_wrong_counts_are_wrong_lengths(data: str) -> None:
    with pytest.raises(BadContent, match="length"):
        unpack(_payload("request"), bytes.fromhex(data))


@pytest.mark.parametrize(
    ("data", "right"), [("03 00 AABB", True), ("01 00", True), ("00 00", False), ("02 01 AA 05", True)]
)
def test_walked_payload(data: str, right: bool) -> None:
    payload, wire = _payload("response"), bytes.fromhex(data)
    if right:
        assert pack(payload, unpack(payload, wire)) == wire
    else:
        with pytest.raises(BadContent, match="length: size"):
            unpack(payload, wire)
