"""Texts that a character ends: every output against the reference, and errors."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

from qlinkgen.backends import python
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, Raw, Unsendable, pack, unpack
from qlinkgen.plan.payload import PayloadPlan
from qlinkgen.schema import loads
from tests.support.whole.trial import run_text

SCHEMA = """
qlinkgen: 1
protocol: {name: ended, title: Ended, revision: "1", source: Example, doc: Texts with an end}
byteorder: big
frame:
  parts:
    start: AA 55
    length: {type: u8, counts: [code, data]}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..80}
    sum: {type: u8, algorithm: sum8, over: [length, code, data]}
bus: {kind: master_slave}
defaults: {addressing: none, repeat: safe}
commands:
  describe:
    id: 1
    request:
      kind: u8
      maker: {type: "text[0..8]", terminator: 00}
      name: {type: "text[2..8]", terminator: 0D, default: ab}
      place: {type: "text[0..3]", terminator: 00, if: {kind: 1}}
      number: u16
      rest: bytes
    response: {word: u8, name: {type: "text[1..20]", terminator: 00}}
"""
#: The terminators tell the size of the frame.
UNCOUNTED = """
qlinkgen: 1
protocol: {name: sought, title: Sought, revision: "1", source: Example, doc: Bytes with an end}
byteorder: big
types:
  pair: {fields: {key: {type: "text[1..4]", terminator: "20"}, value: {type: "bytes[0..3]", terminator: FF}}}
frame:
  parts:
    start: AA 55
    code: {role: message, type: u8}
    data: {role: payload, size: 0..80}
    sum: {type: u8, algorithm: sum8, over: [code, data]}
bus: {kind: master_slave}
defaults: {addressing: none, repeat: safe}
commands:
  describe:
    id: 1
    request:
      kind: u8
      key: {type: "bytes[2..5]", terminator: 7E}
      place: {type: "text[1..3]", terminator: 00, if: {kind: 1}}
      number: u16
    response:
      count: {type: u8, counts: pairs}
      pairs: "pair[0..3]"
      name: {type: "text[1..20]", terminator: 00}
"""
VALUES: dict[str, Raw] = {
    "kind": 1, "maker": b"hi", "name": b"abc", "place": b"", "number": 3, "rest": b"zz",
}  # fmt: skip
PAYLOAD = b"\x01hi\0abc\r\0\0\x03zz"


@cache
def protocol() -> Protocol:
    found, faults = loads(SCHEMA, "ended.yaml")
    assert found is not None, faults
    return found


@cache
def module() -> Any:
    return python.load(protocol())


def payload() -> PayloadPlan:
    return plan_of(protocol()).message("describe.request").payload


def test_texts_follow_each_other() -> None:
    assert pack(payload(), VALUES) == PAYLOAD
    assert unpack(payload(), PAYLOAD) == VALUES
    message = module().DescribeRequest.from_bytes(PAYLOAD)
    assert (message.maker, message.name, message.place, message.rest) == ("hi", "abc", "", b"zz")
    assert message.to_bytes() == PAYLOAD


@pytest.mark.parametrize(
    "data",
    [b"\0", b"\0abc", b"\0\0a\r\0\0", b"\x00" + b"123456789\0ab\r\0\0", b"\x00\0abcdefghi\r\0\0"],
)
def test_a_text_without_its_end_has_a_wrong_size(data: bytes) -> None:
    with pytest.raises(BadContent) as caught:
        unpack(payload(), data)
    assert caught.value.kind == "length"
    with pytest.raises(module().DecodeError) as refused:
        module().DescribeRequest.from_bytes(data)
    assert refused.value.kind == "length"


@pytest.mark.parametrize(
    ("name", "value"), [("maker", "a\0b"), ("name", "a\rb"), ("name", "a"), ("maker", "é")]
)
def test_a_text_does_not_contain_its_end(name: str, value: str) -> None:
    with pytest.raises(Unsendable, match=name):
        pack(payload(), {name: value.encode()})
    with pytest.raises(module().EncodeError) as caught:
        module().DescribeRequest(**{name: value}).to_bytes()
    assert caught.value.field == name


@pytest.mark.parametrize("text", [SCHEMA, UNCOUNTED], ids=["length", "no length"])
def test_all_outputs_agree(text: str) -> None:
    assert run_text(text).differences == []


def test_a_frame_ends_where_its_terminators_tell() -> None:
    found, wrong = loads(UNCOUNTED, "sought.yaml")
    assert found is not None, wrong
    codec = python.load(found)
    one = codec.DescribeRequest(kind=1, key=b"\xaa\x55", place="ab", number=7)
    two = codec.DescribeRequest(kind=0, key=b"\0\1\2", place=None, number=0x7E)
    decoder, stream = codec.StreamDecoder("request"), one.to_frame() + two.to_frame()
    assert [each for byte in stream for each in decoder.feed(bytes((byte,)))] == [one, two]
    cut = one.to_frame().replace(b"\x7e", b"\x7d")  # without its end, the key is too long
    faults = codec.StreamDecoder("request").feed(cut + two.to_frame())
    assert faults[0].kind == "length"
    assert faults[-1] == two
    with pytest.raises(codec.EncodeError) as caught:
        codec.DescribeRequest(key=b"a\x7eb").to_bytes()
    assert caught.value.field == "key"
