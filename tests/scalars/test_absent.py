"""Fields of every kind that may be absent."""

from __future__ import annotations

from typing import Any

import pytest

from qlinkgen.backends import construct, python
from tests.scalars.protocols import protocol_of

FIELDS: dict[str, tuple[Any, str]] = {
    "f32": (2.0, "40000000"),
    "{type: f64, byteorder: little, range: 0..1}": (0.5, "000000000000e03f"),
    '"f32[2]"': ([1.0, -2.0], "3f800000c0000000"),
    "{type: u16, as: bcd}": (1234, "1234"),
    '{type: "text[4]", pad: 00}': ("ab", "61620000"),
    "u72": (1 << 70, "400000000000000000"),
    '{type: "bool[9]", packed: most}': ([True] * 9, "ff80"),
    '{type: "u16[2]", scale: 1/2}': ([0.5, 1.0], "00010002"),
}


@pytest.mark.parametrize("field", FIELDS)
def test_present_or_absent(field: str) -> None:
    value, data = FIELDS[field]
    conditional = field[:-1] if field[0] == "{" else f"{{type: {field}"
    protocol = protocol_of(f"{{k: u8, a: {conditional}, if: {{k: 1}}}}, z: u8}}")
    codec, live = python.load(protocol), construct.live(protocol)
    for k, given, payload in ((1, value, f"01{data}05"), (0, None, "0005")):
        values = {"k": k, "a": given, "z": 5}
        made = codec.PutRequest(**values)
        assert made.to_bytes().hex() == payload == live.payload("put.request", values).hex()
        assert codec.PutRequest.from_bytes(bytes.fromhex(payload)) == made
        parsed = live.messages["put.request"].parse(bytes.fromhex(payload))
        assert {name: parsed[name] for name in values} == values


def test_an_optional_field_after_optional_bits() -> None:
    codec = python.load(
        protocol_of(
            "{head: {type: u8, bits: {a: 0..3, b: 4..7}, optional: true}, z: {type: u8, optional: true}}"
        )
    )
    assert codec.PutRequest(a=1, b=2, z=3).to_bytes() == bytes.fromhex("2103")
    assert codec.PutRequest(a=1, b=2, z=None).to_bytes() == bytes.fromhex("21")
    with pytest.raises(codec.EncodeError):
        codec.PutRequest(a=None, b=None, z=3).to_bytes()
