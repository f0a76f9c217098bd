"""Models are kept for the next start, and read again whenever something is different."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.cli import model_cache
from qlinkgen.cli.common import load_protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.schema import loader
from tests.cli.conftest import THERMO, Run
from tests.cli.wire import ENVIRONMENT, call
from tests.support import remembering

Reads = Callable[[], int]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of kept models, below one that does not exist yet."""
    folder = tmp_path / "kept" / "models"
    monkeypatch.setenv(model_cache.VARIABLE, str(folder))
    return folder


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> Reads:
    """Returns how often a schema was read since the last call."""
    count = 0
    real = loader.load

    def counted(*arguments: object, **options: object) -> object:
        nonlocal count
        count += 1
        return real(*arguments, **options)  # type: ignore[arg-type]

    def taken() -> int:
        nonlocal count
        found, count = count, 0
        return found

    monkeypatch.setattr(loader, "load", counted)
    return taken


def test_a_schema_is_read_once(folder: Path, reads: Reads, thermo: Path) -> None:
    first = load_protocol(str(thermo))
    assert reads() == 1
    assert load_protocol(str(thermo)) == first
    assert reads() == 0
    (file,) = folder.iterdir()
    assert file.stat().st_mode & 0o077 == 0
    assert load_protocol(str(thermo), crc=None, version=None) is not first


def test_what_is_different_is_read(folder: Path, reads: Reads, thermo: Path) -> None:
    load_protocol(str(thermo))
    thermo.write_text(THERMO.replace("range: -40..85", "range: -40..90"))
    assert load_protocol(str(thermo)).message("set_target").values[1].type.maximum == 9000  # type: ignore[union-attr]
    other = thermo.with_name("other.yaml")
    other.write_text(thermo.read_text())
    assert load_protocol(str(other)).schema_file == "other.yaml"
    load_protocol("qlink", Replacement("crc-16/xmodem"))
    load_protocol("qlink", Replacement("crc-16/xmodem"))
    assert reads() == 7  # each once, but the last two twice: without their option first
    assert len(list(folder.iterdir())) == 3


def test_an_included_file_that_changes(
    folder: Path, reads: Reads, thermo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loader, "loads", remembering._read.__wrapped__)  # by the text of both files
    common, _, rest = THERMO.partition("enums:")
    enums, _, rest = rest.partition("frame:")
    thermo.with_name("types.yaml").write_text(f"{common}enums:{enums}frame:{rest}")
    thermo.write_text(f"{common}include: types.yaml\nframe:{rest}")
    modes = [each.name for each in load_protocol(str(thermo)).enums[0].members]
    assert modes == ["off", "heat", "cool"]
    load_protocol(str(thermo))
    assert reads() == 1
    text = thermo.with_name("types.yaml").read_text()
    thermo.with_name("types.yaml").write_text(text.replace("cool: 2", "cold: 2"))
    assert load_protocol(str(thermo)).enums[0].members[2].name == "cold"
    assert reads() == 1
    assert folder.is_dir()


@pytest.mark.parametrize("text", ["", "[", "[]", "{}", "[[1]]", '[["os.system", "true"]]', "\0"])
def test_a_spoilt_file_is_replaced(folder: Path, reads: Reads, thermo: Path, text: str) -> None:
    found = load_protocol(str(thermo))
    (file,) = folder.iterdir()
    whole = file.read_text()
    file.write_text(text)
    assert load_protocol(str(thermo)) == found
    assert (reads(), file.read_text()) == (2, whole)


@pytest.mark.skipif(sys.platform == "win32", reason="permissions of POSIX")
def test_what_others_can_write_is_not_believed(folder: Path, reads: Reads, thermo: Path) -> None:
    load_protocol(str(thermo))
    (file,) = folder.iterdir()
    file.chmod(0o666)
    load_protocol(str(thermo))
    folder.chmod(0o777)
    load_protocol(str(thermo))
    assert reads() == 3


@pytest.mark.skipif(sys.platform == "win32", reason="pipes of POSIX")
def test_a_folder_or_a_pipe_in_place_of_a_file(folder: Path, reads: Reads, thermo: Path) -> None:
    load_protocol(str(thermo))
    (file,) = folder.iterdir()
    file.unlink()
    file.mkdir()
    load_protocol(str(thermo))
    assert list(folder.iterdir()) == [file]
    file.rmdir()
    os.mkfifo(file, 0o600)
    load_protocol(str(thermo))
    assert reads() == 3
    assert file.is_file()


def test_no_folder(folder: Path, reads: Reads, thermo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.parent.write_text("a file in its place")
    load_protocol(str(thermo))
    monkeypatch.setenv(model_cache.VARIABLE, "")
    load_protocol(str(thermo))
    assert reads() == 2


def test_old_files_are_removed(folder: Path, thermo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(model_cache, "MOST", 3)
    for number in range(6):
        thermo.write_text(f"{THERMO}# {number}\n")
        load_protocol(str(thermo))
        for at, file in enumerate(sorted(folder.iterdir(), key=lambda each: each.stat().st_mtime)):
            os.utime(file, (at, at))
    assert len(list(folder.iterdir())) == 3


def test_wrong_schemas_are_not_kept(qlinkgen: Run, folder: Path, thermo: Path) -> None:
    thermo.write_text(THERMO.replace("i16[0..8]", "i17[0..8]"))
    for _ in range(2):
        assert qlinkgen("show", thermo).code == 1
    assert not folder.exists()


def test_a_second_start_reads_and_generates_nothing(tmp_path: Path) -> None:
    environment = {
        **ENVIRONMENT,
        model_cache.VARIABLE: str(tmp_path / "models"),
        "PYTHONPROFILEIMPORTTIME": "1",
    }
    for words in (
        ("encode", "qlink", "motor_position", "--node", "3"),
        ("decode", "qlink", "a5a504210315e8"),
    ):
        call(*words, environment=environment)
        done = call(*words, environment=environment)
        assert done.returncode == 0
        imported = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
        heavy = {
            "pydantic",
            "yaml",
            "jinja2",
            "rich",
            "serial",
            "qlinkgen.schema.loader",
            "qlinkgen.link.master",
        }
        assert not imported & heavy
        assert "qlinkgen.model.protocol" in imported
