"""`qlinkgen generate --package`: user packages next to one another and to qlinkgen."""

from __future__ import annotations

import ast
import keyword
import os
import subprocess
import sys
from pathlib import Path

import pytest

from qlinkgen.model.texts import visible
from tests.cli.conftest import Run

REPOSITORY = Path(__file__).resolve().parents[2]
PYTHON = ("--target", "python", "--target", "bus")
MODULES = {
    "__init__.py", "_checks.py", "_support.py", "_thermo_aio.py", "_thermo_bus.py", "py.typed", "thermo.py",
    "thermo_bus.py",
}  # fmt: skip


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def alone(code: str, folder: Path) -> str:
    """Return the output of a program that has a folder on its path, but not qlinkgen."""
    command = [sys.executable, "-I", "-S", "-c", f"import sys; sys.path.insert(0, {str(folder)!r})\n{code}"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("package", ["wire", "my.wire", "_a._b.c3", "match.type", "Thermo", "console.com"])
def test_the_layout(qlinkgen: Run, out: Path, thermo: Path, package: str) -> None:
    assert qlinkgen("generate", thermo, *PYTHON, "--package", package, "-o", out).code == 0
    folder = package.replace(".", "/")
    assert files(out) == {f"{folder}/{name}" for name in MODULES} | {"manifest.json"}
    code = (
        f"from {package} import thermo, thermo_bus; print(thermo_bus.MasterCalls, 'qlinkgen' in sys.modules)"
    )
    assert alone(code, out) == f"<class '{package}.thermo_bus.MasterCalls'> False\n"


def test_all_imports_are_relative_or_of_the_standard_library(qlinkgen: Run, out: Path, thermo: Path) -> None:
    """Only the modules that open ports need qlinkgen, and of it the buses."""
    qlinkgen("generate", thermo, "qlink", "trio", "mc1231a", *PYTHON, "--package", "my.wire", "-o", out)
    found = set()
    for file in (out / "my/wire").glob("*.py"):
        opens = file.name.endswith(("_aio.py", "_bus.py")) and file.name.startswith("_")
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                found |= {name.name.partition(".")[0] for name in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                assert str(node.module).startswith("qlinkgen.bus.") == (opens and node.module != "__future__")
                found.add(str(node.module).partition(".")[0])
    assert found - {"qlinkgen"} <= sys.stdlib_module_names
    assert not [path for path in out.rglob("*") if "qlinkgen" in path.name]


def test_two_packages_in_one_process(qlinkgen: Run, out: Path, thermo: Path) -> None:
    qlinkgen("generate", thermo, *PYTHON, "--package", "one.wire", "-o", out)
    thermo.write_text(thermo.read_text().replace("0x10", "0x20"))
    qlinkgen("generate", thermo, *PYTHON, "--package", "two.wire", "-o", out / "other")
    code = f"""\
sys.path.append({str(out / "other")!r})
from one.wire import thermo as one
from two.wire import thermo as two
print(one.SetTargetRequest.ID, two.SetTargetRequest.ID, one.CodecError is two.CodecError)
"""
    assert alone(code, out) == "16 32 False\n"


def test_beside_the_shipped_codecs(qlinkgen: Run, out: Path, thermo: Path) -> None:
    """The default name hides neither `codecs` of Python nor anything of qlinkgen."""
    qlinkgen("generate", thermo, *PYTHON, "-o", out)
    code = "import codecs; from wire import thermo; from qlinkgen.codecs import qlink; print(codecs.lookup)"
    path = os.pathsep.join([str(out / "python"), str(REPOSITORY)])
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env={**os.environ, "PYTHONPATH": path}, capture_output=True, check=True)
    assert done.stdout == b"<built-in function lookup>\n"


def test_another_package_takes_the_place_of_the_one_before(qlinkgen: Run, out: Path, thermo: Path) -> None:
    qlinkgen("generate", thermo, *PYTHON, "--package", "one", "-o", out)
    result = qlinkgen("generate", thermo, *PYTHON, "--package", "two", "-o", out)
    assert (result.code, f", {len(MODULES)} removed" in result.out) == (0, True)
    assert files(out) == {f"two/{name}" for name in MODULES} | {"manifest.json"}


def test_one_package_for_several_schemas(qlinkgen: Run, out: Path, thermo: Path) -> None:
    for schema in ("qlink", thermo, "trio"):
        assert qlinkgen("generate", schema, *PYTHON, "--package", "mine", "-o", out).code == 0
    code = "from mine import qlink, thermo, trio; print(thermo.CodecError is trio.CodecError)"
    assert alone(code, out) == "True\n"
    assert qlinkgen("generate", thermo, *PYTHON, "--package", "mine", "-o", out, "--check").code == 0


def test_a_package_of_ones_own_is_not_touched(qlinkgen: Run, out: Path, thermo: Path) -> None:
    (out / "my").mkdir(parents=True)
    (out / "my/__init__.py").write_text("mine = 1\n")
    assert qlinkgen("generate", thermo, *PYTHON, "--package", "my.wire", "-o", out).code == 0
    assert alone("import my; from my.wire import thermo; print(my.mine)", out) == "1\n"
    result = qlinkgen("generate", thermo, *PYTHON, "--package", "my", "-o", out)
    assert (result.code, f"{out}/my/__init__.py was not written by qlinkgen" in result.err) == (1, True)


@pytest.mark.parametrize(
    "name",
    [
        "", ".", "a.", ".a", "a..b", "1a", "a-b", "a b", "a/b", "../a", "/a", "a\\b", "ä", "ﬁ", "a.ª",
        "a\n", "a\0b", "qlinkgen", "qlinkgen.codecs", "my.qlinkgen", "QLinkGen", "codecs", "json.wire",
        "site", "con", "my.Aux", "nul.wire", "com1", "LPT9.a", *keyword.kwlist,
    ],
)  # fmt: skip
def test_names_that_no_package_can_have(qlinkgen: Run, out: Path, thermo: Path, name: str) -> None:
    result = qlinkgen("generate", thermo, "--package", name, "-o", out)
    assert result.code == 2
    assert f"--package {visible(name)}" in result.err
    assert not out.exists()


def renamed(thermo: Path, name: str) -> Path:
    copy = thermo.with_name(f"{name}.yaml")
    copy.write_text(thermo.read_text().replace("name: thermo,", f"name: {name},"))
    return copy


def test_a_protocol_cannot_have_the_name_of_a_bus_module(qlinkgen: Run, out: Path, thermo: Path) -> None:
    other = renamed(thermo, "thermo_bus")
    for schemas in ((thermo, other), (other, thermo)):
        result = qlinkgen("generate", *schemas, *PYTHON, "-o", out)
        assert (result.code, "is an output of" in result.err, out.exists()) == (2, True, False)
    for first, second in ((thermo, other), (other, thermo)):
        folder = out / first.stem
        assert qlinkgen("generate", first, *PYTHON, "-o", folder).code == 0
        before = {name: (folder / name).read_bytes() for name in files(folder)}
        result = qlinkgen("generate", second, *PYTHON, "-o", folder)
        assert (result.code, f"belongs to the protocol {first.stem}" in result.err) == (1, True)
        assert {name: (folder / name).read_bytes() for name in files(folder)} == before


# What is shipped


def test_the_shipped_codecs_are_the_committed_ones() -> None:
    from qlinkgen import codecs

    committed = REPOSITORY / "generated/python/codecs"
    assert Path(str(codecs.__file__)).resolve().parent == committed
    assert (REPOSITORY / "qlinkgen/codecs").samefile(committed)
    assert not list((REPOSITORY / "generated").rglob("qlinkgen_codecs"))


@pytest.mark.parametrize("name", ["qlink", "trio", "mc1231a", "qlink_bus", "mc1231a_bus"])
def test_importing_a_shipped_codec_is_cheap(name: str) -> None:
    code = f"old = set(sys.modules); import qlinkgen.codecs.{name}; print(*set(sys.modules) - old)"
    new = set(alone(code, REPOSITORY).split())
    own = {
        "qlinkgen",
        "qlinkgen.codecs",
        "qlinkgen.codecs._checks",
        "qlinkgen.codecs._support",
        f"qlinkgen.codecs.{name}",
    }
    own.add(f"qlinkgen.codecs.{name.removesuffix('_bus')}")
    assert {each.partition(".")[0] for each in new - own} <= sys.stdlib_module_names
    assert new.isdisjoint({"dataclasses", "enum", "typing"})  # what costs more than the codec itself
