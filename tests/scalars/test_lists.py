"""Arrays of every kind of number: lists of the values that a single field has."""

from __future__ import annotations

import json
from decimal import Decimal
from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import c, construct, python
from qlinkgen.backends.base import Options
from qlinkgen.cli.codec import build, fields
from tests.proof.outputs import plain_numbers
from tests.scalars.protocols import faults_of, protocol_of

TYPES = """
enums: {gear: {type: u8, values: {low: 1, high: 2}}, depth: {type: i16, values: {deep: -5}}}
flags: {alarm: {type: u8, reserved: zero, values: {high: 0, low: 7}}, loose: {type: u16, values: {on: 3}}}
types:
  celsius: {type: i16, scale: 1/10, unit: degC, range: -40..120, default: 20}
  pair: {type: "gear[2]", default: [low, high]}
"""
REQUEST = """
      gears: "gear[2]"
      pair: pair
      depths: {type: "depth[0..2]", byteorder: little}
      tail: {type: "bool[3]", default: [true, false, true]}
      alarms: "alarm[2]"
      loose: "loose[1]"
      warm: "celsius[2]"
      wide: {type: "u64[1]", scale: 1/10}
      odd: {type: "u24[2]", offset: -5}
      some: {type: "u16[2]", range: 1..8}
"""
VALUES: dict[str, Any] = {
    "gears": [1, 9], "pair": [2, 1], "depths": [-5], "tail": [False, True, True], "alarms": [0x81, 0],
    "loose": [0xFFFF], "warm": [-40.0, 119.9], "wide": [Decimal("0.1")], "odd": [-5, 0], "some": [8, 1],
}  # fmt: skip
PAYLOAD = bytes.fromhex("0109 0201 fbff 000101 8100 ffff fe7004af 0000000000000001 000000000005 00080001")


@pytest.fixture(scope="module")
def codec() -> Any:
    return python.load(protocol_of(REQUEST, types=TYPES))


def test_values(codec: Any) -> None:
    assert codec.PutRequest(**VALUES).to_bytes() == PAYLOAD
    found = codec.PutRequest.from_bytes(PAYLOAD)
    assert {name: getattr(found, name) for name in VALUES} == VALUES
    assert isinstance(found.gears[0], codec.Gear)
    assert type(found.gears[1]) is int
    assert [type(each) for each in (found.tail[0], found.warm[0], found.wide[0])] == [bool, float, Decimal]


def test_structures() -> None:
    live = construct.live(protocol_of(REQUEST, types=TYPES))
    assert live.payload("put.request", VALUES) == PAYLOAD
    assert plain_numbers(live.messages["put.request"].parse(PAYLOAD)) == VALUES


def test_defaults(codec: Any) -> None:
    """A list written at the field, or the default of the named type of the items."""
    made = codec.PutRequest(gears=[1, 1], alarms=[0, 0], loose=[0], wide=[0], odd=[0, 0], some=[1, 1])
    assert (made.pair, made.depths, made.tail, made.warm) == ([1, 2], [], [True, False, True], [20.0, 20.0])
    assert made.pair[0] is codec.Gear.LOW
    with pytest.raises(TypeError):
        codec.PutRequest()


def test_json() -> None:
    protocol = protocol_of(REQUEST, types=TYPES)
    codec, message = python.load(protocol), protocol.message("put")
    given: Any = {
        "gears": ["high", 9], "depths": "deep", "alarms": ["high|low", []], "loose": ["on"], "wide": ["0.1"],
        "warm": [1, "2.5"], "odd": "0 -5", "tail": ["true", 0, 1], "some": [1, 2],
    }  # fmt: skip
    found = codec.PutRequest.from_bytes(build(codec, message, given, {}).to_bytes())
    said = fields(message, found)
    assert said == {
        "gears": ["high", 9], "pair": ["low", "high"], "depths": ["deep"], "tail": [True, False, True],
        "alarms": [0x81, 0], "loose": [8], "warm": [1.0, 2.5], "wide": [Decimal("0.1")], "odd": [0, -5],
        "some": [1, 2],
    }  # fmt: skip
    assert json.dumps(said["tail"]) == "[true, false, true]"


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("alarms", [0, 2]), ("warm", [0, 120.1]), ("some", [0, 1]), ("tail", [0, 2, 0]), ("gears", [1, 256]),
        ("odd", [0, None]), ("depths", [0, 0, 0]), ("wide", [1 << 64]),
    ],
)  # fmt: skip
def test_what_cannot_be_sent(codec: Any, field: str, value: object) -> None:
    with pytest.raises(codec.EncodeError) as caught:
        codec.PutRequest(**VALUES | {field: value}).to_bytes()
    assert caught.value.field == field
    with pytest.raises(ConstructError):
        construct.live(protocol_of(REQUEST, types=TYPES)).payload("put.request", VALUES | {field: value})


@pytest.mark.parametrize(
    ("field", "at", "byte"), [("tail", 8, 2), ("alarms", 9, 2), ("warm", 13, 0x70), ("some", -1, 9)]
)
def test_what_is_refused_when_received(codec: Any, field: str, at: int, byte: int) -> None:
    payload = bytearray(PAYLOAD)
    payload[at] = byte
    with pytest.raises(codec.DecodeError) as caught:
        codec.PutRequest.from_bytes(bytes(payload))
    assert (caught.value.kind, caught.value.field) == ("range", field)


def test_members_in_c() -> None:
    (header,) = c.generate(protocol_of(REQUEST, types=TYPES), Options()).values()
    for member in (
        "probe_gear_t gears[2];",
        "bool tail[3];",
        "probe_celsius_t warm[2];",
        "uint64_t wide[1];",
    ):
        assert member in header
    assert "probe_real_t probe_celsius_physical" in header
    assert "probe_real_t probe_put_request_wide_physical" in header


@pytest.mark.parametrize(
    ("field", "text"),
    [
        ('{type: "gear[2]", default: [low, fast]}', "gear has no 'fast'; it has low and high"),
        ('{type: "celsius[2]", default: [500]}', "'500' is out of range; use -40.0..120.0"),
        ('{type: "u8[2]", default: [true]}', "'true' is not a number; write a number"),
        ('{type: "u8[2]", default: 3}', "'3' is not a list; write a list, like [1, 2]"),
        ('{type: "bool[2]", range: 0..1}', "'range' has no effect on bool; remove it"),
        ('{type: "u8[2]", const: 1}', "'const' has no effect on an array; remove it"),
        (
            '{type: "u8[2]", bits: {b: 0}}',
            "'bits' has no effect on an array; define a type with these bits, and write an array of it",
        ),
    ],
)  # fmt: skip
def test_wrong_keys(field: str, text: str) -> None:
    assert text in [f"{fault.message}; {fault.hint}" for fault in faults_of(f"{{a: {field}}}", types=TYPES)]
