"""Codings in a schema, and proofs that a terminator cannot occur before it."""

from __future__ import annotations

import pytest

from qlinkgen.model.coding import Add, Cobs, Coding, Digits, Escape, Insert, Pair
from qlinkgen.model.frame import DelimitedFrame
from qlinkgen.model.integer import Chunk
from qlinkgen.schema import loads
from qlinkgen.schema.terminators import values_of

_SCHEMA = """
qlinkgen: 1
protocol: {{name: sample, revision: "1", source: Made up}}
frame:
  parts:
    start: 02
    id: {{role: message, type: u8}}
    data: {{role: payload, size: 0..16}}
{end}
{coding}
bus: {{kind: host}}
commands: {{}}
messages:
  told: {{id: {id}, direction: request, fields: {fields}}}
"""


def rules(fields: str, end: str, *, coding: str = "", number: int = 1) -> list[str]:
    terminator = f"    end: {{role: terminator, value: {end}}}"
    text = _SCHEMA.format(end=terminator, coding=coding, fields=fields, id=number)
    return [fault.rule for fault in loads(text, "sample.yaml")[1]]


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("{escape: 7D, xor: 20, of: [03, 7D]}", [Escape(0x7D, ((3, 0x23), (0x7D, 0x5D)), 0x20)]),
        ("{replace: {03: 10 83, 10: 10 90}}", [Escape(0x10, ((3, 0x83), (0x10, 0x90)))]),
        ("{replace: {0x03: 10 83, 0x10: 10 90}}", [Escape(0x10, ((3, 0x83), (0x10, 0x90)))]),
        ("{digits: hex}", [Digits()]),
        ("[{pair: complement}, {digits: hex}]", [Pair(), Digits()]),
        ("[{add: 33}, {digits: hex}]", [Add(0x33), Digits()]),
        ("[{insert: 0, after: A5 A5}, {digits: hex}]", [Insert(b"\xa5\xa5", 0), Digits()]),
    ],
)
def test_codings(text: str, meant: list[Coding]) -> None:
    end = "    end: {role: terminator, value: 03}"
    schema = _SCHEMA.format(end=end, coding=f"  coding: {text}", fields="{a: bytes}", id=1)
    protocol, faults = loads(schema, "sample.yaml")
    assert protocol is not None, faults
    assert isinstance(protocol.frame, DelimitedFrame)
    assert protocol.frame.coding == tuple(meant)
    assert protocol.frame.coded == ("id", "data")


@pytest.mark.parametrize(
    ("fields", "end"),
    [
        ("{a: {type: u8, range: 0..2}}", "03"),
        ("{a: {type: u8, range: 4..255}}", "03"),
        ("{a: {type: u16, range: 0x0400..0x04FF}, b: u8}", "03 FF"),
        ("{a: {type: u16, const: 0x1234}}", "03"),
        ("{a: {type: i8, range: -5..2}}", "03"),
        ("{a: text}", "80"),
        ("{a: {type: u8, bits: {low: 0..1, high: 4..6}}}", "04"),
        ("{a: {type: u14, groups: {bits: 7, first: least}}}", "FF 00"),
        ("{a: u8}", "03"),
        ("{a: bytes}", "03"),
        ("{a: {type: u16, range: 0x0200..0x0300}}", "03"),
        ("{a: text}", "0D 0A"),
        ("{a: {type: u8, bits: {low: 0..1, high: 4..6}}}", "13"),
        ("{a: {type: u8, reserved: true}}", "03"),
    ],
)
def test_what_is_proved(fields: str, end: str) -> None:
    """By trying: a terminator is refused if its bytes can all occur."""
    possible = {
        "{a: {type: u8, range: 0..2}}": range(3),
        "{a: {type: u8, range: 4..255}}": range(4, 256),
        "{a: {type: u16, range: 0x0400..0x04FF}, b: u8}": range(256),
        "{a: {type: u16, const: 0x1234}}": (0x12, 0x34),
        "{a: {type: i8, range: -5..2}}": [each & 0xFF for each in range(-5, 3)],
        "{a: text}": [each for each in range(128) if each not in bytes.fromhex(end)],
        "{a: {type: u8, bits: {low: 0..1, high: 4..6}}}": [each for each in range(256) if not each & 0x8C],
        "{a: {type: u14, groups: {bits: 7, first: least}}}": range(128),
        "{a: {type: u16, range: 0x0200..0x0300}}": range(256),
    }.get(fields, range(256))
    wanted = all(byte in {*possible, 1} for byte in bytes.fromhex(end))
    assert ("terminator-in-frame" in rules(fields, end)) == wanted


def test_the_number_of_a_message_is_tried() -> None:
    assert rules("{}", "05", number=5) == ["terminator-in-frame"]
    assert rules("{}", "05", number=6) == []


@pytest.mark.parametrize(("most", "proved"), [(3, True), (7, False), (4, False)])
def test_values_of_every_frame_are_tried(most: int, *, proved: bool) -> None:
    low = f"{{at: 0..2, range: 0..{most}}}"
    part = f"    state: {{type: u8, bits: {{low: {low}, high: {{at: 4, type: bool}}}}}}\n"
    end = "    end: {role: terminator, value: 14}"
    text = _SCHEMA.format(end=end, coding="", fields="{}", id=1).replace("    data:", f"{part}    data:", 1)
    found = [fault.rule for fault in loads(text, "sample.yaml")[1]]
    assert found == ([] if proved else ["terminator-in-frame"])


def test_a_coding_may_bring_the_terminator_in() -> None:
    assert rules("{a: bytes}", "03", coding="  coding: {pair: complement}") == ["terminator-in-frame"]
    escape = "  coding: {escape: 7D, xor: 01, of: [02, 7D]}"
    assert rules("{a: {type: u8, range: 0..2}}", "03", coding=escape) == ["terminator-in-frame"]
    assert rules("{a: bytes}", "00", coding="  coding: {cobs: 00}") == []


@pytest.mark.parametrize(
    ("chunk", "low", "high", "found"),
    [
        (Chunk(0, 8), 3, 5, {3, 4, 5}),
        (Chunk(8, 8), 0x1FF, 0x301, {1, 2, 3}),
        (Chunk(0, 8), 0x1FE, 0x201, {0xFE, 0xFF, 0, 1}),
        (Chunk(0, 4), 0, 15, set(range(16))),
        (Chunk(4, 2), -1, 0, {3, 0}),
    ],
)
def test_bytes_of_numbers(chunk: Chunk, low: int, high: int, found: set[int]) -> None:
    assert values_of(chunk, low, high) == found


@pytest.mark.parametrize(
    ("coding", "end", "proved"),
    [
        ("{insert: 10, after: 10}", "10 03", True),
        ("{insert: 10, after: 10}", "10 10", False),
        ("{insert: 10, after: 10}", "03 10", False),
        ("{insert: 10, after: 10}", "10 03 04", False),
        ("{insert: 0, after: 10 10}", "10 03", False),
        ("{replace: {10: 10 01, 7E: 10 04}}", "10 03", True),
        ("{replace: {10: 10 01, 7E: 10 03}}", "10 03", False),
        ("{escape: 10, xor: 01, of: [10, 7F]}", "10 03", False),
        ("[{insert: 10, after: 10}, {pair: complement}]", "10 03", False),
        ("[{pair: complement}, {insert: 10, after: 10}]", "10 03", True),
        ("{insert: 10, after: 10, over: [data]}", "10 03", False),
    ],
)
def test_a_terminator_that_is_another_pair(coding: str, end: str, *, proved: bool) -> None:
    found = rules("{a: bytes}", end, coding=f"  coding: {coding}", number=0x10)
    assert found == ([] if proved else ["terminator-in-frame"])


def test_alphabets() -> None:
    every = frozenset(range(256))
    assert Escape(0x7D, ((0x7E, 0x5E), (0x7D, 0x5D)), 0x20).alphabet(every) == every - {0x7E}
    assert Escape(0x7D, ((0x7E, 0x5E), (0x7D, 0x5D)), 0x20).alphabet(frozenset({1})) == {1}
    assert Cobs().alphabet(frozenset()) == every - {0}
    assert Digits().alphabet(every) == frozenset(b"0123456789ABCDEF")
    assert Pair().alphabet(frozenset({1})) == {1, 0xFE}
    assert Add(2).alphabet(frozenset({255})) == {1}
    assert Insert(b"\1\2", 9).alphabet(frozenset({1, 2})) == {1, 2, 9}
    assert Insert(b"\1\2", 9).alphabet(frozenset({1})) == {1}
