"""A size by name says what a count says."""

from __future__ import annotations

from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import loads

SCHEMA = """
qlinkgen: 1
protocol: {name: store, revision: "1", source: Example}
types: {point: {fields: {x: i16, y: i16}}}
frame:
  parts:
    sync: B5 62
    length: {type: u16, counts: [data]}
    number: {role: message, type: u8}
    data: {role: payload, size: 0..64}
    check: {type: u16, algorithm: crc-16/modbus, over: [length, number, data]}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands:
  store: {id: 1, request: {%s}, response: {}}
"""
NAMED = """
 number: {type: u8, range: 1..4}, level: u8, size: u8, points: "point[number]",
 name: "text[size]", many: {type: u8, range: 0..8}, rest: {type: "u16[many]", range: 0..9}
"""
COUNTED = """
 number: {type: u8, counts: points}, level: u8, size: {type: u8, counts: name}, points: "point[1..4]",
 name: text, many: {type: u8, counts: rest}, rest: {type: "u16[0..8]", range: 0..9}
"""


def _protocol(fields: str) -> Protocol:
    found, faults = loads(SCHEMA % fields, "store.yaml")
    assert found is not None, faults
    return found


def test_size_by_name_is_a_count() -> None:
    assert _protocol(NAMED).commands == _protocol(COUNTED).commands
