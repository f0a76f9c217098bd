"""Texts between separators: numbers of any width, absent fields, and what a text does not have."""

from __future__ import annotations

from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import c, construct, python, vectors
from qlinkgen.backends.base import Options
from qlinkgen.errors import Fault
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import BadContent, pack, unpack
from qlinkgen.schema import loads

_SCHEMA = """\
qlinkgen: 1
protocol: {{name: probe, revision: "1", source: this test}}
frame:
  parts:
    start: {{text: "$"}}
    code: {{role: message, type: "text[3]"}}
    comma: {{text: ","}}
    data: {{role: payload, size: 0..80}}
    end: {{role: terminator, value: 0D 0A}}
bus: {{kind: master_slave}}
defaults: {{repeat: safe, separator: ","}}
messages:
  put:
    id: PUT
    {more}
    fields:
{fields}
"""
FIELDS = """
      depth: {type: i32, as: decimal, scale: 1/10}
      time: {type: u32, as: "decimal[9..10]", scale: 1/100, optional: true}
      kind: {type: u8, as: decimal, const: 7}
      name: "text[0..8]"
      code: {type: u16, as: "hex[1..4]", optional: true}
      note: {type: "text[1..5]", optional: true}
"""
FULL = {"depth": -7.6, "time": 1.5, "name": "abc", "code": 0xBE, "note": "hi"}
LEAST = {"depth": 0.0, "time": None, "name": "", "code": None, "note": None}


def loaded(fields: str = FIELDS, more: str = "{}") -> tuple[Protocol | None, list[Fault]]:
    """A protocol around the fields of a message; ``more`` are further keys of it."""
    text = _SCHEMA.format(fields=fields, more="doc: D." if more == "{}" else more)
    return loads(text, "probe.yaml")


def test_a_separator_precedes_each_field() -> None:
    fields = '      {depth: {type: u8, as: decimal}, note: {type: "text[1..5]", optional: true}}'
    text = _SCHEMA.format(fields=fields, more='separator: {before: ","}').replace(
        '    comma: {text: ","}\n', ""
    )
    found, faults = loads(text + '  ask: {id: ASK, separator: {before: ","}, fields: {}}\n', "probe.yaml")
    assert found, [str(fault) for fault in faults]
    module, live = python.load(found), construct.live(found)
    assert module.Ask().to_frame() == b"$ASK\r\n"
    for values, wire in (({"depth": 7}, b"$PUT,7\r\n"), ({"depth": 7, "note": "a"}, b"$PUT,7,a\r\n")):
        assert module.Put(**values).to_frame() == wire
        assert live.payload("put", values) == wire[4:-2]
        assert module.decode(wire) == module.Put(**values)
    with pytest.raises(module.DecodeError, match="data bytes"):
        module.decode(b"$PUT7\r\n")


@pytest.fixture(scope="module")
def protocol() -> Protocol:
    found, faults = loaded()
    assert found, [str(fault) for fault in faults]
    return found


@pytest.fixture(scope="module")
def codec(protocol: Protocol) -> Any:
    return python.load(protocol)


@pytest.mark.parametrize(
    ("values", "payload"),
    [
        (FULL, b"-7.6,000001.50,7,abc,BE,hi"),
        (LEAST, b"0.0,,7,"),
        (LEAST | {"code": 0}, b"0.0,,7,,0"),
        (LEAST | {"note": "x"}, b"0.0,,7,,,x"),
    ],
)
def test_payloads(protocol: Protocol, codec: Any, values: dict[str, Any], payload: bytes) -> None:
    live = construct.live(protocol)
    frame = b"$PUT," + payload + b"\r\n"
    assert codec.Put(**values).to_frame() == frame
    assert live.payload("put", values) == payload
    found, parsed = codec.decode(frame), live.messages["put"].parse(payload)
    assert {name: getattr(found, name) for name in values} == values
    assert {name: parsed[name] for name in values} == values
    plan = plan_of(protocol).message("put").payload
    assert pack(plan, unpack(plan, payload)) == payload
    assert plan.least == len(b"0,,7,")


@pytest.mark.parametrize("payload", [b"+07.60,1.5,07,abc,0be,hi", b"0,,7,,,", b"0.,,7,", b"-.0,,007,,"])
def test_other_payloads_of_the_same_values(protocol: Protocol, codec: Any, payload: bytes) -> None:
    plan = plan_of(protocol).message("put").payload
    raw = unpack(plan, payload)
    found = codec.decode(b"$PUT," + payload + b"\r\n")
    assert found.to_frame() == b"$PUT," + pack(plan, raw) + b"\r\n"
    construct.live(protocol).messages["put"].parse(payload)


@pytest.mark.parametrize(
    ("payload", "kind", "field"),
    [
        (b"", "length", ""),
        (b"0.0,,7", "length", ""),
        (b"0.0,,7,a,0,b,", "length", ""),
        (b",,7,", "length", "depth"),
        (b"0.0,,,", "length", "kind"),
        (b"0.0,,7,123456789", "length", "name"),
        (b"0.0,00000001.50,7,", "length", "time"),
        (b"0.05,,7,", "range", "depth"),
        (b"0.0,,8,", "range", "kind"),
        (b"0.0,,7,\x80", "range", "name"),
        (b"0.0,,7,a\r", "range", "name"),
        (b"0.0,,7,,x", "range", "code"),
    ],
)
def test_wrong_payloads(protocol: Protocol, codec: Any, payload: bytes, kind: str, field: str) -> None:
    with pytest.raises(BadContent) as refused:
        unpack(plan_of(protocol).message("put").payload, payload)
    assert (refused.value.kind, refused.value.field) == (kind, field)
    with pytest.raises(codec.DecodeError) as caught:
        codec.decode(b"$PUT," + payload + b"\r\n")
    assert caught.value.kind == kind
    if kind == "range":
        assert (caught.value.field, caught.value.offset) == (field, refused.value.offset)
    with pytest.raises(ConstructError):
        construct.live(protocol).messages["put"].parse(payload)


@pytest.mark.parametrize(
    ("field", "value"),
    [("depth", 1e9), ("name", "a,b"), ("name", "a\r"), ("note", ""), ("note", "toolong"), ("time", 1e9)],
)
def test_what_cannot_be_sent(protocol: Protocol, codec: Any, field: str, value: object) -> None:
    with pytest.raises(codec.EncodeError) as caught:
        codec.Put(**FULL | {field: value}).to_frame()
    assert caught.value.field == field
    with pytest.raises(ConstructError):
        construct.live(protocol).payload("put", FULL | {field: value})


def test_vectors_have_no_separator_in_texts() -> None:
    protocol, faults = loaded('      a: "text[40]"\n      b: "text[0..30]"')
    assert protocol, [str(fault) for fault in faults]
    assert vectors.generate(protocol, Options())


def test_c_counts_texts_first(protocol: Protocol) -> None:
    (header,) = c.generate(protocol, Options()).values()
    assert "if ((texts < 4U) || (texts > 6U)) {" in header


@pytest.mark.parametrize(
    ("fields", "more", "text"),
    [
        ("      a: {type: u16, as: decimal}", "separator: none",
         "the text of a has 1 to 5 characters; use a constant number, as: decimal[5], or a separator"),
        ("      a: {type: u16, as: decimal}", 'separator: "."',
         "the separator '.' may occur in the number a; use another separator"),
        ("      a: u16", "separator: ';'", "a is not a text, so it may contain the separator"),
        ('      a: {type: "text[0..3]", optional: true}', "separator: ';'",
         "an empty a is the same as an absent one; remove optional, or write [1..N]"),
        ('      a: "text[3]"', 'separator: "\\r"',
         "the separator ends the frame; use another separator, or another terminator"),
    ],
)  # fmt: skip
def test_faults(fields: str, more: str, text: str) -> None:
    found = [f"{fault.message}; {fault.hint}" for fault in loaded(fields, more)[1]]
    assert any(each.startswith(text) for each in found)


def test_a_text_without_a_bound_takes_what_the_others_leave() -> None:
    protocol, faults = loaded('      a: {type: u8, as: decimal}\n      b: text\n      c: "text[2]"')
    assert protocol, [str(fault) for fault in faults]
    message = protocol.by_name["put"]
    assert message.max_size == 80
    assert message.fields[1].max_size == 80 - 3 - 2 - 2


_CHECKED = _SCHEMA.replace(
    "end: {{role: terminator, value: 0D 0A}}",
    """star: {{role: terminator, text: "*"}}
    check: {{type: u8, as: "hex[2]", algorithm: xor8, over: [code, comma, data]}}
    end: 0D 0A""",
)


def test_check_value_as_digits() -> None:
    text = _CHECKED.format(fields='      name: "text[0..8]"', more="doc: D.")
    protocol, faults = loads(text, "probe.yaml")
    assert protocol, [str(fault) for fault in faults]
    codec, live = python.load(protocol), construct.live(protocol)
    frame = codec.Put(name="ab").to_frame()
    right = 0
    for byte in b"PUT,ab":
        right ^= byte
    assert frame == b"$PUT,ab*%02X\r\n" % right == live.wrap("put", live.payload("put", {"name": "ab"}))
    made = [codec.Put(name=each) for each in "abcdefghijk"]
    letters = next(each for each in made if each.to_frame()[-4:-2].lower() != each.to_frame()[-4:-2])
    lower = letters.to_frame()[:-4] + letters.to_frame()[-4:-2].lower() + b"\r\n"
    assert codec.decode(lower).name == letters.name
    for wrong in (b"$PUT,ab*%02X\r\n" % (right ^ 1), b"$PUT,ab*G0\r\n"):
        with pytest.raises(codec.DecodeError) as caught:
            codec.decode(wrong)
        assert caught.value.kind == "crc"
    (header,) = c.generate(protocol, Options()).values()
    assert "0x37U : 0x30U" in header


def test_a_line_of_texts_without_anything_else_leaves_no_variable_unused_in_c() -> None:
    """As of a weighing indicator, which sends its state and weight."""
    parts = _SCHEMA.index("    start:"), _SCHEMA.index("    data:")
    text = _SCHEMA[: parts[0]] + _SCHEMA[parts[1] :].replace("    id: PUT\n", "")
    fields = '      state: "text[2]"\n      weight: {type: i32, as: "decimal[8]", scale: 1/10}'
    protocol, faults = loads(
        text.replace("size: 0..80", "size: 1..80").format(fields=fields, more="doc: D."), "probe.yaml"
    )
    assert protocol, [str(fault) for fault in faults]
    assert python.load(protocol).Put(state="ST", weight=-12.3).to_frame() == b"ST,-00012.3\r\n"
    (header,) = c.generate(protocol, Options()).values()
    scan = header.partition("probe_scan_(")[2].partition("\n}")[0]
    assert "status" not in scan


def test_a_step_may_have_a_separator_of_its_own() -> None:
    text = """\
qlinkgen: 1
protocol: {name: probe, title: Probe, revision: "1", source: Manual}
frame:
  parts:
    start: {text: "$"}
    code: {role: message, type: "text[2]"}
    data: {role: payload, size: 0..40}
    end: {role: terminator, value: 0D}
bus: {kind: master_slave, response_within: 100 ms}
defaults: {repeat: safe}
commands:
  set:
    id: AB
    separator: ","
    request: {a: {type: u8, as: decimal}, b: {type: u8, as: decimal}}
    steps:
      - name: more
        send: {id: CD, separator: ";", fields: {a: {type: u8, as: decimal}, b: {type: u8, as: decimal}}}
      - {name: done, receive: {id: EF, fields: {a: {type: u8, as: decimal}, b: {type: u8, as: decimal}}}}
"""
    protocol, faults = loads(text, "probe.yaml")
    assert protocol is not None, faults
    codec, values = Codec(plan_of(protocol)), {"a": 1, "b": 2}
    sent = [codec.encode(name, values) for name in ("set.request", "set.more", "set.done")]
    assert sent == [b"$AB1,2\r", b"$CD1;2\r", b"$EF1,2\r"]
