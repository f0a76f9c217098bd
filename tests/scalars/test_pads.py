"""Padded bytes and text: a constant size on the wire, values without the byte that fills them up."""

from __future__ import annotations

from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import c, construct, python
from qlinkgen.backends.base import Options
from qlinkgen.cli.codec import build, fields
from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, Unsendable, pack, unpack
from tests.scalars.protocols import faults_of, protocol_of

REQUEST = """
      name: {type: "text[6]", pad: 00}
      label: {type: "text[4]", pad: 20, default: ab}
      key: {type: "bytes[3]", pad: FF}
      last: u8
"""
VALUES: dict[str, Any] = {"name": "x\0y", "label": "", "key": b"\0", "last": 7}
PAYLOAD = bytes.fromhex("780079000000 20202020 00ffff 07")


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
    assert unpack(plan, PAYLOAD)["name"] == b"x\0y"
    assert pack(plan, unpack(plan, PAYLOAD)) == PAYLOAD


def test_defaults(codec: Any) -> None:
    """Nothing but the pad, or a default that is shorter than the field."""
    made = codec.PutRequest(last=0)
    assert (made.name, made.label, made.key) == ("", "ab", b"")
    assert made.to_bytes() == bytes.fromhex("000000000000 61622020 ffffff 00")


def test_a_full_field_has_no_pad(codec: Any) -> None:
    made = codec.PutRequest(**VALUES | {"name": "abcdef", "key": b"abc"})
    assert codec.PutRequest.from_bytes(made.to_bytes()) == made


@pytest.mark.parametrize(
    ("field", "value"),
    [("name", "abcdefg"), ("name", "a\0"), ("name", "\xe4"), ("name", b"a"), ("label", " "), ("key", b"\xff"),
     ("key", b"abcd"), ("key", "a")],
)  # fmt: skip
def test_what_cannot_be_sent(codec: Any, field: str, value: object) -> None:
    with pytest.raises(codec.EncodeError) as caught:
        codec.PutRequest(**VALUES | {field: value}).to_bytes()
    assert caught.value.field == field
    with pytest.raises((ConstructError, TypeError)):
        construct.live(protocol_of(REQUEST)).payload("put.request", VALUES | {field: value})


def test_the_interpreter_refuses_values_that_end_with_the_pad() -> None:
    plan = plan_of(protocol_of(REQUEST)).message("put").payload
    for wrong in (b"a\0", b"\0", b"abcdefg"):
        with pytest.raises(Unsendable):
            pack(plan, {"name": wrong, "last": 0})


def test_text_has_seven_bits(codec: Any) -> None:
    with pytest.raises(codec.DecodeError) as caught:
        codec.PutRequest.from_bytes(b"\x80" + PAYLOAD[1:])
    assert (caught.value.kind, caught.value.field) == ("range", "name")
    with pytest.raises(BadContent):
        unpack(plan_of(protocol_of(REQUEST)).message("put").payload, b"\x80" + PAYLOAD[1:])


def test_json(codec: Any) -> None:
    protocol = protocol_of(REQUEST)
    message = protocol.message("put")
    made = build(codec, message, {"name": "abc", "key": "01 02", "last": 1}, {})
    assert fields(message, codec.PutRequest.from_bytes(made.to_bytes())) == {
        "name": "abc", "label": "ab", "key": "0102", "last": 1,
    }  # fmt: skip


def test_a_struct_in_c_has_all_bytes() -> None:
    (header,) = c.generate(protocol_of(REQUEST), Options()).values()
    assert "uint8_t name[6]; /* 7-bit characters; filled up with 0x00 */" in header
    assert "{0x61U, 0x62U, 0x20U, 0x20U}, {0xFFU, 0xFFU, 0xFFU}" in header


@pytest.mark.parametrize(
    ("field", "text"),
    [
        ('{type: "text[0..4]", pad: 00}',
         "'pad' has no effect on text of variable size; write a constant size, like text[16]"),
        ("{type: text, pad: 00}",
         "'pad' has no effect on text of variable size; write a constant size, like text[16]"),
        ('{type: "text[4]", pad: FF}', "the pad is not one 7-bit character; write one, like 00 or 20"),
        ('{type: "bytes[4]", pad: 00 00}', "the pad is not one byte; write one, like 00 or 20"),
        ('{type: "u8[4]", pad: 00}', "'pad' has no effect on numbers; remove it"),
        ('{type: "text[2]", pad: 00, default: abc}', "the default has 3 bytes; it must fit text[2]"),
    ],
)  # fmt: skip
def test_wrong_keys(field: str, text: str) -> None:
    assert text in [f"{fault.message}; {fault.hint}" for fault in faults_of(f"{{a: {field}}}")]
