"""Records on the command line: JSON objects in and out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.records.test_records import SCHEMA


@pytest.fixture
def sky(tmp_path: Path) -> Path:
    path = tmp_path / "sky.yaml"
    path.write_text(SCHEMA, "utf-8")
    return path


def test_records_are_objects(qlinkgen: Run, sky: Path) -> None:
    given = {"satellites": [{"system": "galileo", "number": 7, "place": {"x": -1, "y": 1.5}}], "rest": []}
    wire = qlinkgen("encode", sky, "view.response", "--json", json.dumps(given)).out.strip()
    assert json.loads(qlinkgen("decode", sky, "--direction", "response", wire).out)["fields"] == given
    assert "satellites[0].place.y" in qlinkgen("explain", sky, "--direction", "response", wire).out


def test_a_record_is_an_argument_in_json(qlinkgen: Run, sky: Path) -> None:
    done = qlinkgen("encode", sky, "view", 'home={"x": -1, "y": 1.5}')
    assert done.out.startswith("b562040001ffff0f00")


def test_each_record_is_shown_once(qlinkgen: Run, sky: Path) -> None:
    shown = qlinkgen("show", sky, "view.response").out
    assert "satellite[0..12, by count]" in shown
    assert shown.count("\npoint\n") == 1
    assert "Steps of a record satellite" in qlinkgen("show", sky, "view.response", "--plan").out


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ('{"home": 5}', "home: 5 is not a record"),
        ('{"home": {"z": 5}}', "a record point has no 'z'"),
        ('{"home": {"x": "much"}}', "home.x: 'much' is not a whole number"),
    ],
)
def test_what_is_wrong_is_named(given: str, text: str, qlinkgen: Run, sky: Path) -> None:
    done = qlinkgen("encode", sky, "view", "--json", given)
    assert done.code == 2
    assert text in done.err
