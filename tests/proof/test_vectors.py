"""All outputs encode and decode the vectors."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from typing import Any

import pytest

from tests.proof import cases
from tests.proof.conftest import EVERY, Make
from tests.proof.outputs import Decoded, Refused

everywhere = pytest.mark.parametrize("output", EVERY)
every_protocol = pytest.mark.parametrize("name", cases.PROTOCOLS)


@everywhere
@every_protocol
def test_values_become_the_bytes(name: str, output: str, make: Make) -> None:
    made = make(name, output)
    disagreements = []
    for case in cases.cases(name):
        if not case.decode_only:
            payload, wire = made.encode(case.message, case.fields, case.address, case.request, case.beside)
            if (payload, wire) != (case.payload, case.wire):
                disagreements.append((case.message.name, dict(case.fields), wire.hex(), case.wire.hex()))
    assert not disagreements


@everywhere
@every_protocol
def test_bytes_become_the_values(name: str, output: str, make: Make) -> None:
    made = make(name, output)
    disagreements = []
    for case in cases.cases(name):
        found = made.decode(case.message, case.wire, case.request)
        expected = Decoded(case.message.name, case.address, {**case.beside, **case.fields})
        if not same(found, expected):
            disagreements.append((found, expected, case.wire.hex()))
        if not same_values(made.decode_payload(case.message, case.payload), case.fields):
            disagreements.append((found, expected, case.payload.hex()))
    assert not disagreements


@everywhere
@every_protocol
def test_faults_are_refused_for_the_same_reason(name: str, output: str, make: Make) -> None:
    made = make(name, output)
    disagreements = []
    for refusal in cases.refusals(name):
        try:
            found: object = made.decode(refusal.message, refusal.wire, refusal.request)
        except Refused as error:
            found = error.kind
        if found != refusal.kind:
            disagreements.append(
                (refusal.message.name, refusal.what, found, refusal.kind, refusal.wire.hex())
            )
    assert not disagreements


def same(found: Decoded, expected: Decoded) -> bool:
    """Whether the message, and value and type of every expected field are equal."""
    return (found.message, found.address) == (expected.message, expected.address) and same_values(
        found.fields, expected.fields
    )


def same_values(found: Mapping[str, Any], expected: Mapping[str, Any]) -> bool:
    """Whether value and type of every expected field are equal; enums and flags are integers."""
    return all(
        found[name] == value and isinstance(found[name], _kind(value)) for name, value in expected.items()
    )


def _kind(value: object) -> type | tuple[type, ...]:
    # In hand-written vectors and in JSON, a whole number may represent a float or a Decimal.
    return (int, float, Decimal) if type(value) is int else type(value)
