"""Closed standard streams, encodings without the characters of a schema, and internal errors."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import pytest

from qlinkgen.cli import COMMANDS, boundary, cli
from tests.cli.conftest import THERMO, Run
from tests.cli.test_boundary import COMMAND, ENVIRONMENT

#: One terminating run of each command, and its exit code.
RUNS: dict[str, tuple[list[str], int]] = {
    "generate": (["--target", "vectors", "-o", "OUT", "thermo.yaml"], 0),
    "lint": (["qlink"], 0),
    "list": ([], 0),
    "init": (["pump"], 0),
    "import": (["header", "thermo.yaml"], 1),
    "show": (["qlink"], 0),
    "encode": (["qlink", "motor_position", "--node", "3"], 0),
    "decode": (["qlink", "a5a504210315e8"], 0),
    "explain": (["qlink", "a5a504210315e8"], 0),
    "stats": (["qlink", "thermo.yaml"], 1),
    "export": (["qlink", "thermo.yaml", "-o", "OUT"], 1),
    "coverage": (["qlink", "thermo.yaml"], 1),
    "crc": (["list"], 0),
    "budget": (["qlink", "1:motion=1"], 0),
    "simulate": (["trio", "--nodes", "1"], 2),
    "scan": (["qlink", "/dev/null"], 1),
    "send": (["qlink", "/dev/null", "motor_position", "--node", "3"], 1),
    "shell": (["qlink", "/dev/null"], 1),
    "fuzz": (["qlink", "/dev/null", "--node", "3"], 1),
    "load": (["qlink", "/dev/null", "thermo.yaml", "--node", "3"], 1),
    "monitor": (["qlink", "/dev/null"], 1),
    "ring": (["trio", "/dev/null", "--baud", "38400"], 1),
    "doctor": (["qlink", "/dev/null"], 1),
}
every_command = pytest.mark.parametrize("command", RUNS)


def test_every_command_is_here() -> None:
    assert list(RUNS) == list(COMMANDS)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "thermo.yaml").write_text(THERMO)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_here(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["qlinkgen", *arguments])
    return boundary.run(cli)


@every_command
@pytest.mark.parametrize("closed", ["stdin", "stdout", "stderr", "all"])
def test_closed_streams(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str, closed: str
) -> None:
    arguments, code = RUNS[command]
    for name in ("stdin", "stdout", "stderr"):
        monkeypatch.setattr(sys, name, None if closed in {name, "all"} else getattr(sys, name))
    assert run_here(monkeypatch, command, *arguments) == code
    monkeypatch.undo()
    assert "fault of qlinkgen" not in capsys.readouterr().err


def test_reading_from_a_closed_stdin(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    assert run_here(monkeypatch, "decode", "qlink") == 1
    assert "no input" in capsys.readouterr().err


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_descriptors_of_closed_streams_are_not_used(closed: str) -> None:
    code = (
        "import os, sys\n"
        "from qlinkgen.cli import standard_streams\n"
        "standard_streams.prepare()\n"
        "print('lost'); print('lost', file=sys.stderr)\n"
        "sys.exit(os.open(os.devnull, os.O_RDONLY))"
    )
    done = subprocess.run(
        ["/bin/sh", "-c", f'exec "$0" -c "$1" {closed}', sys.executable, code], env=ENVIRONMENT, check=False
    )
    assert done.returncode == 3


ODD = THERMO.replace("Thermostat bus", "\\u2264 \\u03a9 \\U0001f321 \\u0416 caf\\u00e9").replace(
    "degC", "\\u00b5\\u03a9"
)


@pytest.mark.parametrize("encoding", ["cp1252", "ascii", "latin-1", "cp437", "utf-8", "utf-16"])
@pytest.mark.parametrize(
    "arguments", [["show", "odd.yaml"], ["show", "odd.yaml", "set_target"], ["lint", "odd.yaml"]]
)
def test_an_encoding_that_lacks_characters(
    monkeypatch: pytest.MonkeyPatch, folder: Path, encoding: str, arguments: list[str]
) -> None:
    text = (
        ODD.encode("ascii")
        .decode("unicode_escape")
        .replace("i16[0", "i17[0" if arguments[0] == "lint" else "i16[0")
    )
    (folder / "odd.yaml").write_text(text, encoding="utf-8")
    streams = [io.TextIOWrapper(io.BytesIO(), encoding=encoding, write_through=True) for _ in range(2)]
    monkeypatch.setattr(sys, "stdout", streams[0])
    monkeypatch.setattr(sys, "stderr", streams[1])
    code = run_here(monkeypatch, *arguments)
    if encoding == "ascii":
        encoding = "utf-8"  # click treats ASCII as an unset locale
    out, err = (stream.buffer.getvalue().decode(encoding) for stream in streams)
    monkeypatch.undo()
    assert (code, err) == (0, "") or arguments[0] == "lint"
    if arguments == ["show", "odd.yaml"]:
        shown = "\\u2264" if encoding != "cp437" and not encoding.startswith("utf") else "\u2264"
        assert shown in out


@pytest.mark.parametrize("name", ["qlink", "trio", "mc1231a"])
def test_every_shipped_schema_in_ascii(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    assert run_here(monkeypatch, "show", name) == 0


def fail_with(error: BaseException) -> Callable[..., Any]:
    def fail(*_: object, **__: object) -> None:
        raise error

    return fail


FAULTS: list[Exception] = [
    KeyError("x"),
    AttributeError("two\nlines\x1b[31m"),
    AssertionError(),
    RecursionError("deep"),
    MemoryError(),
    UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid"),
    NotImplementedError("later"),
    StopIteration(),
]


@every_command
@pytest.mark.parametrize("debug", ["", "before", "behind"])
def test_a_fault_of_our_own_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str, debug: str
) -> None:
    group = cli.get_command(click.Context(cli), command)
    if isinstance(group, click.Group):
        group = group.commands[RUNS[command][0][0]]
    assert isinstance(group, click.Command)
    arguments = [command, *RUNS[command][0]]
    arguments = ["--debug", *arguments] if debug == "before" else arguments
    arguments = [*arguments, "--debug"] if debug == "behind" else arguments
    for error in FAULTS[:2] if debug else FAULTS:
        monkeypatch.setattr(group, "callback", fail_with(error))
        assert run_here(monkeypatch, *arguments) == boundary.FAULT == 70
        captured = capsys.readouterr()
        assert captured.out == ""
        *trace, line = captured.err.splitlines()
        assert line.startswith(f"qlinkgen: error: internal error ({type(error).__name__}")
        assert "please report it with" in line
        assert line.isprintable()
        assert bool(trace) is bool(debug)
        assert not debug or trace[0].startswith("Traceback")


@pytest.mark.parametrize("arguments", [["show", "--debug", "nonsense"], ["--debug", "decode", "qlink", "zz"]])
def test_debug_changes_nothing_else(qlinkgen: Run, arguments: list[str]) -> None:
    result = qlinkgen(*arguments)
    assert result.code == 2
    assert result.err.count("\n") == 1


def test_nothing_follows_the_line_of_a_fault() -> None:
    """Not even from the flush at exit."""
    code = (
        "import sys; from qlinkgen.cli import boundary, cli, show\n"
        "def fail(**_):\n"
        "    print('half a line', end='')\n"
        "    raise KeyError('x')\n"
        "show.command.callback = fail\n"
        "sys.argv = ['qlinkgen', 'show', 'qlink']\n"
        "sys.exit(boundary.run(cli))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=ENVIRONMENT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 70
    assert done.stderr.count("\n") == 1


def test_a_closed_stdout_from_outside() -> None:
    line = 'exec "$@" >&-'
    done = subprocess.run(
        ["/bin/sh", "-c", line, "sh", *COMMAND, "show", "qlink"],
        env={**os.environ, **ENVIRONMENT},
        stderr=-1,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
