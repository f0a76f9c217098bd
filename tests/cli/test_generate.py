"""`qlinkgen generate`: writes what changes, and finds drift, missing files and orphans."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import Run

REPOSITORY = Path(__file__).resolve().parents[2]
#: Files of a package beside its codecs.
SHARED = ("__init__.py", "_checks.py", "_support.py", "py.typed")


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
def test_everything_of_all_protocols(qlinkgen: Run, out: Path) -> None:
    result = qlinkgen("generate", "-o", out)
    assert result.code == 0
    assert {
        "c/qlink.h",
        "c/trio.h",
        "c/mc1231a.h",
        "python/codecs/trio.py",
        "vectors/qlink.json",
    } <= files(out)
    assert {
        "construct/qlinkgen_construct/mc1231a.py",
        "python/codecs/py.typed",
        "manifest.json",
    } <= files(out)
    assert len(result.lines) == 1
    assert f"0 unchanged in {out}" in result.out
    assert qlinkgen("generate", "-o", out).out.startswith("0 written, ")
    assert qlinkgen("generate", "-o", out, "--check").code == 0


def test_only_changed_files_are_written(qlinkgen: Run, out: Path) -> None:
    qlinkgen("generate", "qlink", "--target", "c", "--target", "vectors", "-o", out)
    header, vectors = out / "c/qlink.h", out / "vectors/qlink.json"
    for path in (header, vectors):
        os.utime(path, (1, 1))
    good = header.read_text()
    header.write_text(good + "spoilt")
    assert qlinkgen("generate", "qlink", "--target", "c", "--target", "vectors", "-o", out).out.startswith(
        "1 written"
    )
    assert vectors.stat().st_mtime == 1
    assert header.read_text() == good


def test_check_shows_a_diff(qlinkgen: Run, out: Path) -> None:
    qlinkgen("generate", "trio", "--target", "c", "-o", out)
    header = out / "c/trio.h"
    good = header.read_text()
    header.write_text(good.replace("keypad", "keybad", 1))
    result = qlinkgen("generate", "trio", "--target", "c", "-o", out, "--check")
    assert result.code == 1
    assert f"{header}: differs" in result.out
    assert "--- c/trio.h (in the folder)" in result.out
    assert any(line.startswith("-") and "keybad" in line for line in result.lines)
    assert any(line.startswith("+") and "keypad" in line for line in result.lines)
    assert "run `qlinkgen generate`" in result.err
    assert "keybad" in header.read_text(), "--check must not write"


def test_line_ends_count(qlinkgen: Run, out: Path) -> None:
    qlinkgen("generate", "trio", "--target", "c", "-o", out)
    header = out / "c/trio.h"
    header.write_bytes(header.read_bytes().replace(b"\n", b"\r\n"))
    result = qlinkgen("generate", "trio", "--target", "c", "-o", out, "--check")
    assert (result.code, "line ends differ" in result.out) == (1, True)


def test_missing_files_and_an_empty_folder(qlinkgen: Run, out: Path) -> None:
    result = qlinkgen("generate", "trio", "--target", "c", "-o", out, "--check")
    assert result.code == 1
    assert f"{out}/c/trio.h: is missing" in result.out
    assert not out.exists()


def test_strangers_in_the_folders_are_orphans(qlinkgen: Run, out: Path) -> None:
    qlinkgen("generate", "trio", "--target", "c", "-o", out)
    stranger = out / "c/old.h"
    stranger.write_text("int old;\n")
    (out / "notes.txt").write_text("not in a folder of outputs")
    result = qlinkgen("generate", "trio", "--target", "c", "-o", out, "--check")
    assert result.code == 1
    assert result.out == f"{stranger}: is an orphan: it is not generated from any schema\n"
    result = qlinkgen("generate", "trio", "--target", "c", "-o", out)
    assert result.code == 0
    assert "old.h is among generated files, but qlinkgen did not write it" in result.err
    assert stranger.exists(), "files that were not generated are not removed"


def test_a_renamed_protocol_leaves_no_orphan(qlinkgen: Run, out: Path, thermo: Path) -> None:
    arguments = ("generate", thermo, "--target", "c", "-o", out)
    qlinkgen(*arguments)
    thermo.write_text(thermo.read_text().replace("name: thermo", "name: thermo2"))
    result = qlinkgen(*arguments, "--check")
    assert result.code == 1
    assert f"{out}/c/thermo.h: is an orphan" in result.out
    assert f"{out}/c/thermo2.h: is missing" in result.out
    assert ", 1 removed" in qlinkgen(*arguments).out
    assert files(out) == {"c/thermo2.h", "manifest.json"}


def test_a_deleted_schema_leaves_no_orphan(qlinkgen: Run, out: Path, thermo: Path) -> None:
    qlinkgen("generate", thermo, "trio", "--target", "c", "-o", out)
    assert qlinkgen("generate", "trio", "--target", "c", "-o", out, "--check").code == 0
    thermo.unlink()
    result = qlinkgen("generate", "trio", "--target", "c", "-o", out, "--check")
    assert result.code == 1
    assert "c/thermo.h: is an orphan" in result.out


def test_a_target_may_have_nothing_for_a_protocol(qlinkgen: Run, out: Path) -> None:
    result = qlinkgen("generate", "crsf", "--target", "bus", "-o", out)
    assert (result.code, result.err) == (0, "")
    assert files(out) == {"manifest.json"}


def test_bus_modules_are_in_the_package_of_the_codecs(qlinkgen: Run, out: Path) -> None:
    assert qlinkgen("generate", "qlink", "-o", out).code == 0
    assert qlinkgen("generate", "trio", "-o", out).code == 0
    folder = out / "python/codecs"
    names = [f"_{name}_aio.py _{name}_bus.py {name}_bus.py {name}.py" for name in ("qlink", "trio")]
    assert files(folder) == {*SHARED, *" ".join(names).split()}
    (folder / "qlink_bus.py").write_text("spoilt")
    result = qlinkgen("generate", "qlink", "-o", out, "--check")
    assert (result.code, "codecs/qlink_bus.py: differs" in result.out) == (1, True)


def test_a_bus_that_loses_its_master_leaves_no_bus_module(qlinkgen: Run, out: Path, thermo: Path) -> None:
    assert qlinkgen("generate", thermo, "-o", out).code == 0
    made = out / "python/wire/thermo_bus.py"
    assert made.exists()
    thermo.write_text(thermo.read_text().replace("kind: master_slave", "kind: ring"))
    assert qlinkgen("generate", thermo, "-o", out).code == 0
    assert not made.exists()


def test_protocols_and_targets_do_not_disturb_one_another(qlinkgen: Run, out: Path) -> None:
    qlinkgen("generate", "qlink", "--target", "c", "-o", out)
    qlinkgen("generate", "trio", "--target", "vectors", "-o", out)
    for arguments in (("qlink", "--target", "c"), ("trio", "--target", "vectors")):
        assert qlinkgen("generate", *arguments, "-o", out, "--check").code == 0
    listed = json.loads((out / "manifest.json").read_text())["protocols"]
    assert listed["qlink"] == {"schema": "qlink", "files": {"c": ["c/qlink.h"]}}


def test_a_run_without_schemas_leaves_other_protocols_alone(qlinkgen: Run, out: Path, thermo: Path) -> None:
    arguments = ("generate", "--target", "c", "--target", "bus", "-o", out)
    qlinkgen(*arguments[:1], thermo, *arguments[1:])
    before = files(out)
    assert qlinkgen(*arguments).code == 0
    assert before < files(out)
    assert qlinkgen(*arguments, "--check").code == 0
    thermo.unlink()
    assert qlinkgen(*arguments, "--check").code == 1
    assert qlinkgen(*arguments).code == 0
    assert not {path for path in files(out) if "thermo" in path}


def test_kits_are_made_on_demand(qlinkgen: Run, out: Path, thermo: Path) -> None:
    qlinkgen("generate", thermo, "-o", out)
    assert not (out / "conformance").exists()
    assert qlinkgen("generate", thermo, "--target", "conformance", "-o", out).code == 0
    assert (out / "conformance/thermo_conformance.c").exists()
    assert qlinkgen("generate", thermo, "-o", out, "--check").code == 0


def test_a_dry_run_writes_nothing(qlinkgen: Run, out: Path, thermo: Path) -> None:
    arguments = ("generate", thermo, "--target", "c", "-o", out)
    result = qlinkgen(*arguments, "--dry-run")
    assert result.lines == [f"{out}/c/thermo.h: would be written", f"{out}/manifest.json: would be written"]
    assert not out.exists()
    qlinkgen(*arguments)
    assert qlinkgen(*arguments, "--dry-run").out == ""
    thermo.write_text(thermo.read_text().replace("name: thermo", "name: other"))
    before = files(out)
    assert set(qlinkgen(*arguments, "--dry-run").lines) == {
        f"{out}/c/other.h: would be written",
        f"{out}/c/thermo.h: would be removed",
        f"{out}/manifest.json: would be written",
    }
    assert files(out) == before


def test_list_outputs_writes_nothing(qlinkgen: Run, out: Path) -> None:
    result = qlinkgen("generate", "trio", "--target", "c", "-o", out, "--list-outputs")
    assert result.lines == [f"{out}/c/trio.h", f"{out}/manifest.json"]
    assert not out.exists()


@pytest.mark.parametrize("other", ["crc=xmodem", "crc_over=command,node,data"])
def test_another_check_value(qlinkgen: Run, out: Path, other: str) -> None:
    qlinkgen("generate", "qlink", "--target", "vectors", "-o", out)
    before = (out / "vectors/qlink.json").read_text()
    assert qlinkgen("generate", "qlink", "--target", "vectors", "-o", out, "--set", other).code == 0
    assert (out / "vectors/qlink.json").read_text() != before


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("--set", "crc=crc-16/nonsense"), 2, "--set crc=crc-16/nonsense: unknown checksum algorithm"),
        (("--set", "crc=crc-32/iso-hdlc"), 2, "has 32 bits, crc 16"),
        (("--set", "speed=9600"), 2, "only crc=NAME and crc_over=PART,PART"),
        (("--set", "crc="), 2, "only crc=NAME"),
        (("--set", "crc_over=,"), 2, "only crc=NAME"),
        (("--set", "crc=arc", "--set", "crc=xmodem"), 2, "crc is set twice; omit one of them"),
        (("--set", "crc_over=comand,data"), 2, "unknown part 'comand'; did you mean 'command'?"),
        (("--set", "crc_over=data,command"), 2, "command precedes data on the wire"),
        (("--target", "java"), 2, "'java' is not one of"),
        (("--only", "moton"), 2, "did you mean motion"),
        (("--only", "nope"), 2, "lists them"),
        (("--role", "spy"), 2, "'spy' is not one of"),
        (("qlnk",), 2, "did you mean 'qlink'?"),
        (("nowhere.yaml",), 2, "No such file"),
    ],
)
def test_wrong_arguments(qlinkgen: Run, out: Path, arguments: tuple[str, ...], code: int, said: str) -> None:
    result = qlinkgen("generate", *(() if arguments[0][0] != "-" else ("qlink",)), *arguments, "-o", out)
    assert result.code == code
    assert said in result.err
    assert not out.exists()


def test_faults_of_all_schemas_are_reported_together(
    qlinkgen: Run, out: Path, tmp_path: Path, thermo: Path
) -> None:
    other = tmp_path / "other.yaml"
    other.write_text(thermo.read_text().replace("u8", "u9"))
    thermo.write_text(thermo.read_text().replace("i16", "i17"))
    result = qlinkgen("generate", thermo, other, "-o", out)
    assert result.code == 1
    assert f"{thermo}:" in result.err
    assert f"{other}:" in result.err


def test_role_and_only(qlinkgen: Run, out: Path) -> None:
    qlinkgen("generate", "-o", out)
    whole = (out / "c/qlink.h").stat().st_size
    result = qlinkgen("generate", "--role", "slave", "--only", "motion", "--only", "keypad_mode", "-o", out)
    assert result.code == 0, result.err
    text = (out / "c/qlink.h").read_text()
    assert len(text) < whole / 2
    assert "motion_request" in text
    assert "loop_back" not in text
    assert not (out / "c/mc1231a.h").exists(), "nothing is left of it"


def test_two_protocols_of_one_name(qlinkgen: Run, out: Path, tmp_path: Path, thermo: Path) -> None:
    other = tmp_path / "other.yaml"
    other.write_text(thermo.read_text() + "\n")
    assert "two schemas describe a protocol 'thermo'" in qlinkgen("generate", thermo, other, "-o", out).err


def test_a_folder_that_cannot_be_written(qlinkgen: Run, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    result = qlinkgen("generate", "trio", "--target", "c", "-o", tmp_path / "out")
    assert result.code == 1
    assert "system error" in result.err


def test_equal_input_gives_equal_output(tmp_path: Path) -> None:
    """Under different hash seeds, in different folders, from different places."""
    texts = []
    for seed in ("0", "4711"):
        folder = tmp_path / seed
        (tmp_path / f"at{seed}").mkdir()
        subprocess.run(
            [sys.executable, "-m", "qlinkgen", "generate", "-o", str(folder)],
            check=True,
            cwd=tmp_path / f"at{seed}",
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(REPOSITORY)},
            stdout=subprocess.DEVNULL,
        )
        texts.append({name: (folder / name).read_bytes() for name in files(folder)})
    assert texts[0] == texts[1]


def test_what_is_committed_is_up_to_date(qlinkgen: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(REPOSITORY)
    result = qlinkgen("generate", "--check")
    assert result.code == 0, result.out[:2000]


def test_a_layout_is_kept_like_a_target(qlinkgen: Run, out: Path) -> None:
    assert qlinkgen("generate", "qlink", "--layout", "platformio", "-o", str(out)).code == 0
    assert (out / "qlink/library.json").is_file()
    assert qlinkgen("generate", "qlink", "--layout", "platformio", "-o", str(out), "--check").code == 0
    both = qlinkgen("generate", "qlink", "--layout", "cmake", "--target", "c", "-o", str(out))
    assert both.code != 0
    assert "--layout cmake writes a library of the C header; leave out --target c" in both.err
