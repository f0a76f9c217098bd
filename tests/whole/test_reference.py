"""Tests of the reference and of the random schemas."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from qlinkgen.schema import loads
from tests.proof import cases
from tests.support.whole import schemas
from tests.support.whole.reference import Reference, Wrong, checks
from tests.support.whole.trial import traits

ROOT = Path(__file__).parents[2]
#: Schemas that are checked without generating outputs.
MANY = 120


def reference(name: str) -> Reference:
    folder = ROOT / "schemas" if name in cases.SHIPPED else ROOT / "tests" / "schemas"
    return Reference((folder / f"{name}.yaml").read_text("utf-8"))


@pytest.mark.parametrize("name", cases.PROTOCOLS)
def test_the_reference_agrees_with_every_vector(name: str) -> None:
    made = reference(name)
    for case in cases.cases(name):
        message = made.by_name[case.message.name]
        seen = made.decode(made.direction_of(message), case.wire, case.request)
        assert seen.name == message.name
        assert (seen.address or 0) == case.address
        if not case.decode_only:
            assert made.encode(seen.name, seen.values, seen.address or 0, case.request) == (
                case.payload,
                case.wire,
            )


@pytest.mark.parametrize("name", cases.PROTOCOLS)
def test_the_reference_refuses_every_wrong_frame(name: str) -> None:
    made = reference(name)
    for refusal in cases.refusals(name):
        message = made.by_name[refusal.message.name]
        with pytest.raises(Wrong):
            made.decode(made.direction_of(message), refusal.wire, refusal.request)


@pytest.mark.parametrize("name", sorted(checks.catalogue()))
def test_check_values_are_those_of_the_catalogue(name: str) -> None:
    assert checks.compute(name, b"123456789") == int(checks.catalogue()[name]["check"], 16)


def test_a_seed_gives_one_schema() -> None:
    texts = [schemas.generate(seed, hostile=hostile) for seed in range(20) for hostile in (False, True)]
    assert texts == [
        schemas.generate(seed, hostile=hostile) for seed in range(20) for hostile in (False, True)
    ]
    assert len(set(texts)) == len(texts)


def test_few_schemas_are_refused_and_every_shape_occurs() -> None:
    refused: Counter[str] = Counter()
    shapes: Counter[str] = Counter()
    for seed in range(MANY):
        text = schemas.generate(seed)
        protocol, faults = loads(text, "whole.yaml")
        refused.update({each.rule for each in faults if each.severity == "error"} if protocol is None else ())
        made = Reference(text)
        shapes.update(traits(made).split())
    assert refused.total() < MANY // 10, refused
    wanted = "hunt search lead bare length counts unchecked end stuffed payload marked packets".split()  # noqa: SIM905
    assert {word for word in wanted if not shapes[word]} == set()
