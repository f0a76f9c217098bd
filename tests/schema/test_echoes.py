"""Echoes: fields that a response can repeat, and fields that it cannot."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Repeated
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


def repeated(protocol: Protocol) -> Mapping[str, Repeated]:
    """What the response of the first command repeats."""
    command = protocol.commands[0]
    return command.repeated(command.response)


def faults(request: str, response: str) -> list[str]:
    """Faults for a field x of a request and an echo x in its response, except unused types."""
    text = (
        f"{FRAME}commands: {{go: {{id: 1, request: {{{request}}}, response: {{{response}}}, repeat: safe}}}}"
    )
    return [fault.message for fault in loads(text, "x.yaml")[1] if fault.severity == "error"]


def test_qlink() -> None:
    commands = load(find("qlink")).commands
    assert {each.name: each.repeated(each.response) for each in commands if each.echoes} == {
        "node_program_load": {"counter": "counter"},
        "motion": {"counter": "counter"},
        "loop_back": {"offset": "offset", "data": "data"},
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
    assert repeated(protocol) == {"low": "low", "high": "high"}


def test_of_a_response_that_the_defaults_give() -> None:
    text = f"{FRAME}defaults: {{repeat: safe, response: {{x: {{type: u8, echo: true}}}}}}\n"
    good = f"{text}commands: {{go: {{id: 1, request: {{x: u8}}}}}}"
    protocol, _ = loads(good, "x.yaml")
    assert protocol
    assert repeated(protocol) == {"x": "x"}
    found = [
        fault for fault in loads(good.replace("{x: u8}", "{y: u8}"), "x.yaml")[1] if fault.rule == "bad-echo"
    ]
    assert [(fault.line, fault.column) for fault in found] == [(13, text.splitlines()[12].index("echo") + 1)]


def test_nothing_is_concluded_from_a_request_that_is_wrong() -> None:
    assert faults("x: {type: u9}", "x: {type: u8, echo: true}") == ["u9 has 9 bits, not whole bytes"]


PIECES = """
qlinkgen: 1
protocol: {name: sample, revision: "1", source: Made up for a test}
frame:
  parts:
    start: B5
    group: {role: message, type: u8}
    head: {type: u8, bits: {node: {at: 0..3, role: address}, number: {at: 4..7, role: message}}}
    tag: {type: u8, range: 1..9, default: 1}
    length: {type: u8, counts: data}
    data: {role: payload, size: 0..40}
bus: {kind: master_slave, nodes: 1..8, broadcast: 0}
defaults: {addressing: node, repeat: safe}
replies:
  nak: {id: {group: 5, number: 0}, fields: {whose: {type: u8, equals: request.group}, which: {type: u8, equals: request.number}}}
messages:
  ack: {id: {group: 5, number: 1}, direction: response, fields: {whose: {type: u8, equals: request.group}, from: {type: u8, equals: request.node}}}
commands:
  set: {id: {group: 6, number: 8}, request: {period: u16, of_first: u8}, response: ack}
  get: {id: {group: 6, number: 9}, request: {first: u8}, response: {start: {type: u8, equals: request.first}, label: {type: u8, range: 1..10, equals: request.tag}}}
"""  # noqa: E501


def test_of_parts_of_the_frame_of_a_request() -> None:
    protocol, found = loads(PIECES, "x.yaml")
    assert protocol, found
    commands = {each.name: each for each in protocol.commands}
    for name, number in (("set", 8), ("get", 9)):
        (nak,) = commands[name].replies
        assert commands[name].repeated(nak.message) == {"whose": 6, "which": number}
    assert commands["set"].repeated(commands["set"].response) == {"whose": 6, "from": "node"}
    assert commands["get"].repeated(commands["get"].response) == {"start": "first", "label": "tag"}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("equals: request.first", "equals: request.frist", "the request has no field 'frist' to repeat"),
        ("{first: u8}", "{first: u8, group: u8}", "group of get.request is a field and a part of the frame"),
        ("range: 1..10", "range: 1..8", "label cannot hold every tag of the request"),
        (
            "{type: u8, equals: request.node}",
            "{type: u8, range: 1..7, equals: request.node}",
            "from cannot hold node 0x8 of set.request",
        ),
        ("whose: {type: u8,", "whose: {type: u8, range: 7..9,", "whose cannot hold group 0x6 of get.request"),
        (
            "{type: u8, equals: request.group}",
            "{type: 'u8[1]', equals: request.group}",
            "whose cannot repeat group",
        ),
        (
            "equals: request.first",
            "equals: request.first, echo: true",
            "start repeats two things",
        ),
        ("response: ack", "response: {}", "a message without a request has no request to repeat"),
    ],
)
def test_of_what_it_cannot_be(old: str, new: str, said: str) -> None:
    extra = PIECES.replace(old, new)
    assert extra != PIECES
    assert said in {fault.message for fault in loads(extra, "x.yaml")[1] if fault.severity == "error"}
