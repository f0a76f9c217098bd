"""Every error ends in a sentence and an exit code: pipes, signals, full disks, internal errors."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import qlinkgen as package
from qlinkgen.cli import COMMANDS
from tests.cli.conftest import Run
from tests.cli.full_disk import FULL_DISK

REPOSITORY = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, "-m", "qlinkgen"]
ENVIRONMENT = {
    **os.environ,
    "PYTHONPATH": str(REPOSITORY),
}


def test_version_and_help(qlinkgen: Run) -> None:
    assert qlinkgen("--version").out == f"qlinkgen, version {package.__version__}\n"
    for arguments in (("--help",), ("-h",)):
        result = qlinkgen(*arguments)
        assert result.code == 0
        for name in ("generate", "lint", "show", "encode", "decode", "explain"):
            assert f"\n  {name} " in result.out
            shown = qlinkgen(name, "--help")
            assert shown.code == 0
            assert "\b" not in shown.out
            assert "\\b" not in shown.out


@pytest.mark.parametrize("command", [[], ["lint"]])
def test_help_imports_nothing_heavy(command: list[str]) -> None:
    words = ["qlinkgen", *command, "--help"]
    check = f"import sys; sys.argv={words}; from qlinkgen.cli import cli; cli(standalone_mode=False)"
    heavy = "{'qlinkgen.plan','pydantic','rich','jinja2','construct','yaml','serial'} & set(sys.modules)"
    code = f"{check}; print(*sorted({heavy}), file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", code], env=ENVIRONMENT, capture_output=True, text=True, check=True
    )
    assert done.stderr.strip() == ""


@pytest.mark.parametrize(
    "arguments", [("nonsense",), ("encode",), ("show",), ("decode", "--nonsense"), ("lint",)]
)
def test_wrong_usage(qlinkgen: Run, arguments: tuple[str, ...]) -> None:
    result = qlinkgen(*arguments)
    assert result.code == 2
    assert "Usage: qlinkgen" in result.err
    assert result.out == ""


@pytest.mark.parametrize("command", COMMANDS)
def test_a_misspelt_command(qlinkgen: Run, command: str) -> None:
    """One character too few, too many or swapped: the correct command is suggested."""
    wrong = {command[:-1], command + "x", command[1:], command[0] + command[2] + command[1] + command[3:]}
    for word in wrong - {*COMMANDS, "int", "lnit"}:  # as near to init as to lint
        result = qlinkgen(word)
        assert result.code == 2
        assert f"No such command '{word}'. Did you mean {command}?" in result.err
    for word in ("zzz", "x", "x" * 500):
        assert "Did you mean" not in qlinkgen(word).err


def test_a_reader_that_goes_away() -> None:
    with subprocess.Popen(
        [*COMMAND, "show", "mc1231a"], env=ENVIRONMENT, stdout=-1, stderr=-1, bufsize=0
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        error = process.stderr.read()
    assert error == b""
    assert process.returncode == 141


@FULL_DISK
def test_a_full_disk() -> None:
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [*COMMAND, "show", "qlink"], env=ENVIRONMENT, stdout=full, stderr=-1, text=True, check=False
        )
    assert done.returncode == 1
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr


def test_interrupted() -> None:
    command = [*COMMAND, "decode", "qlink", "-"]
    with subprocess.Popen(command, env=ENVIRONMENT, stdin=-1, stdout=-1, stderr=-1) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(b"a5a504210315e8\n")
        process.stdin.flush()
        assert (
            process.stdout.readline()
            == b'{"message": "motor_position.request", "node": 3, "fields": {}, "offset": 0}\n'
        )
        time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        error = process.communicate(timeout=60)[1]
        assert process.returncode == 130
    assert b"Traceback" not in error
    assert b"interrupted" in error


@pytest.mark.parametrize("command", ["show", "encode", "decode", "explain"])
def test_a_faulty_or_unreadable_schema(qlinkgen: Run, thermo: Path, command: str) -> None:
    rest = {"show": [], "encode": ["get_log"], "decode": ["00"], "explain": ["00"]}[command]
    thermo.write_text(thermo.read_text().replace("i16", "i17"))
    result = qlinkgen(command, thermo, *rest)
    assert result.code == 1
    assert f"{thermo}:" in result.err
    assert "error[" in result.err
    thermo.write_bytes(b"\xff\xfe\x00")
    assert qlinkgen(command, thermo, *rest).code == 2
    thermo.unlink()
    result = qlinkgen(command, thermo, *rest)
    assert result.code == 2
    assert "No such file" in result.err
