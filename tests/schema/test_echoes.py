"""Echoes: fields that a response can repeat, and fields that it cannot."""

from __future__ import annotations

import pytest

from qlinkgen.schema import find, load, loads

FRAME = """
qlinkgen: 1
protocol: {name: sample, revision: "1", source: Made up for a test}
enums: {gear: {type: u8, values: {low: 1}}}
types: {small: {type: u8, range: 0..9}, tenths: {type: u8, scale: 1/10, unit: s}}
frame:
  parts:
    sync: {role: constant, value: 7E}
    length: {role: length, type: u8, counts: [data]}
    id: {role: message, type: u8}
    data: {role: payload, size: 0..40}
bus: {kind: master_slave}
"""


def faults(request: str, response: str) -> list[str]:
    """Faults for a field x of a request and an echo x in its response, except unused types."""
    text = (
        f"{FRAME}commands: {{go: {{id: 1, request: {{{request}}}, response: {{{response}}}, repeat: safe}}}}"
    )
    return [fault.message for fault in loads(text, "x.yaml")[1] if fault.severity == "error"]


def test_qlink() -> None:
    echoes = {each.name: each.echoes for each in load(find("qlink")).commands if each.echoes}
    assert echoes == {
        "node_program_load": ("counter",),
        "motion": ("counter",),
        "loop_back": ("offset", "data"),
    }


BITS = "type: u16, bits: {low: {at: 0..3}, high: {at: 4..15, scale: 1/2}}"


@pytest.mark.parametrize(
    ("request_type", "response_type"),
    [
        ("type: u8", "type: u8, doc: Another text"),
        ("type: u8, default: 3", "type: u8"),
        ("type: small", "type: u8"),
        ("type: u16", "type: u16, byteorder: little"),
        ("type: gear", "type: gear"),
        ("type: tenths", "type: tenths"),
        ("type: 'bytes[1..4]'", "type: 'bytes[0..4]'"),
        ("type: 'text[4]'", "type: 'text[4]'"),
        ("type: 'u16[0..3]'", "type: 'u16[0..3]'"),
        (BITS, BITS),
    ],
)
def test_of_the_same_type(request_type: str, response_type: str) -> None:
    assert faults(f"x: {{{request_type}}}", f"x: {{{response_type}, echo: true}}") == []


@pytest.mark.parametrize(
    ("request_type", "response_type"),
    [
        ("type: u8", "type: u16"),
        ("type: u8", "type: i8"),
        ("type: i8, range: 0..9", "type: u8"),
        ("type: u8", "type: small"),
        ("type: u8", "type: u8, range: 1..255"),
        ("type: u8", "type: gear"),
        ("type: u8", "type: tenths"),
        ("type: tenths", "type: u8, scale: 1/10, unit: ms"),
        ("type: 'bytes[0..5]'", "type: 'bytes[0..4]'"),
        ("type: 'bytes[0..4]'", "type: 'bytes[1..4]'"),
        ("type: 'text[4]'", "type: 'bytes[4]'"),
        ("type: 'u16[0..3]'", "type: 'u8[0..3]'"),
        ("type: 'u16[0..3]'", "type: 'u16[0..2]'"),
        ("type: u8", "type: 'u8[1]'"),
        (BITS, BITS.replace("0..3", "0..2")),
        (BITS, BITS.replace("low", "lower")),
        (BITS, BITS.replace(", high: {at: 4..15, scale: 1/2}", "")),
    ],
)
def test_of_another_type(request_type: str, response_type: str) -> None:
    said = faults(f"x: {{{request_type}}}", f"x: {{{response_type}, echo: true}}")
    assert said == ["x cannot hold every x of the request"]


@pytest.mark.parametrize("key", ["const: 3", "reserved: true"])
def test_of_fields_that_the_codec_fills(key: str) -> None:
    assert faults("x: u8", f"x: {{type: u8, {key}, echo: true}}") == [
        "x cannot be an echo: the codec fills it"
    ]
    (said,) = faults(f"x: {{type: u8, {key}}}", "x: {type: u8, echo: true}")
    assert said == "the request has no field 'x' to repeat"


def test_values_of_bit_fields_are_repeated() -> None:
    text = f"{FRAME}commands: {{go: {{id: 1, request: {{x: {{{BITS}}}}}, repeat: safe,"
    protocol, _ = loads(f"{text} response: {{x: {{{BITS}, echo: true}}}}}}}}", "x.yaml")
    assert protocol
    assert protocol.commands[0].echoes == ("low", "high")


def test_of_a_response_that_the_defaults_give() -> None:
    text = f"{FRAME}defaults: {{repeat: safe, response: {{x: {{type: u8, echo: true}}}}}}\n"
    good = f"{text}commands: {{go: {{id: 1, request: {{x: u8}}}}}}"
    protocol, _ = loads(good, "x.yaml")
    assert protocol
    assert protocol.commands[0].echoes == ("x",)
    found = [
        fault for fault in loads(good.replace("{x: u8}", "{y: u8}"), "x.yaml")[1] if fault.rule == "bad-echo"
    ]
    assert [(fault.line, fault.column) for fault in found] == [(13, text.splitlines()[12].index("echo") + 1)]


def test_nothing_is_concluded_from_a_request_that_is_wrong() -> None:
    assert faults("x: {type: u9}", "x: {type: u8, echo: true}") == ["u9 has 9 bits, not whole bytes"]
