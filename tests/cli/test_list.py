"""`qlinkgen list` prints every name that can be used as PROTOCOL."""

from __future__ import annotations

import json
from pathlib import Path

from qlinkgen.schema import library, shipped
from tests.cli.conftest import Run


def test_every_protocol_is_listed(qlinkgen: Run) -> None:
    result = qlinkgen("list")
    listed = {line.split("  ")[0]: line.split("  ")[-1].strip() for line in result.lines[2:] if line}
    assert listed == dict.fromkeys(shipped(), "with engines") | dict.fromkeys(library(), "library")
    assert result.code == 0


def test_a_protocol_of_the_library_is_used_by_name(qlinkgen: Run, tmp_path: Path) -> None:
    assert "modbus_rtu" in qlinkgen("show", "modbus_rtu").lines[0]
    result = qlinkgen("generate", "modbus_rtu", "--target", "python", "-o", str(tmp_path))
    assert (result.code, result.err) == (0, "")
    assert (tmp_path / "python/wire/modbus_rtu.py").is_file()  # not the package of the shipped codecs
    manifest = json.loads((tmp_path / "manifest.json").read_text("utf-8"))
    assert manifest["protocols"]["modbus_rtu"]["schema"] == "modbus_rtu"
    again = qlinkgen("generate", "modbus_rtu", "--target", "python", "-o", str(tmp_path), "--check")
    assert again.code == 0, again.err


def test_an_unknown_name_is_compared_with_the_library_too(qlinkgen: Run) -> None:
    assert "did you mean 'modbus_rtu'?" in qlinkgen("show", "modbus_rtv").err
