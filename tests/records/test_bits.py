"""Arrays of a named type with bits: interpreter, generated Python, construct."""

from __future__ import annotations

import pytest

from qlinkgen.backends import c
from qlinkgen.plan.content import Raw
from qlinkgen.plan.select import Options
from tests.records.targets import Targets

SCHEMA = """
qlinkgen: 1
protocol: {name: bits, title: Bits, revision: "1", source: Example}
byteorder: big
types:
  extension: {type: u8, bits: {value: 0..6, more: 7}, doc: Seven bits of a long number}
  pair: {type: u16, byteorder: little, bits: {low: {at: 0..3, signed: true}, high: {at: 8..15, scale: 1/2}}}
  alias: {type: pair}
  item:
    fields:
      head: {type: u8, bits: {size: 0..3, extended: 7}}
      tail: {type: "extension[1..3]", last: {more: 0}, if: head.extended}
      level: u8
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
    request: {number: {type: "extension[1..5]", last: {more: 0}}, rest: "pair[]"}
    response: {one: extension, items: "item[0..3]"}
  tell:
    id: 2
    request: {pairs: "alias[2]"}
    response: {count: {type: u8, counts: pairs}, pairs: "pair[0..4]"}
"""
P: dict[str, Raw] = {"low": -1, "high": 3}
CASES: list[tuple[str, dict[str, Raw], str]] = [
    (
        "put.request",
        {"number": [{"value": 5, "more": 1}, {"value": 6, "more": 0}], "rest": [P]},
        "85 06 0F 03",
    ),
    (
        "put.response",
        {
            "value": 1,
            "more": 1,
            "items": [
                {"size": 2, "extended": 0, "tail": None, "level": 7},
                {"size": 3, "extended": 1, "tail": [{"value": 4, "more": 0}], "level": 8},
            ],
        },
        "81 02 07 83 04 08",
    ),
    ("tell.request", {"pairs": [P, {"low": 7, "high": 0}]}, "0F 03 07 00"),
    ("tell.response", {"pairs": [P]}, "01 0F 03"),
]
TARGETS = Targets(SCHEMA)


@pytest.mark.parametrize(("name", "values", "data"), CASES)
def test_both_ways(name: str, values: dict[str, Raw], data: str) -> None:
    TARGETS.check_both_ways(name, values, bytes.fromhex(data))


def test_items_are_records_named_after_their_type() -> None:
    module = TARGETS.module
    message = module.TellRequest(pairs=[module.Alias(low=-1, high=1.5), module.Alias(low=7)])
    assert message.to_bytes() == bytes.fromhex("0F 03 07 00")
    header = c.generate(TARGETS.protocol, Options())["c/bits.h"]
    assert "Seven bits of a long number" in header
    assert "bits_extension_t number[5];" in header


def test_wrong_items() -> None:
    TARGETS.check_refused("put.request", bytes.fromhex("85 86"), "length")
    TARGETS.check_refused("tell.response", bytes.fromhex("02 0F 03"), "length")
