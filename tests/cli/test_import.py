"""``qlinkgen import``: output, notes and exit codes."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.cli.conftest import Run

FORMATS = ["header", "csv", "xlsx", "mavlink", "ksy"]
HEADER = "struct state {\n  uint8_t a;\n  void *p;\n};\nstruct level { uint16_t level; };\n"


@pytest.fixture
def header(tmp_path: Path) -> Path:
    path = tmp_path / "tank.h"
    path.write_text(HEADER)
    return path


def test_output_and_notes(qlinkgen: Run, header: Path) -> None:
    result = qlinkgen("import", "header", header, "--name", "tank2")
    assert result.code == 0
    assert result.lines[1] == "qlinkgen: 1"
    assert "protocol: {name: tank2, " in result.out
    (note,) = result.err.splitlines()
    assert note.startswith(f"{header}:3: note: structure state is left out: a pointer or function")


def test_a_file(qlinkgen: Run, header: Path, tmp_path: Path) -> None:
    output = tmp_path / "tank.yaml"
    assert qlinkgen("import", "header", header, "-o", output).code == 0
    assert qlinkgen("lint", output).code == 0
    assert qlinkgen("encode", output, "level", "level=258").out == "01020201\n"
    before = output.read_text()
    again = qlinkgen("import", "header", header, "-o", output)
    assert again.code == 1
    assert f"{output} exists; remove it, or write to another file" in again.err
    assert output.read_text() == before


def test_nothing_to_import(qlinkgen: Run, header: Path) -> None:
    header.write_text("int a;\n#error no")
    result = qlinkgen("import", "header", header)
    assert (result.code, result.out) == (1, "")
    assert result.err.splitlines() == [
        f"{header}:2: note: #error is ignored",
        f"qlinkgen: error: {header}: the header has no structure that can be a message",
    ]


@pytest.mark.parametrize("form", FORMATS)
def test_what_cannot_be_read(qlinkgen: Run, tmp_path: Path, form: str) -> None:
    for name in ("missing", "."):
        result = qlinkgen("import", form, tmp_path / name)
        assert result.code == 2
        assert "cannot read it" in result.err


@pytest.mark.parametrize("form", FORMATS)
def test_debug_is_known_to_every_format(qlinkgen: Run, tmp_path: Path, form: str) -> None:
    assert "cannot read it" in qlinkgen("import", form, tmp_path / "missing", "--debug").err


def test_columns(qlinkgen: Run, tmp_path: Path) -> None:
    table = tmp_path / "tank.csv"
    table.write_text("Feld,Art,Owner\nlevel,u16,bob\n")
    wrong = qlinkgen("import", "csv", table, "--map", "Art=kind")
    assert wrong.code == 2
    assert "--map Art=kind: write COLUMN=KEY with a KEY of message, id," in wrong.err
    assert qlinkgen("import", "csv", table).code == 1
    result = qlinkgen("import", "csv", table, "--map", "Art=type", "--map", "feld=name", "--map", "Owner=")
    assert (result.code, result.err) == (0, "")
    assert "fields: {level: u16}" in result.out


@pytest.mark.parametrize(("form", "package"), [("header", "pycparser.c_parser"), ("xlsx", "openpyxl")])
def test_without_the_package(
    qlinkgen: Run, header: Path, monkeypatch: pytest.MonkeyPatch, form: str, package: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    result = qlinkgen("import", form, header)
    assert result.code == 1
    assert "pip install 'qlinkgen[import]'" in result.err
