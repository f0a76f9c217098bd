"""`qlinkgen generate --depfile`: a rule that make reads as it was meant."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.conftest import Run

ODD_NAMES = (
    "plain",
    "two words",
    "hash#tag",
    "dol$lar",
    "back\\slash",
    "end\\",
    "a\\ b",
    "co:lon",
    "per%cent",
    "ä",
)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


def test_outputs_and_schemas(qlinkgen: Run, tmp_path: Path, out: Path, thermo: Path) -> None:
    dep = tmp_path / "made/thermo.d"
    arguments = ("generate", thermo, "--target", "c", "--target", "vectors", "-o", out, "--depfile", dep)
    for option in ("--check", "--dry-run", "--list-outputs"):
        qlinkgen(*arguments, option)
        assert not dep.exists()
    assert qlinkgen(*arguments).code == 0
    assert dep.read_text() == f"{out}/c/thermo.h \\\n{out}/vectors/thermo.json: \\\n {thermo}\n"
    listed = set(qlinkgen(*arguments, "--list-outputs").lines)
    assert listed == {f"{out}/c/thermo.h", f"{out}/vectors/thermo.json", f"{out}/manifest.json"}
    time = dep.stat().st_mtime_ns
    assert qlinkgen(*arguments).code == 0
    assert dep.stat().st_mtime_ns == time, "an unchanged one is not written"
    assert qlinkgen("generate", thermo, "trio", "--target", "c", "-o", out, "--depfile", dep).code == 0
    assert "schemas/trio.yaml\n" in dep.read_text()


def test_an_included_schema(qlinkgen: Run, tmp_path: Path, out: Path, thermo: Path) -> None:
    dep, parts, outer = tmp_path / "outer.d", tmp_path / "parts", tmp_path / "outer.yaml"
    parts.mkdir()
    before, commands, after = thermo.read_text("utf-8").partition("commands:\n")
    (parts / "commands.yaml").write_text(commands + after, "utf-8")
    outer.write_text(f"{before}include: parts/commands.yaml\n", "utf-8")
    assert qlinkgen("generate", outer, "--target", "c", "-o", out, "--depfile", dep).code == 0
    assert dep.read_text() == f"{out}/c/thermo.h: \\\n {outer} \\\n {parts}/commands.yaml\n"


def test_a_kit_depends_on_the_vectors_too(qlinkgen: Run, tmp_path: Path, out: Path) -> None:
    dep = tmp_path / "trio.d"
    qlinkgen("generate", "trio", "--target", "conformance", "-o", out, "--depfile", dep)
    assert "schemas/vectors/trio.yaml\n" in dep.read_text()


@pytest.mark.parametrize("name", ODD_NAMES)
def test_make_reads_every_name(
    qlinkgen: Run, tmp_path: Path, thermo: Path, require_tool: Callable[..., str], name: str
) -> None:
    make = require_tool("make", package="make")
    folder = tmp_path / name
    folder.mkdir()
    schema = folder / f"{name}.yaml"
    schema.write_text(thermo.read_text())
    dep = tmp_path / "rule.d"
    arguments = ("generate", schema, "--target", "c", "-o", tmp_path / "out", "--depfile", dep)
    assert qlinkgen(*arguments).code == 0

    def made() -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [make, "-f", str(dep)], capture_output=True, text=True, check=False, cwd=tmp_path
        )

    assert made().returncode == 0
    schema.unlink()
    assert f"No rule to make target '{schema}', needed by '{tmp_path}/out/c/thermo.h'" in made().stderr


def test_make_reads_odd_outputs(
    qlinkgen: Run, tmp_path: Path, thermo: Path, require_tool: Callable[..., str]
) -> None:
    make = require_tool("make", package="make")
    out = tmp_path / "o u#t$"
    dep = tmp_path / "rule.d"
    assert qlinkgen("generate", thermo, "--target", "c", "-o", out, "--depfile", dep).code == 0
    thermo.unlink()
    done = subprocess.run([make, "-f", str(dep)], capture_output=True, text=True, check=False)
    assert f"needed by '{out}/c/thermo.h'" in done.stderr


@pytest.mark.parametrize("text", ["all: build\n", "mine", "\n", "a: \\\n b\nc", "# a: \\\n b\n\n", "\0"])
def test_foreign_files_are_left_alone(
    qlinkgen: Run, tmp_path: Path, out: Path, thermo: Path, text: str
) -> None:
    dep = tmp_path / "Makefile"
    dep.write_text(text)
    result = qlinkgen("generate", thermo, "--target", "c", "-o", out, "--depfile", dep)
    assert (result.code, dep.read_text(), out.exists()) == (1, text, False)
    assert f"--depfile: {dep} was not written by qlinkgen" in result.err


def test_schemas_outputs_folders_and_links_are_left_alone(
    qlinkgen: Run, tmp_path: Path, out: Path, thermo: Path
) -> None:
    (tmp_path / "link.d").symlink_to(thermo)
    schema = thermo.read_text()
    for dep in (thermo, out / "c/thermo.h", tmp_path, tmp_path / "link.d"):
        result = qlinkgen("generate", thermo, "--target", "c", "-o", out, "--depfile", dep)
        assert (result.code, thermo.read_text(), out.exists()) == (1, schema, False)


@pytest.mark.parametrize("place", ["manifest.json", "", "c", "c/thermo.h/d", "c/thermo.d"])
def test_places_of_outputs_are_left_alone_before_they_exist(
    qlinkgen: Run, out: Path, thermo: Path, place: str
) -> None:
    result = qlinkgen("generate", thermo, "--target", "c", "-o", out, "--depfile", out / place)
    assert (result.code, out.exists()) == (1, False)
    assert f"--depfile: {out / place} is" in result.err
    assert qlinkgen("generate", thermo, "--target", "c", "-o", out, "--depfile", out / "thermo.d").code == 0
    assert qlinkgen("generate", thermo, "--target", "c", "-o", out, "--check").code == 0


def test_line_breaks_cannot_be_written(qlinkgen: Run, tmp_path: Path, out: Path, thermo: Path) -> None:
    schema = tmp_path / "a\nb.yaml"
    schema.write_text(thermo.read_text())
    result = qlinkgen("generate", schema, "--target", "c", "-o", out, "--depfile", tmp_path / "d")
    assert (result.code, "line break" in result.err, out.exists()) == (2, True, False)
