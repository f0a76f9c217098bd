"""Fields that take the rest of the payload: every target supports every valid schema."""

from __future__ import annotations

import itertools

import pytest

from qlinkgen.backends import c, construct, python
from qlinkgen.backends.base import Options
from qlinkgen.schema import loads

SCHEMA = """
qlinkgen: 1
protocol: {{name: rest, title: Rest, revision: "1", source: this test, doc: An open end.}}
byteorder: big
frame:
  parts:
    start: {{role: constant, value: 0xDC}}
    len: {{role: length, type: u8, counts: [data]}}
    id: {{role: message, type: u8}}
    data: {{role: payload, size: 0..60}}
bus: {{kind: host, baud: 9600, response_within: 20 bytes}}
messages:
  told: {{id: 1, doc: Told., fields: {{{fields}}}}}
"""
FIELDS = {
    "n": "{type: u8, counts: w}",
    "w": '"bytes[0..5]"',
    "m": "{type: u8, counts: x, counts_in: bytes}",
    "x": '"u16[1..5]"',
    "rest": '"u16[0..9]"',
    "fixed": '"u8[3]"',
}


@pytest.mark.parametrize("first", FIELDS)
def test_every_order(first: str) -> None:
    for order in itertools.permutations(FIELDS):
        if order[0] == first:
            check(order)


def check(order: tuple[str, ...]) -> None:
    text = SCHEMA.format(fields=", ".join(f"{name}: {FIELDS[name]}" for name in order))
    protocol, faults = loads(text, "rest.yaml")
    counts_are_first = order.index("n") < order.index("w") and order.index("m") < order.index("x")
    counts_lead = all(
        order.index(count) < order.index("rest") or order.index(counted) < order.index("rest")
        for count, counted in (("n", "w"), ("m", "x"))
    )
    assert (protocol is not None) == (counts_are_first and counts_lead), faults
    if protocol is not None:
        (header,) = c.generate(protocol, Options()).values()
        assert "rest_count" in header
        told = python.load(protocol).Told(w=b"ab", x=[1, 2], rest=[3, 4, 5], fixed=[6, 7, 8])
        assert construct.live(protocol).parse("message", told.to_frame()).fields.rest == [3, 4, 5]
