"""Every message has vectors."""

from __future__ import annotations

import pytest

from qlinkgen.backends.vectors import KINDS
from tests.proof import cases


@pytest.mark.parametrize("name", cases.PROTOCOLS)
def test_every_message_has_every_kind_of_vector(name: str) -> None:
    found: dict[str, set[str]] = {message.name: set() for message in cases.protocol(name).messages}
    for row in cases.generated(name)["vectors"]:
        found[row["message"]] |= set(row["kinds"])
    assert {message: set(KINDS) - kinds for message, kinds in found.items() if kinds != set(KINDS)} == {}


@pytest.mark.parametrize("name", cases.SHIPPED)
def test_every_message_has_a_fault(name: str) -> None:
    messages = {row["message"] for row in cases.generated(name)["faults"]}
    # Errors in a packet's request are undetectable, unless a value has a range.
    expected = {
        each.name
        for each in cases.protocol(name).messages
        if name != "mc1231a" or each.direction == "response"
    }
    assert expected <= messages


@pytest.mark.parametrize("name", ["qlink", "trio"])
def test_every_message_is_worked_by_hand(name: str) -> None:
    messages = {row["message"] for row in cases.by_hand(name)["vectors"]}
    assert messages == {message.name for message in cases.protocol(name).messages}


@pytest.mark.parametrize("name", cases.SHIPPED)
def test_every_entry_worked_by_hand_names_its_source(name: str) -> None:
    lists = [rows for rows in cases.by_hand(name).values() if isinstance(rows, list)]
    assert [row for rows in lists for row in rows if not row.get("source")] == []


@pytest.mark.parametrize("name", cases.PROTOCOLS)
def test_bounds_and_pattern_match_their_names(name: str) -> None:
    for case in cases.cases(name):
        smallest, largest = case.message.min_size, case.message.max_size
        if "minimum" in case.kinds:
            assert len(case.payload) == smallest
        if "maximum" in case.kinds or "a5" in case.kinds:
            assert len(case.payload) == largest
