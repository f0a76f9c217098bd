"""Sizes of payloads and of their runs."""

from __future__ import annotations

from functools import cache

import pytest

from qlinkgen.plan import plan_of
from qlinkgen.plan.expr import Size, Term, Within
from qlinkgen.plan.payload import PayloadPlan
from qlinkgen.schema import loads

_SCHEMA = """
qlinkgen: 1
protocol: {name: runs, title: Runs, revision: "1", source: Tests, doc: Payloads with runs}
byteorder: big
frame:
  parts:
    start: {role: constant, value: AA}
    id: {role: message, type: u8}
    length: {role: length, type: u16, counts: [data]}
    data: {role: payload, size: 0..900}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands:
  counted:
    id: 1
    request:
      items: {type: u8, counts: words}
      octets: {type: u8, counts: longs, counts_in: bytes}
      fixed: "u16[3]"
      words: "u16[2..40]"
      longs: "u32[1..50]"
      text: "text[0..9]"
    response:
      wide: {type: u16, counts: rest, counts_in: bytes}
      narrow: {type: u8, counts: rest, counts_in: bytes}
      rest: "u32[]"
"""


@cache
def _payload(message: str = "counted.request") -> PayloadPlan:
    protocol, faults = loads(_SCHEMA, "runs.yaml")
    assert protocol is not None, [str(fault) for fault in faults]
    return plan_of(protocol).message(message).payload


def test_bounds_and_runs() -> None:
    plan = _payload()
    assert (plan.least, plan.most) == (2 + 6 + 4 + 4, 2 + 6 + 80 + 200 + 9)
    assert [run.name for run in plan.runs] == ["words", "longs", "text"]
    assert plan.size == Size(8, (Term("words", 2), Term("longs", 4), Term("text", 1)))
    assert not plan.fixed


@pytest.mark.parametrize(
    ("message", "name", "bounds"),
    [
        ("counted.request", "words", (2, 40)),
        ("counted.request", "longs", (1, 50)),
        ("counted.request", "text", (0, 9)),
        ("counted.response", "rest", (0, 63)),
    ],
)
def test_no_more_is_sent_than_a_count_can_tell(message: str, name: str, bounds: tuple[int, int]) -> None:
    plan = _payload(message)
    assert plan.sendable(plan.run(name)) == Within(*bounds)


def test_a_run_is_found_by_its_name() -> None:
    assert [_payload().run(name).name for name in ("fixed", "words", "text")] == ["fixed", "words", "text"]


def test_fewest_bytes_where_some_counts_are_known() -> None:
    plan = _payload()
    assert plan.least_of(()) == Size(16)
    assert plan.least_of(("longs",)) == Size(12, (Term("longs", 4),))
    assert plan.least_of(("words", "longs", "text")) == plan.size
