"""Numbers as text of a constant size: signs, decimal points, hexadecimal digits of either case."""

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
      weight: {type: i32, as: "decimal[8]", scale: 1/100, unit: kg}
      code: {type: u16, as: "hex[4]"}
      mode: {type: u8, as: "decimal[2]", const: 7}
      on: {type: bool, as: "decimal[1]"}
      levels: {type: "u8[2]", as: "decimal[3]", range: 0..200}
      count: {type: u8, counts: more}
      more: {type: "i16[0..3]", as: "decimal[4]"}
      gap: {type: u8, as: "hex[2]", reserved: true}
      big: {type: u64, as: "decimal[20]", default: 12345678901234567890}
      odd: {type: i24, as: "decimal[5]", default: -42}
"""
VALUES: dict[str, Any] = {
    "weight": -12.3, "code": 0xBEEF, "on": True, "levels": [7, 200], "more": [-123, 4567],
    "big": 12345678901234567890, "odd": -42,
}  # fmt: skip
PAYLOAD = b"-0012.30BEEF071007200\x02-123456700" + b"12345678901234567890" + b"-0042"


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
    ("field", "text", "value"),
    [
        ("weight", b"+0012.30", 12.3),
        ("weight", b"0012.300", 12.3),
        ("weight", b"000012.3", 12.3),
        ("weight", b"-0000012", -12.0),
        ("weight", b"-0000.00", 0.0),
        ("weight", b"0000.120", 0.12),
        ("weight", b"-.120000", -0.12),
        ("weight", b"0000012.", 12.0),
        ("code", b"beEf", 0xBEEF),
        ("odd", b"+0042", 42),
    ],
)
def test_other_texts_of_a_number(codec: Any, field: str, text: bytes, value: object) -> None:
    payload = replaced(field, text)
    assert getattr(codec.PutRequest.from_bytes(payload), field) == value
    assert construct.live(protocol_of(REQUEST)).messages["put.request"].parse(payload)[field] == value
    plan = plan_of(protocol_of(REQUEST)).message("put").payload
    assert pack(plan, unpack(plan, payload)) == PAYLOAD or value not in VALUES.values()


@pytest.mark.parametrize(
    ("field", "text"),
    [
        ("weight", b"00012.34"[:7] + b"x"),
        ("weight", b"0012.345"),
        ("weight", b"001.2.30"),
        ("weight", b" 0012.30"),
        ("weight", b"-+012.30"),
        ("weight", b"........"),
        ("code", b"+EEF"),
        ("code", b"BEEG"),
        ("on", b"2"),
        ("big", b"-0000000000000000001"),
        ("big", b"99999999999999999999"),
        ("odd", b"4_200"),
        ("odd", b"     "),
    ],
)
def test_what_is_no_number_is_out_of_range(codec: Any, field: str, text: bytes) -> None:
    payload = replaced(field, text)
    with pytest.raises(codec.DecodeError) as caught:
        codec.PutRequest.from_bytes(payload)
    assert (caught.value.kind, caught.value.field) == ("range", field)
    with pytest.raises(BadContent) as refused:
        unpack(plan_of(protocol_of(REQUEST)).message("put").payload, payload)
    assert (refused.value.kind, refused.value.field) == ("range", field)
    with pytest.raises(ConstructError):
        construct.live(protocol_of(REQUEST)).messages["put.request"].parse(payload)


def replaced(field: str, text: bytes) -> bytes:
    """The payload with another text of a field."""
    at = {"weight": 0, "code": 8, "on": 14, "big": 32, "odd": 52}[field]
    return PAYLOAD[:at] + text + PAYLOAD[at + len(text) :]


@pytest.mark.parametrize(
    ("field", "value"),
    [("weight", 1e6), ("weight", -10000.0), ("levels", [201, 0]), ("more", [-1000]), ("odd", -10000)],
)
def test_what_cannot_be_sent(codec: Any, field: str, value: object) -> None:
    with pytest.raises(codec.EncodeError) as caught:
        codec.PutRequest(**VALUES | {field: value}).to_bytes()
    assert caught.value.field == field
    with pytest.raises(ConstructError):
        construct.live(protocol_of(REQUEST)).payload("put.request", VALUES | {field: value})


def test_members_in_c() -> None:
    (header,) = c.generate(protocol_of(REQUEST), Options()).values()
    assert "int32_t weight; /* in steps of 1/100 kg; -999999..9999999 */" in header
    assert "if (!probe_is_decimal_(payload, 8U, 2U, 999999ULL, 9999999ULL)) {" in header


@pytest.mark.parametrize(
    ("field", "text"),
    [
        ('{type: i16, as: "hex[4]"}', "'as' has no effect on i16; use an unsigned integer"),
        ('{type: f32, as: "decimal[4]"}',
         ("'as' has no effect on f32; use an integer of up to 64 bits, with a scale such as 1/100, "
          "or as: scientific")),
        ('{type: u128, as: "decimal[4]"}',
         "'as' has no effect on u128; use an integer of up to 64 bits, with a scale such as 1/100"),
        ('{type: u8, as: "decimal[2]", byteorder: little}', "'byteorder' has no effect on text; remove it"),
        ('{type: u8, as: "decimal[2]", offset: 1}',
         "decimal digits do not show u8 in steps of 1 from 1; use a scale such as 1/100 without an offset"),
        ('{type: u8, as: "decimal[2]", default: 100}',
         "'100' does not fit 8 unsigned bits; these hold 0..99; use a wider type or another number"),
        ('{type: u8, as: "decimal[6..2]"}',
         "decimal[6..2] ends before it begins; use 1 to 40 characters, the decimal point included"),
        ('{type: u8, as: "octal[3]"}',
         "'octal[3]' is not a form of a number; use bcd, decimal, decimal[1..6], hex[2] or scientific"),
    ],
)  # fmt: skip
def test_wrong_keys(field: str, text: str) -> None:
    assert text in [f"{fault.message}; {fault.hint}" for fault in faults_of(f"{{a: {field}}}")]


def test_spaces_fill_up_a_number() -> None:
    fields = """{
      weight: {type: i32, as: "decimal[9]", scale: 1/1000, pad: 20},
      list: {type: "u8[2]", as: "decimal[4]", pad: 20, range: 0..200},
      sign: {type: i8, as: "decimal[4]", pad: 20, const: -7}}"""
    protocol = protocol_of(fields)
    plan, live, module = (
        plan_of(protocol).message("put.request").payload,
        construct.live(protocol),
        python.load(protocol),
    )
    values, payload = {"weight": -12.3, "list": [7, 200]}, b"  -12.300   7 200  -7"
    assert module.PutRequest(**values).to_bytes() == payload
    assert live.payload("put.request", values) == payload
    assert pack(plan, {"weight": -12300, "list": [7, 200]}) == payload
    for other in (payload, b"-0012.3000007 200-007"):
        assert module.PutRequest.from_bytes(other) == module.PutRequest(**values)
        assert unpack(plan, other) == {"weight": -12300, "list": [7, 200]}
        assert live.messages["put.request"].parse(other)["weight"] == -12.3
    for wrong in (b"-  12.300   7 200  -7", b"         " + payload[9:], b"12.300   " + payload[9:]):
        with pytest.raises(BadContent, match="range"):
            unpack(plan, wrong)
        with pytest.raises(module.DecodeError):
            module.PutRequest.from_bytes(wrong)
        with pytest.raises(ConstructError):
            live.messages["put.request"].parse(wrong)
