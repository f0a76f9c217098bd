"""--protocol-version of every command that has it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import THERMO, Run

VERSIONED = THERMO.replace(
    "values: {off: 0, heat: 1, cool: 2}", "values: {off: 0, heat: 1, cool: {value: 2, since: 2.1}}"
)
VERSIONED = VERSIONED.replace("request: {first: u8}", "request: {first: u8, last: {type: u8, since: 2.1}}")
OLD, NEW = ("--protocol-version", "2"), ("--protocol-version", "2.1")


@pytest.fixture
def schema(tmp_path: Path) -> Path:
    file = tmp_path / "thermo.yaml"
    file.write_text(VERSIONED)
    return file


def test_encode_and_decode(qlinkgen: Run, schema: Path) -> None:
    newest = qlinkgen("encode", schema, "get_log", "--node", "1", "first=3", "last=4").out
    assert newest == qlinkgen("encode", schema, "get_log", "--node", "1", "first=3", "last=4", *NEW).out
    old = qlinkgen("encode", schema, "get_log", "--node", "1", "first=3", *OLD).out
    assert old == qlinkgen("encode", schema, "get_log", "--node", "1", "first=3", *OLD).out != newest
    for wire, chosen in ((old, OLD), (newest, NEW)):
        assert '"first": 3' in qlinkgen("decode", schema, wire.strip(), "--direction", "request", *chosen).out
        assert qlinkgen("explain", schema, wire.strip(), "--direction", "request", *chosen).code == 0
    assert qlinkgen("decode", schema, newest.strip(), "--direction", "request", *OLD).code == 1


def test_names_of_a_version(qlinkgen: Run, schema: Path) -> None:
    assert "cool" in qlinkgen("show", schema, "set_target").out
    assert "cool" not in qlinkgen("show", schema, "set_target", *OLD).out
    result = qlinkgen("encode", schema, "set_target", "--node", "1", "mode=cool", *OLD)
    assert "'cool' is unknown; one of off, heat, or a number" in result.err


def test_generate(qlinkgen: Run, schema: Path, tmp_path: Path) -> None:
    for folder, chosen in (("old", OLD), ("new", ())):
        assert qlinkgen("generate", schema, "-o", tmp_path / folder, "--target", "c", *chosen).code == 0
    old, new = ((tmp_path / folder / "c/thermo.h").read_text() for folder in ("old", "new"))
    assert "version 2 of the protocol" in old
    assert ("last;" in old, "last;" in new) == (False, True)


def test_lint(qlinkgen: Run, schema: Path) -> None:
    assert qlinkgen("lint", schema).code == 0
    schema.write_text(VERSIONED.replace("first: u8, last", "last"))
    assert qlinkgen("lint", schema, *OLD).code == 0


@pytest.mark.parametrize("command", ["encode", "decode", "explain", "show", "generate", "lint"])
def test_a_wrong_version(qlinkgen: Run, schema: Path, command: str) -> None:
    result = qlinkgen(command, schema, "--protocol-version", "new")
    assert (result.code, result.err) == (
        2, "qlinkgen: error: --protocol-version new: write numbers with dots between them, like 2.1\n",
    )  # fmt: skip
