"""A payload is divided into its fields as far as its counts can be true, also where it is wrong."""

from __future__ import annotations

from functools import cache

import pytest

from qlinkgen.plan import Plan, plan_of
from qlinkgen.plan.fields import Fields
from qlinkgen.plan.spans import Around, Span
from qlinkgen.schema import loads

_SCHEMA = """
qlinkgen: 1
protocol: {name: fields, title: Fields, revision: "1", source: Tests, doc: Payloads of fields}
byteorder: big
frame:
  parts:
    start: {role: constant, value: AA}
    id: {role: message, type: u8}
    length: {role: length, type: u8, counts: [data]}
    data: {role: payload, size: 0..40}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands:
  items:
    id: 1
    request:
      size: {type: u8, counts: list, counts_in: bytes}
      list: {type: "u14[0..4]", groups: {bits: 7, first: most}}
      tail: {type: u16, range: 5..6, default: 5}
    response: {text: "text[0..6]", mark: {type: u8, const: 7}}
  bits:
    id: 2
    request:
      all: {type: u8, bits: {low: {at: 0..2, range: 1..5, default: 1}, high: {at: 4..7, signed: true}}}
      odd: {type: u13, groups: {bits: 7, first: most}}
    response: {rest: "u24[0..4]"}
"""


@cache
def _plan() -> Plan:
    protocol, faults = loads(_SCHEMA, "fields.yaml")
    assert protocol is not None, [str(fault) for fault in faults]
    return plan_of(protocol)


def _shown(span: Span) -> str:
    """The name of a span, the first and the last of its places, its number and what is wrong with it."""
    name = span.of.value if isinstance(span.of, Around) else span.of.name
    lacks = f"-{span.size - len(span.raw)}" if span.size > len(span.raw) else ""
    number = "" if span.number is None else f"={span.number}"
    return f"{name}@{span.places[0]}..{span.places[-1]}{lacks}{number}{span.fault and f' {span.fault}'}"


@pytest.mark.parametrize(
    ("message", "payload", "spans"),
    [
        ("items.request", "04 0003 0304 0005", "size@0..0=4, list@1..4, tail@5..6=5"),
        ("items.request", "00 0005", "size@0..0=0, tail@1..2=5"),
        ("items.response", "41 7F 07", "text@0..1, mark@2..2=7"),
        ("items.response", "07", "mark@0..0=7"),
        ("bits.request", "11 00 00", "all@0..0=17, low@0..0=1, high@0..0=1, odd@1..2=0"),
        ("bits.request", "85 3F 7F", "all@0..0=133, low@0..0=5, high@0..0=-8, odd@1..2=8191"),
        ("bits.response", "000001 000002", "rest@0..5"),
    ],
)
def test_a_right_payload(message: str, payload: str, spans: str) -> None:
    found = Fields(_plan().message(message).payload, bytes.fromhex(payload), sound=True)
    assert (", ".join(map(_shown, found.spans)), found.wrong, found.bad) == (spans, [], False)


@pytest.mark.parametrize(
    ("message", "payload", "spans"),
    [
        ("items.request", "06 0003 0304 0005", "size@0..0=6, list@1..6"),
        ("items.request", "02 0003 0304 0005", "size@0..0=2, list@1..2, tail@3..4=772, extra@5..6 length"),
        ("items.request", "03 0003 0304 0005", "size@0..0=3, list@1..2, tail@3..4=772, extra@5..6 length"),
        ("items.request", "04 0003 03", "size@0..0=4, list@1..3-1 length"),
        ("items.request", "04 0003", "size@0..0=4, list@1..2-2 length"),
        (
            "items.request",
            "0A 0003 0003 0003 0003 0003 0005",
            "size@0..0=10, list@1..10, tail@11..12=5",
        ),
        ("items.request", "04", "size@0..0=4"),
        ("items.response", "41 42 43 44 45 46 47 07", "text@0..6, mark@7..7=7"),
        ("bits.response", "000001 02", "rest@0..2, extra@3..3 length"),
    ],
)
def test_a_payload_of_a_wrong_size(message: str, payload: str, spans: str) -> None:
    found = Fields(_plan().message(message).payload, bytes.fromhex(payload), sound=True)
    assert (", ".join(map(_shown, found.spans)), found.wrong, found.bad) == (spans, [], True)


@pytest.mark.parametrize(
    ("message", "payload", "wrong"),
    [
        ("items.request", "04 0003 03FF 0005", [("list", 511, 3)]),
        ("items.request", "04 03FF 02FF 0005", [("list", 511, 1)]),
        ("items.request", "04 0003 02FF 0007", [("list", 383, 3), ("tail", 7, 5)]),
        ("items.response", "80 42 07", [("text", 0x80, 0)]),
        ("items.response", "41 C3 08", [("text", 0xC3, 1), ("mark", 8, 2)]),
        ("bits.request", "16 00 00", [("low", 6, 0)]),
        ("bits.request", "81 40 00", [("odd", 0, 1)]),
        ("bits.request", "80 00 80", [("low", 0, 0), ("odd", 0, 1)]),
    ],
)
def test_a_wrong_value_is_where_it_begins(
    message: str, payload: str, wrong: list[tuple[str, int, int]]
) -> None:
    found = Fields(_plan().message(message).payload, bytes.fromhex(payload), sound=True)
    assert [(each.of.name, each.seen, each.at) for each in found.wrong] == wrong
    assert {span.of.name for span in found.spans if span.fault and not isinstance(span.of, Around)} == {
        name for name, _, _ in wrong
    }


def test_nothing_is_judged_in_a_payload_that_is_cut() -> None:
    plan = _plan().message("items.request").payload
    found = Fields(plan, bytes.fromhex("04 03FF 03"), sound=False)
    assert (found.bad, found.wrong) == (False, [])
    assert ", ".join(map(_shown, found.spans)) == "size@0..0=4, list@1..3-1 truncated"
