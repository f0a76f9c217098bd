"""Completion in a shell, and the order of arguments: PROTOCOL before PORT."""

from __future__ import annotations

import importlib
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from serial.tools import list_ports

from qlinkgen.cli.boundary import COMPLETE
from tests.cli.conftest import Run
from tests.cli.wire import COMMAND, ENVIRONMENT

#: Returns the completions of the last word of a command line.
Complete = Callable[..., list[str]]


@pytest.fixture
def complete(qlinkgen: Run, thermo: Path, monkeypatch: pytest.MonkeyPatch) -> Complete:
    """Ask as fish does, which does not split words at "="."""
    monkeypatch.chdir(thermo.parent)
    devices = [SimpleNamespace(device=f"/dev/ttyUSB{at}", description=f"adapter {at}") for at in range(2)]
    monkeypatch.setattr(list_ports, "comports", lambda: devices)

    def ask(*words: str, kind: str = "plain") -> list[str]:
        monkeypatch.setenv(COMPLETE, "fish_complete")
        monkeypatch.setenv("COMP_WORDS", " ".join(("qlinkgen", *words)))
        monkeypatch.setenv("COMP_CWORD", words[-1])
        result = qlinkgen()
        assert (result.code, result.err) == (0, "")
        items = [line.split(",", 1) for line in result.lines if line]
        return [value.partition("\t")[0] for found, value in items if found == kind]

    return ask


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["enc"], ["encode"]),
        (["import", "c"], ["csv"]),
        (["encode", "modbus_"], ["modbus_ascii", "modbus_rtu"]),
        (["decode", "ther"], ["thermo.yaml"]),
        (["show", "thermo.yaml", "set"], ["set_target", "set_target.request", "set_target.response"]),
        (["encode", "thermo.yaml", "set_target", ""], ["mode=", "target="]),
        (["encode", "thermo.yaml", "set_target", "mode=heat", ""], ["target="]),
        (["encode", "thermo.yaml", "set_target", "mode=h"], ["mode=heat"]),
        (["encode", "thermo.yaml", "set_target", "target=1"], []),
        (["encode", "thermo.yaml", "get_log.response", "heating="], ["heating=true", "heating=false"]),
        (["encode", "qlink", "motion.response", "motor_status=running|position_v"],
         ["motor_status=running|position_valid"]),
        (["send", "qlink", "/dev/ttyUSB1"], ["/dev/ttyUSB1"]),
        (["monitor", "qlink", "socket"], ["socket://"]),
        (["send", "qlink", "/dev/ttyUSB0", "node_sta"], ["node_start", "node_start.request"]),
        (["send", "qlink", "/dev/ttyUSB0", "motion", "seg"], ["segments="]),
        (["encode", "nonsense", "m"], []),
        (["encode", "qlink", "nonsense", "m"], []),
        (["budget", "qlink", "1-4:motor_pos"], ["1-4:motor_position="]),
        (["doctor", "qlink", "/dev/ttyUSB0", "--ba"], ["--baud"]),
    ],
)  # fmt: skip
def test_words(complete: Complete, words: list[str], expected: list[str]) -> None:
    assert complete(*words) == expected


def test_a_path_is_left_to_the_shell(complete: Complete) -> None:
    assert complete("encode", "../own/b", kind="file") == ["../own/b"]
    assert complete("monitor", "qlink", "/tmp/li", kind="file") == ["/tmp/li"]  # not opened


BASH = """\
source <(printf '%s' "$SCRIPT")
compopt() { :; }
complete_words() {
    COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=()
    _qlinkgen_completion qlinkgen
    echo "${COMPREPLY[@]}"
}
complete_words "$0" encode qlink motion co
complete_words "$0" encode qlink node_info.response position_type =
complete_words "$0" encode qlink node_info.response position_type = j
complete_words "$0" encode qlink node_info.response position_type = none ser
"""


def test_after_the_module_of_list_was_imported(complete: Complete) -> None:
    importlib.import_module("qlinkgen.cli.list")
    assert complete("li") == ["lint", "list"]


def test_bash_splits_words_at_the_equals_sign(tmp_path: Path) -> None:
    program = tmp_path / "qlinkgen"
    program.write_text(f'#!/bin/sh\nexec "{COMMAND[0]}" -m qlinkgen "$@"\n')
    program.chmod(0o755)
    asked = {**ENVIRONMENT, COMPLETE: "bash_source"}
    script = subprocess.run([program], env=asked, capture_output=True, text=True, check=True).stdout
    done = subprocess.run(
        ["bash", "-c", BASH, str(program)],
        env={**ENVIRONMENT, "SCRIPT": script, "PATH": f"{tmp_path}:{ENVIRONMENT['PATH']}"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    assert done.stdout.splitlines() == [
        "counter=",
        "none jvl_mactalk metronix",
        "jvl_mactalk",
        "serial_number=",
    ]


@pytest.mark.parametrize(
    "words",
    [
        ("send", "/dev/ttyUSB0", "qlink", "motion"),
        ("scan", "/dev/ttyUSB0"),
        ("monitor", "socket://127.0.0.1:1", "qlink"),
    ],
)
def test_a_port_in_place_of_the_protocol(qlinkgen: Run, words: tuple[str, ...]) -> None:
    result = qlinkgen(*words)
    assert (result.code, result.out) == (2, "")
    wanted = f"'{words[1]}' is a port, and PROTOCOL comes before PORT; write qlinkgen {words[0]} PROTOCOL"
    assert wanted in result.err


def test_a_misspelt_name_of_an_enum(qlinkgen: Run, thermo: Path) -> None:
    result = qlinkgen("encode", thermo, "set_target", "--node", "1", "mode=haet")
    assert "'haet' is unknown; did you mean heat? It is one of off, heat, cool, or a number" in result.err
