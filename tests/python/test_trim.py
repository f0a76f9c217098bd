"""Payloads that are sent without the zeros at their end."""

from __future__ import annotations

from pathlib import Path

import pytest

from qlinkgen import schema
from qlinkgen.backends.python import load

SCHEMA = """
qlinkgen: 1
protocol: {name: tail, title: Tail, revision: "1", source: none, doc: A part follows the payload.}
byteorder: little
frame:
  parts:
    start: FD
    length: {type: u8, counts: [data]}
    number: {role: message, type: u8}
    data: {role: payload, size: 0..20, trim: {zeros: true, keep: 1}}
    tail: {type: u8, default: 0}
    crc: {type: u16, algorithm: crc-16/mcrf4xx, over: [length, number, data, tail]}
bus: {kind: link}
messages:
  one: {id: 1, fields: {first: u8, last: u32}}
"""


@pytest.mark.parametrize("tail", [0, 7])
@pytest.mark.parametrize(("last", "size"), [(0, 1), (5, 2), (5 << 24, 5)])
def test_zeros_before_and_in_the_part_after_the_payload(
    tmp_path: Path, tail: int, last: int, size: int
) -> None:
    path = tmp_path / "tail.yaml"
    path.write_text(SCHEMA, "utf-8")
    module = load(schema.load(path))
    wire = module.One(first=1, last=last, tail=tail).to_frame()
    assert (wire[1], len(wire)) == (size, size + 6)
    found = module.decode(wire)
    assert (found.first, found.last, found.tail) == (1, last, tail)
