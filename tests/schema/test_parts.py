"""Parts of a frame: their notations, and the roles told by other keys."""

from __future__ import annotations

import pytest

from qlinkgen.model.frame import DelimitedFrame, Part
from qlinkgen.schema.loader import loads

SCHEMA = """\
qlinkgen: 1
protocol: {{name: sample, revision: "1", source: Made up}}
frame:
  parts:
    start: {start}
    length: {length}
    code: {{role: message, type: u8}}
    data: {{role: payload, size: 0..16}}
    crc: {crc}
bus: {{kind: master_slave, response_within: 3 bytes}}
defaults: {{repeat: safe}}
commands: {{go: {{id: 1, request: {{}}, response: {{}}}}}}
"""
LONG = {
    "start": "{role: constant, value: A5 A5}",
    "length": "{role: length, type: u8, counts: [data]}",
    "crc": "{role: checksum, type: u8, algorithm: sum8, over: [data]}",
}


def parts(**written: str) -> tuple[Part, ...]:
    protocol, faults = loads(_text(written), "sample")
    assert protocol is not None, faults
    assert isinstance(protocol.frame, DelimitedFrame)
    return protocol.frame.parts


def _text(written: dict[str, str]) -> str:
    return SCHEMA.format(**{**LONG, **written})


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("A5 A5", "A5A5"), ("{value: A5 A5}", "A5A5"), ("68", "68"), ("10", "10"), ("16", "16"), ("7E", "7E"),
        ("FC", "FC"), ("02", "02"), ("1002", "1002"), ("10 02", "1002"), ("0x68", "68"), ("0xA5", "A5"),
        ("'10'", "10"), ('{text: "$M"}', "244D"), ('{text: "10"}', "3130"),
    ],
)  # fmt: skip
def test_notations_of_a_constant(text: str, data: str) -> None:
    assert parts(start=text)[0] == parts(start=f"{{role: constant, value: '{data}'}}")[0]


def test_other_keys_tell_the_role() -> None:
    length, crc = "{type: u8, counts: [data]}", "{type: u8, algorithm: sum8, over: [data]}"
    assert parts(length=length, crc=crc) == parts()


@pytest.mark.parametrize(
    ("written", "where", "what"),
    [
        ({"crc": "{doc: A byte}"}, "9:5", "crc has no role"),
        ({"start": "{value: 7E, text: x}"}, "5:24", "start has both value and text"),
        ({"start": '{text: ""}'}, "5:19", "'' is not text of printable ASCII characters"),
        ({"start": '{text: "é"}'}, "5:19", "'é' is not text of printable ASCII characters"),
        ({"start": "{role: payload, size: 3, text: x}"}, "8:5", "data and start are both the payload"),
        ({"length": "{role: address, type: u8, text: x}"}, "6:39", "'text' has no effect on a address here"),
    ],
)
def test_wrong_parts(written: dict[str, str], where: str, what: str) -> None:
    protocol, faults = loads(_text(written), "sample")
    assert protocol is None
    assert (f"{faults[0].line}:{faults[0].column}", faults[0].message) == (where, what)
