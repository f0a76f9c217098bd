"""`qlinkgen init` writes a schema that is valid, and replaces nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from qlinkgen.schema import find, library, lint, load, shipped
from tests.cli.conftest import Run


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_small_bus(qlinkgen: Run, here: Path) -> None:
    result = qlinkgen("init", "pump")
    assert (result.code, result.out) == (0, "pump.yaml\n")
    assert lint(here / "pump.yaml") == []
    assert load(here / "pump.yaml").name == "pump"


@pytest.mark.parametrize("name", [*shipped(), *library()])
def test_like_each_protocol(qlinkgen: Run, here: Path, name: str) -> None:
    assert qlinkgen("init", "mine", "--like", name).code == 0
    made, original = load(here / "mine.yaml"), load(find(name))
    assert made.name == "mine"
    assert (made.messages, made.frame, made.bus) == (original.messages, original.frame, original.bus)


def test_nothing_is_replaced(qlinkgen: Run, here: Path) -> None:
    (here / "pump.yaml").write_text("mine", "utf-8")
    result = qlinkgen("init", "pump")
    assert result.code == 2
    assert "pump.yaml exists; choose another name" in result.err
    (here / "modbus_rtu.yaml").write_text("mine", "utf-8")
    assert "modbus_rtu.yaml exists" in qlinkgen("init", "other", "--like", "modbus_ascii").err
    assert sorted(path.name for path in here.iterdir()) == ["modbus_rtu.yaml", "pump.yaml"]


@pytest.mark.parametrize("name", ["Pump", "a b", "../x", "", "x.yaml"])
def test_a_name_is_a_name(qlinkgen: Run, here: Path, name: str) -> None:
    result = qlinkgen("init", name)
    assert (result.code, list(here.iterdir())) == (2, [])
    assert "is not a name" in result.err
