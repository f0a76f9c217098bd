"""Words of enums: of one length anywhere, of different lengths between separators."""

from __future__ import annotations

from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import construct, python
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.words import Words
from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, unpack
from qlinkgen.plan.describe import limits_text, range_text, value_text
from qlinkgen.plan.payload import ConstantStep, ValueStep
from qlinkgen.schema import loads

_SCHEMA = """\
qlinkgen: 1
protocol: {name: probe, revision: "1", source: this test}
enums:
  validity: {type: text, values: {valid: A, void: {value: V, doc: A warning}}}
  sign: {type: text, values: {plus: "+1", minus: "-1"}}
  mode: {type: text, values: {"off": "OFF", "on": "ON", automatic: AUTO}}
frame:
  parts:
    start: {text: "$"}
    code: {role: message, type: "text[3]"}
    data: {role: payload, size: 0..80}
    end: {role: terminator, value: 0D 0A}
bus: {kind: master_slave}
messages:
  put:
    id: PUT
    separator: ","
    fields:
      status: validity
      mode: {type: mode, default: automatic}
      other: {type: mode, optional: true}
      sign: {type: validity, const: valid}
      end: {type: mode, const: ["on", automatic]}
  fix:
    id: FIX
    fields: {status: validity, list: "sign[0..4]", last: {type: sign, default: minus}}
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
        ("put", {}, b"A,AUTO,,A,ON"),
        ("put", {"status": 1, "mode": 0, "other": 1}, b"V,OFF,ON,A,ON"),
        ("fix", {}, b"A-1"),
        ("fix", {"status": 1, "list": [1, 0], "last": 0}, b"V-1+1+1"),
    ],
)
def test_values_are_words(
    protocol: Protocol, codec: Any, name: str, values: dict[str, Any], payload: bytes
) -> None:
    message = codec.MESSAGES[name](**values)
    frame = b"$" + name.upper().encode() + payload + b"\r\n"
    assert message.to_frame() == frame
    assert codec.decode(frame) == message
    live = construct.live(protocol)
    assert live.payload(name, values) == payload
    assert live.payload(name, live.messages[name].parse(payload)) == payload


def test_python_has_members(codec: Any) -> None:
    found = codec.decode(b"$PUTV,ON,,A,AUTO\r\n")
    assert found.status is codec.Validity.VOID
    assert found.mode is codec.Mode.ON
    assert found.other is None
    assert found.to_frame() == b"$PUTV,ON,,A,ON\r\n"


def test_construct_has_names(protocol: Protocol) -> None:
    assert construct.live(protocol).payload("put", {"status": "void", "mode": "on"}) == b"V,ON,,A,ON"


@pytest.mark.parametrize("mode", [-1, 3])
def test_a_number_without_a_word_is_not_sent(protocol: Protocol, codec: Any, mode: int) -> None:
    with pytest.raises(codec.EncodeError) as caught:
        codec.Put(mode=mode).to_frame()
    assert caught.value.field == "mode"
    with pytest.raises(codec.EncodeError):
        codec.Fix(last=mode).to_frame()
    with pytest.raises(ConstructError):
        construct.live(protocol).payload("put", {"mode": mode})


@pytest.mark.parametrize(
    ("payload", "kind", "field"),
    [
        (b"B,AUTO,,A,ON", "range", "status"),
        (b"A,auto,,A,ON", "range", "mode"),
        (b"A,AUTO,O,A,ON", "length", "other"),
        (b"A,,,A,ON", "length", "mode"),
        (b"A,AUTO,,V,ON", "range", "sign"),
        (b"A,AUTO,,A,OFF", "range", "end"),
    ],
)
def test_other_texts_are_refused(
    protocol: Protocol, codec: Any, payload: bytes, kind: str, field: str
) -> None:
    with pytest.raises(BadContent) as bad:
        unpack(plan_of(protocol).message("put").payload, payload)
    assert (bad.value.kind, bad.value.field) == (kind, field)
    with pytest.raises(codec.DecodeError) as caught:
        codec.decode(b"$PUT" + payload + b"\r\n")
    assert caught.value.kind == kind
    with pytest.raises(ConstructError):
        construct.live(protocol).messages["put"].parse(payload)


def test_texts_on_terminals_are_words(protocol: Protocol) -> None:
    steps = {step.name: step for step in plan_of(protocol).message("put").payload.steps}
    mode, sign, end = steps["mode"], steps["sign"], steps["end"]
    assert isinstance(mode, ValueStep)
    assert isinstance(sign, ConstantStep)
    assert isinstance(end, ConstantStep)
    assert value_text(mode.number, 2) == "automatic (AUTO)"
    assert limits_text(mode.number) == "OFF, ON, AUTO"
    assert range_text(sign.number) == "always A"
    assert range_text(end.number) == "always ON or AUTO"


def test_no_word_is_every_text_of_its_size() -> None:
    words = Words("letters", tuple(bytes((each,)) for each in range(0x21, 0x7F)))
    assert words.wrong not in words.words
    assert Words("letter", (b"!",)).wrong == b'"'


def test_there_are_255_words_at_most() -> None:
    more = ", ".join(f'w{index}: "{index}"' for index in range(10, 264))
    _, faults = loads(_SCHEMA.replace("{valid: A,", f"{{valid: A, {more},"), "probe.yaml")
    assert f"{faults[0].message}; {faults[0].hint}" == "validity has 256 words; use at most 255"
