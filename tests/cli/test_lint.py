"""`qlinkgen lint`: the lines that editors jump to, JSON, and the exit code."""

from __future__ import annotations

import json
from pathlib import Path

from tests.cli.conftest import Run


def test_shipped_schemas_have_no_errors(qlinkgen: Run) -> None:
    result = qlinkgen("lint", "qlink", "trio", "mc1231a")
    assert result.code == 0
    assert result.err.startswith("3 schemas, 0 errors, ")
    assert {line.split(": ")[1] for line in result.lines} == {"warning[unconfirmed]"}


def test_every_fault_has_place_rule_and_hint(qlinkgen: Run, thermo: Path) -> None:
    text = (
        thermo.read_text()
        .replace("type: i16, scale", "type: i17, scale")
        .replace("mode: {type: mode,", "mode: {typo: mode,")
    )
    thermo.write_text(text)
    result = qlinkgen("lint", thermo)
    assert result.code == 1
    errors = [line for line in result.lines if ": error[" in line]
    assert len(errors) >= 2
    for line in result.lines:
        file, row, column, *_ = line.split(":")
        assert file == str(thermo)
        assert int(row) > 0
        assert int(column) > 0


def test_warnings_do_not_fail(qlinkgen: Run, thermo: Path) -> None:
    result = qlinkgen("lint", thermo)
    assert result.code == 0
    assert "warning[unconfirmed]" in result.out
    assert result.err == "1 schema, 0 errors, 1 warning\n"


def test_json(qlinkgen: Run, thermo: Path) -> None:
    result = qlinkgen("lint", thermo, "--format", "json")
    (fault,) = json.loads(result.out)
    assert fault["rule"] == "unconfirmed"
    assert fault["file"] == str(thermo)
    assert set(fault) == {"file", "line", "column", "rule", "message", "hint", "severity"}
    thermo.write_text(thermo.read_text().replace("    confirmed: false\n", ""))
    assert json.loads(qlinkgen("lint", thermo, "--format", "json").out) == []


def test_a_file_that_is_not_there(qlinkgen: Run) -> None:
    result = qlinkgen("lint", "nowhere/bus.yaml", "qlink")
    assert result.code == 2
    assert "nowhere/bus.yaml:1:1: error[file-unreadable]: cannot read it: No such file" in result.out
    for command in (("lint",), ("show",), ("generate",)):
        result = qlinkgen(*command, "qlnk")
        assert result.code == 2
        assert result.err == "qlinkgen: error: there is no schema 'qlnk'; did you mean 'qlink'?\n"
