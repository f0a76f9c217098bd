"""Binary-coded decimal: two digits a byte in either byte order, digits above 9, arrays."""

from __future__ import annotations

from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import c, construct, python
from qlinkgen.backends.base import Options
from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, pack, unpack
from tests.scalars.protocols import faults_of, protocol_of

REQUEST = """
      year: {type: u16, as: bcd, range: 2000..2099}
      volume: {type: u32, as: bcd, byteorder: little, scale: 1/100, unit: l}
      mark: {type: u8, as: bcd, const: 42}
      digits: {type: "u24[2]", as: bcd}
      count: {type: u8, counts: swapped}
      swapped: {type: "u16[0..3]", as: bcd, byteorder: little}
      long: {type: u64, as: bcd, default: 1234567890123456}
"""
VALUES: dict[str, Any] = {
    "year": 2026, "volume": 1234.56, "digits": [123456, 7], "swapped": [1299], "long": 1234567890123456,
}  # fmt: skip
PAYLOAD = bytes.fromhex("2026 56341200 42 123456 000007 01 9912 1234567890123456")


@pytest.fixture(scope="module")
def codec() -> Any:
    return python.load(protocol_of(REQUEST))


def test_bytes(codec: Any) -> None:
    live = construct.live(protocol_of(REQUEST))
    assert codec.PutRequest(**VALUES).to_bytes() == PAYLOAD == live.payload("put.request", VALUES)
    found, parsed = codec.PutRequest.from_bytes(PAYLOAD), live.messages["put.request"].parse(PAYLOAD)
    assert {name: getattr(found, name) for name in VALUES} == VALUES
    assert {name: parsed[name] for name in VALUES} == VALUES
    plan = plan_of(protocol_of(REQUEST)).message("put").payload
    assert pack(plan, unpack(plan, PAYLOAD)) == PAYLOAD


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("year", 1999),
        ("volume", 1e6),
        ("volume", -0.01),
        ("digits", [10**6, 0]),
        ("swapped", [10000]),
        ("long", 10**16),
    ],
)
def test_what_cannot_be_sent(codec: Any, field: str, value: object) -> None:
    with pytest.raises(codec.EncodeError) as caught:
        codec.PutRequest(**VALUES | {field: value}).to_bytes()
    assert caught.value.field == field
    with pytest.raises(ConstructError):
        construct.live(protocol_of(REQUEST)).payload("put.request", VALUES | {field: value})


@pytest.mark.parametrize(
    ("field", "at", "byte"),
    [("year", 1, 0x2A), ("year", 0, 0x19), ("volume", 2, 0xF0), ("mark", 6, 0x3C), ("mark", 6, 0x41),
     ("digits", 9, 0x5A), ("swapped", 14, 0xA2), ("long", 22, 0x0F)],
)  # fmt: skip
def test_a_digit_above_9_is_out_of_range(codec: Any, field: str, at: int, byte: int) -> None:
    payload = bytearray(PAYLOAD)
    payload[at] = byte
    with pytest.raises(codec.DecodeError) as caught:
        codec.PutRequest.from_bytes(bytes(payload))
    assert (caught.value.kind, caught.value.field) == ("range", field)
    with pytest.raises(BadContent) as refused:
        unpack(plan_of(protocol_of(REQUEST)).message("put").payload, bytes(payload))
    assert (refused.value.kind, refused.value.field) == ("range", field)
    with pytest.raises(ConstructError):
        construct.live(protocol_of(REQUEST)).messages["put.request"].parse(bytes(payload))


def test_an_empty_array_has_no_digits(codec: Any) -> None:
    made = codec.PutRequest(**VALUES | {"swapped": []})
    assert codec.PutRequest.from_bytes(made.to_bytes()).swapped == []


def test_members_in_c() -> None:
    (header,) = c.generate(protocol_of(REQUEST), Options()).values()
    assert "uint32_t volume; /* in steps of 1/100 l; 0..99999999 */" in header
    assert "if (!probe_is_bcd_(&payload[2], 4U)) {" in header


@pytest.mark.parametrize(
    ("field", "text"),
    [
        ("{type: i16, as: bcd}", "'as' has no effect on i16; use an unsigned integer"),
        ("{type: bool, as: bcd}", "'as' has no effect on bool; use an unsigned integer"),
        ("{type: f32, as: bcd}", "'as' has no effect on f32; use an unsigned integer"),
        ("{type: u8, as: bcd, default: 100}",
         "'100' does not fit 8 unsigned bits; these hold 0..99; use a wider type or another number"),
        ("{type: u8, as: bcd, range: 0..100}",
         "raw values of 0..100 do not fit 8 unsigned bits; these hold 0..99; use a wider type"),
        ("{type: text, as: bcd}", "'as' has no effect on text; remove it"),
        ("{type: u8, as: bcd, bits: {b: 0}}",
         "'as' has no effect on an integer with bits; put it on one of the bit fields, or remove it"),
        ("{type: u14, as: bcd, groups: {bits: 7, first: most}}",
         "'as' has no effect on groups of bits; remove it"),
        ('{type: "u4[2]", as: bcd, packed: most}', "'as' has no effect on bits in a row; remove it"),
        ("{type: u8, as: bdc}", "'bdc' is not a form of a number; did you mean 'bcd'?"),
    ],
)  # fmt: skip
def test_wrong_keys(field: str, text: str) -> None:
    assert text in [f"{fault.message}; {fault.hint}" for fault in faults_of(f"{{a: {field}}}")]


def test_a_count_is_binary() -> None:
    (fault,) = faults_of("{n: {type: u8, as: bcd, counts: a}, a: bytes}")
    assert (fault.rule, fault.message) == ("not-applicable", "'as' has no effect on a count")


def test_keys_with_another_name_in_python() -> None:
    """In a field that holds a record, which may be absent but not in decimal digits."""
    types = "types: {pair: {fields: {x: u8}}}"
    faults = faults_of("{k: u8, a: {type: pair, as: bcd, if: {k: 1}}}", types=types)
    assert [fault.message for fault in faults] == ["'as' has no effect on a record"]
