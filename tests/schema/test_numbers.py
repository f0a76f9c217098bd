"""Defaults at the bounds of their field, and one step past them."""

from __future__ import annotations

import pytest

from qlinkgen.schema import loads

_SCHEMA = """
qlinkgen: 1
protocol: {name: bounds, title: Bounds, revision: "1", source: Tests, doc: Defaults at bounds}
byteorder: big
frame:
  parts:
    start: {role: constant, value: AA}
    id: {role: message, type: u8}
    data: {role: payload, size: 0..8}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands:
  set:
    id: 1
    request: {value: FIELD}
    response: {}
"""


def _rules(field: str) -> list[str]:
    _, faults = loads(_SCHEMA.replace("FIELD", field), "bounds.yaml")
    return [fault.rule for fault in faults]


@pytest.mark.parametrize(
    ("field", "low", "high"),
    [
        ("{type: u16, range: 3..900, default: NUMBER}", "3", "900"),
        ("{type: i8, range: -3..-1, default: NUMBER}", "-3", "-1"),
        ("{type: u8, range: 2..4, scale: 0.5, default: NUMBER}", "2", "4"),
        ("{type: u8, bits: {low: {at: 0..2, range: 1..5, default: NUMBER}}}", "1", "5"),
    ],
)
def test_a_default_may_be_a_bound_and_nothing_beyond(field: str, low: str, high: str) -> None:
    step = 0.5 if "scale" in field else 1
    for bound, beyond in ((low, float(low) - step), (high, float(high) + step)):
        assert _rules(field.replace("NUMBER", bound)) == []
        outside = field.replace("NUMBER", f"{beyond:g}")
        assert _rules(outside) == ["default-out-of-range"], outside


@pytest.mark.parametrize(
    ("kind", "low", "high"),
    [("u8", 0, 255), ("i8", -128, 127), ("u16", 0, 65535), ("i24", -(1 << 23), (1 << 23) - 1)],
)
def test_a_default_may_be_the_last_number_that_its_type_holds(kind: str, low: int, high: int) -> None:
    for bound, beyond in ((low, low - 1), (high, high + 1)):
        assert _rules(f"{{type: {kind}, default: {bound}}}") == []
        assert _rules(f"{{type: {kind}, default: {beyond}}}") == ["value-does-not-fit"]
