"""`qlinkgen lint`: the lines that editors jump to, JSON, and the exit code."""

from __future__ import annotations

import contextlib
import json
import os
import re
import socket
from pathlib import Path

import pytest

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
        assert result.err == "qlinkgen: error: unknown schema 'qlnk'; did you mean 'qlink'?\n"


def test_a_folder(qlinkgen: Run, thermo: Path, tmp_path: Path) -> None:
    """Checks and lists every schema below a folder, and no other file."""
    deep = tmp_path / "b" / "c"
    deep.mkdir(parents=True)
    (tmp_path / ".git").mkdir()
    text = thermo.read_text()
    for file in (deep / "one.yml", tmp_path / "b" / "two.yaml", tmp_path / ".git" / "hidden.yaml"):
        file.write_text(text)
    (deep / "flow.yaml").write_text('{"qlinkgen": 1}')
    (deep / "vectors.yaml").write_text("protocol: thermo\nvectors: []\n")
    (deep / "readme.txt").write_text("qlinkgen: 1\n")
    (deep / "around.yaml").symlink_to(tmp_path)  # a folder, and one that leads round
    result = qlinkgen("lint", tmp_path)
    assert result.code == 1
    assert result.err.splitlines() == [
        f"{tmp_path}: thermo.yaml, b/two.yaml, b/c/flow.yaml, b/c/one.yml",
        f"{tmp_path}: not checked, without a key 'qlinkgen': b/c/vectors.yaml",
        result.err.splitlines()[-1],
    ]
    assert result.err.splitlines()[-1].startswith("4 schemas, ")
    assert {line.split(":")[0] for line in result.lines} == {
        str(tmp_path / name) for name in ("thermo.yaml", "b/two.yaml", "b/c/flow.yaml", "b/c/one.yml")
    }
    (deep / "flow.yaml").unlink()
    assert qlinkgen("lint", f"{tmp_path}/", "qlink").code == 0
    assert json.loads(qlinkgen("lint", tmp_path, "--format", "json").out)[0]["file"].startswith(str(tmp_path))


@pytest.mark.parametrize("content", [None, "vectors: []\n"])
def test_a_folder_without_schemas(qlinkgen: Run, tmp_path: Path, content: str | None) -> None:
    if content is not None:
        (tmp_path / "vectors.yaml").write_text(content)
    result = qlinkgen("lint", tmp_path)
    assert result.code == 2
    assert f"no schema in {tmp_path}: none of its .yaml and .yml files has a key 'qlinkgen'" in result.err


@pytest.mark.parametrize("kind", ["pipe", "socket", "device", "endless device", "folder"])
@pytest.mark.parametrize("command", ["lint", "show", "encode", "decode", "explain", "generate", "send"])
def test_what_is_not_a_regular_file(qlinkgen: Run, tmp_path: Path, command: str, kind: str) -> None:
    """It is refused immediately: opening a pipe without a writer would block."""
    path = tmp_path / "bus.yaml"
    with contextlib.ExitStack() as opened:
        if kind == "pipe":
            os.mkfifo(path)
        elif kind == "socket":
            opened.enter_context(socket.socket(socket.AF_UNIX)).bind(str(path))
        elif kind == "folder":
            path.mkdir()
        else:
            path.symlink_to("/dev/null" if kind == "device" else "/dev/zero")
        rest = {"encode": ["x"], "decode": ["00"], "explain": ["00"], "send": ["/dev/null", "x"]}
        result = qlinkgen(command, path, *rest.get(command, []))
    assert result.code == 2
    said = result.out + result.err
    if command == "lint" and kind == "folder":
        assert f"no schema in {path}" in said
    elif kind == "socket":
        assert f"{path}:1:1: error[file-unreadable]: cannot read it: No such device or address" in said
    else:
        seen = "a device" if "device" in kind else f"a {kind}"
        assert (
            f"{path}:1:1: error[file-unreadable]: cannot read it: it is {seen}, not a file; check the" in said
        )


#: Places of names in the schema of the fixture.
NAMES = ["thermo", "mode", "heat", "start", "number", "set_target", "target", "samples", "heating"]


@pytest.mark.parametrize("name", NAMES)
def test_long_names(qlinkgen: Run, thermo: Path, name: str) -> None:
    text = thermo.read_text()
    for length, fine in ((40, True), (41, False), (250, False), (1000, False)):
        new = "a" * length
        thermo.write_text(re.sub(rf"\b{name}\b(?!\.yaml)", new, text))
        result = qlinkgen("lint", thermo)
        assert result.code == (0 if fine else 1), (length, result.out)
        if not fine:
            errors = [line for line in result.lines if "error[" in line]
            assert errors
            for line in errors:
                assert "error[bad-name]: 'aaaa" in line
                assert f"has {length} characters; use at most 40: only 63 characters" in line


PACKET = """\
qlinkgen: 1
protocol: {name: sample, revision: "1", source: Made up}
frame:
  packet:
    id: {role: message, type: u8}
    data: {role: payload, size: 0..16}
    CHECK
bus: {kind: host, response_within: 3 bytes}
defaults: {repeat: safe}
commands:
  go: {id: 1, request: {FIELDS}, response: none}
"""


@pytest.mark.parametrize("size", range(6))
def test_packets_are_whole_words_only_where_words_are_summed(
    qlinkgen: Run, tmp_path: Path, size: int
) -> None:
    file = tmp_path / "sample.yaml"
    fields = ", ".join(f"f{at}: u8" for at in range(size))
    for check, words in (("", 1), ("sum: {role: checksum, type: u16, algorithm: sum16, words: 2}", 2)):
        file.write_text(PACKET.replace("FIELDS", fields).replace("CHECK", check))
        result = qlinkgen("lint", file)
        assert result.code == (1 if size % words else 0), result.out
        assert ("not a multiple of the 2-byte words" in result.out) is bool(size % words)
        if not result.code:
            values = [f"f{at}={at + 1}" for at in range(size)]
            wire = qlinkgen("encode", file, "go", *values).out.strip()
            assert json.loads(qlinkgen("decode", file, "--direction", "request", wire).out)["fields"] == {
                f"f{at}": at + 1 for at in range(size)
            }
