"""Lists of numbers and words between separators; one takes the texts that the other fields leave."""

from __future__ import annotations

from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import c, construct, python
from qlinkgen.backends.base import Options
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, pack, unpack
from qlinkgen.schema import loads

_SCHEMA = """\
qlinkgen: 1
protocol: {name: probe, revision: "1", source: this test}
enums:
  mode: {type: text, values: {"off": "OFF", "on": "ON", automatic: AUTO}}
frame:
  parts:
    start: {text: "$"}
    code: {role: message, type: "text[3]"}
    data: {role: payload, size: 0..80}
    end: {role: terminator, value: 0D 0A}
bus: {kind: master_slave}
defaults: {repeat: safe, separator: ","}
messages:
  put:
    id: PUT
    fields:
      modes: {type: "mode[2]", default: ["on", "off"]}
      note: {type: "text[1..3]", optional: true}
      levels: {type: "i16[0..4]", as: decimal, scale: 1/10}
  fix:
    id: FIX
    fields: {flags: {type: "bool[0..3]", as: "decimal[1]"}}
  led:
    id: LED
    separator: {before: " "}
    fields: {first: {type: u8, as: decimal}, levels: {type: "u8[1..3]", as: "hex[1..2]", range: 3..9}}
  mid:
    id: MID
    fields:
      note: {type: "text[1..3]", optional: true}
      levels: {type: "i16[0..4]", as: decimal, scale: 1/10}
      modes: {type: "mode[2]", default: ["on", "off"]}
      unit: "text[0..2]"
  top:
    id: TOP
    fields: {levels: {type: "u8[0..3]", as: decimal}, unit: "text[0..2]"}
  one:
    id: ONE
    separator: {before: " "}
    fields: {levels: {type: "u8[0..3]", as: decimal}, mode: mode}
  cnt:
    id: CNT
    fields:
      number: {type: u8, as: decimal, range: 0..3}
      levels: {type: "u8[number]", as: decimal}
      modes: "mode[2]"
"""


@pytest.fixture(scope="module")
def protocol() -> Protocol:
    found, faults = loads(_SCHEMA, "probe.yaml")
    assert found, [str(fault) for fault in faults]
    return found


@pytest.fixture(scope="module")
def codec(protocol: Protocol) -> Any:
    return python.load(protocol)


@pytest.mark.parametrize(
    ("name", "values", "payload"),
    [
        ("put", {}, b"ON,OFF"),
        ("put", {"note": "ab", "modes": [0, 2]}, b"OFF,AUTO,ab"),
        ("put", {"levels": [1.5, -2.0]}, b"ON,OFF,,1.5,-2.0"),
        ("fix", {}, b""),
        ("fix", {"flags": [True, False]}, b"1,0"),
        ("led", {"levels": [3]}, b" 0 3"),
        ("led", {"levels": [3, 9, 4]}, b" 0 3 9 4"),
        ("mid", {}, b",ON,OFF,"),
        ("mid", {"note": "ab", "unit": "mA"}, b"ab,ON,OFF,mA"),
        ("mid", {"levels": [1.5, -2.0], "modes": [2, 1]}, b",1.5,-2.0,AUTO,ON,"),
        ("top", {}, b""),
        ("top", {"levels": [7]}, b"7,"),
        ("top", {"levels": [7, 0, 255], "unit": "V"}, b"7,0,255,V"),
        ("cnt", {"modes": [0, 0]}, b"0,OFF,OFF"),
        ("cnt", {"levels": [7, 0, 255], "modes": [2, 1]}, b"3,7,0,255,AUTO,ON"),
        ("one", {}, b" OFF"),
        ("one", {"levels": [1, 2, 3], "mode": 1}, b" 1 2 3 ON"),
    ],
)
def test_lists(protocol: Protocol, codec: Any, name: str, values: dict[str, Any], payload: bytes) -> None:
    message = codec.MESSAGES[name](**values)
    frame = b"$" + name.upper().encode() + payload + b"\r\n"
    assert message.to_frame() == frame
    assert codec.decode(frame) == message
    live, plan = construct.live(protocol), plan_of(protocol).message(name).payload
    assert live.payload(name, values) == payload
    assert live.payload(name, live.messages[name].parse(payload)) == payload
    assert pack(plan, unpack(plan, payload)) == payload
    assert plan.least <= len(payload) <= plan.most
    assert live.messages[name].least == plan.least


def test_a_constant_number_of_texts_varies_in_size() -> None:
    text = (
        _SCHEMA[: _SCHEMA.index("  fix:")]
        .replace("      note:", "      # note:")
        .replace("      levels:", "      # levels:")
    )
    found, faults = loads(text, "probe.yaml")
    assert found, [str(fault) for fault in faults]
    assert [field.name for field in found.by_name["put"].variable] == ["modes"]
    (header,) = c.generate(found, Options()).values()
    assert "const size_t payload_size = probe_put_size_(message);" in header


def test_c_counts_the_texts_of_earlier_lists(protocol: Protocol) -> None:
    (header,) = c.generate(protocol, Options()).values()
    assert "size_t count = (texts > 3U) ? (texts - 3U) : 0U;" in header
    assert "const size_t count = (texts > 2U) ? (texts - 2U) : 0U;" in header
    assert "const size_t count = texts - 4U;" in header


def test_a_separator_before_no_items_is_accepted(codec: Any) -> None:
    assert codec.decode(b"$PUTON,OFF,,\r\n") == codec.Put()
    assert codec.decode(b"$PUTON,OFF,a,\r\n").to_frame() == b"$PUTON,OFF,a\r\n"


def test_sizes(protocol: Protocol) -> None:
    plan = plan_of(protocol)
    assert [plan.message(name).payload.least for name in ("put", "fix", "led")] == [5, 0, 4]
    assert [plan.message(name).payload.least for name in ("mid", "top", "one")] == [7, 0, 3]
    assert [plan.message(name).payload.most for name in ("put", "fix", "led")] == [9 + 1 + 3 + 4 * 8, 5, 13]


@pytest.mark.parametrize(
    ("name", "payload", "wrong"),
    [
        ("put", b"ON", ("length", "")),
        ("put", b"ON,OFF,,1,2,3,4,5", ("length", "")),
        ("put", b"ON,,,1", ("length", "modes")),
        ("put", b"ON,OFF,,1,,2", ("length", "levels")),
        ("put", b"ON,NO,,1", ("range", "modes")),
        ("put", b"ON,OFF,,1,x", ("range", "levels")),
        ("fix", b",", ("length", "flags")),
        ("led", b" 0", ("length", "")),
        ("led", b" 0 ", ("length", "levels")),
        ("led", b" 0 3 A", ("range", "levels")),
        ("mid", b"ON,OFF,", ("length", "")),
        ("mid", b"ab,,ON,OFF,", ("length", "levels")),
        ("mid", b"ab,1,x,ON,OFF,", ("range", "levels")),
        ("mid", b"ab,1,2,ON,NO,", ("range", "modes")),
        ("cnt", b"1,OFF,OFF", ("length", "number")),
        ("cnt", b"1,7,8,OFF,OFF", ("length", "number")),
        ("cnt", b"x,7,OFF,OFF", ("range", "number")),
        ("cnt", b",7,OFF,OFF", ("length", "number")),
        ("cnt", b"1,x,OFF,OFF", ("range", "levels")),
        ("top", b",V", ("length", "levels")),
        ("top", b"1,2,3,4,V", ("length", "")),
    ],
)
def test_wrong_lists(
    protocol: Protocol, codec: Any, name: str, payload: bytes, wrong: tuple[str, str]
) -> None:
    with pytest.raises(BadContent) as bad:
        unpack(plan_of(protocol).message(name).payload, payload)
    assert (bad.value.kind, bad.value.field) == wrong
    with pytest.raises(codec.DecodeError) as caught:
        codec.decode(b"$" + name.upper().encode() + payload + b"\r\n")
    assert caught.value.kind == wrong[0]
    with pytest.raises(ConstructError):
        construct.live(protocol).messages[name].parse(payload)


@pytest.mark.parametrize(
    ("values", "field"),
    [({"levels": [1.0] * 5}, "levels"), ({"modes": [0]}, "modes"), ({"modes": [0, 3]}, "modes")],
)
def test_wrong_values(protocol: Protocol, codec: Any, values: dict[str, Any], field: str) -> None:
    with pytest.raises(codec.EncodeError) as caught:
        codec.Put(**values).to_frame()
    assert caught.value.field.startswith(field)
    with pytest.raises(ConstructError):
        construct.live(protocol).payload("put", values)
