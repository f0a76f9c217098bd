"""`qlinkgen load`: a program arrives complete and once, or the error states how much was acknowledged."""

from __future__ import annotations

import re
import signal
from pathlib import Path

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.protocols.qlink.hexfile import read_hex
from qlinkgen.sim import FaultPlan
from tests.cli.conftest import OnLine, Run
from tests.cli.wire import CALM, PATIENCE, bus, call, end, line, on_terminal, started, wait_for


def record(address: int, kind: int, data: bytes) -> str:
    body = bytes([len(data), *address.to_bytes(2, "big"), kind]) + data
    return f":{(body + bytes([-sum(body) & 0xFF])).hex().upper()}\n"


def size(program: Path) -> int:
    return len(read_hex(program).text)


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """A program of 1 KiB."""
    file = tmp_path / "program.hex"
    rows = [record(16 * row, 0, bytes([row % 256] * 16)) for row in range(64)]
    file.write_text("".join([*rows, record(0, 1, b"")]))
    return file


def test_a_program_arrives(program: Path) -> None:
    node = VirtualNode(3)
    with bus(node) as running:
        done = call("load", "qlink", running.path, "--node", "3", program, *CALM)
    text = read_hex(program).text
    assert done.returncode == 0
    pieces = -(-len(text) // 25)
    assert re.fullmatch(
        rf"node 3: {len(text)} bytes in {pieces} pieces, 0 repeats, \d+\.\d\d s\n", done.stdout
    )
    lines = done.stderr.splitlines()
    assert len(lines) == 10
    assert lines[-1] == f"node 3: {len(text)} of {len(text)} bytes"
    assert node.program is not None
    assert node.program.segments == read_hex(program).segments


def test_lost_answers_are_repeats(program: Path, qlinkgen: Run, on_line: OnLine) -> None:
    node = VirtualNode(3)
    port = on_line(line(node, faults=FaultPlan(drop=0.2, seed=4)))
    result = qlinkgen("load", "qlink", port, "--node", "3", program, "--patience", "60")
    assert result.code == 0
    found = re.search(r" (\d+) repeats?,", result.out)
    assert found
    assert int(found[1]) > 0
    assert node.program is not None
    assert node.program.segments == read_hex(program).segments


def test_a_silent_node(program: Path, qlinkgen: Run, on_line: OnLine) -> None:
    result = qlinkgen("load", "qlink", on_line(line(VirtualNode(3))), "--node", "4", program)
    assert (result.code, result.out) == (1, "")
    assert f"node 4: 0 of {size(program)} bytes were acknowledged" in result.err


class Stubborn(VirtualNode):
    """Accepts some pieces, then stops answering."""

    def node_program_load(
        self, request: qlink.NodeProgramLoadRequest, now: float
    ) -> qlink.NodeProgramLoadResponse | None:
        if request.counter >= 4:
            return None
        return super().node_program_load(request, now)


def test_ctrl_c_in_the_middle(program: Path) -> None:
    node = Stubborn(3)
    with bus(node) as running:
        command = (
            "load",
            "qlink",
            running.path,
            "--node",
            "3",
            program,
            "--slack",
            "0.2",
            "--patience",
            "1000",
        )
        with started(*command) as process:
            wait_for(lambda: node.statistics.requests > 6)
            code, out, err = end(process, signal.SIGINT)
        assert (code, out) == (130, "")
        assert f"interrupted: node 3 has acknowledged 100 of {size(program)} bytes and holds part" in err
        assert "load it again" in err
        assert "Traceback" not in err
        done = call("send", "qlink", running.path, "motor_position", "--node", "3", *CALM)
        assert done.returncode == 0


def test_a_port_that_is_lost_in_the_middle(program: Path) -> None:
    node = Stubborn(3)
    with bus(node) as running:
        command = (
            "load",
            "qlink",
            running.path,
            "--node",
            "3",
            program,
            "--slack",
            "0.2",
            "--patience",
            "1000",
        )
        with started(*command) as process:
            wait_for(lambda: node.statistics.requests > 6)
            running.close()
            out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out) == (1, b"")
    assert f"{running.path} was lost".encode() in err
    assert f"node 3 has acknowledged 100 of {size(program)} bytes and holds part".encode() in err


def test_a_bar_on_a_terminal(program: Path) -> None:
    with bus(VirtualNode(3)) as running:
        code, out, shown = on_terminal("load", "qlink", running.path, "--node", "3", program, *CALM)
    assert code == 0
    assert "node 3" in shown
    assert "\x1b[" in shown
    assert out.startswith(f"node 3: {size(program)} bytes in ")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        (":0100000001FD\n:00000001FF\n", "checksum FD, must be FE"),
        (":0100000001FE\n", "no end record; a program ends in :00000001FF"),
        ("no hex\n", "a record begins with ':'"),
    ],
)
def test_a_wrong_file_is_found_before_the_port_is_opened(
    qlinkgen: Run, tmp_path: Path, text: str, words: str
) -> None:
    file = tmp_path / "wrong.hex"
    file.write_text(text)
    result = qlinkgen("load", "qlink", "/dev/not-there", "--node", "3", file)
    assert (result.code, result.out) == (1, "")
    assert words in result.err
    assert str(file) in result.err
    assert "does not exist" not in result.err


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (("--node", "17"), 2, "--node 17: not a node; nodes are 1..16"),
        (("--node", "x"), 2, "--node x: not a node"),
        ((), 2, "Missing option '--node'"),
        (("--node", "3", "--patience", "-1"), 2, "--patience -1: not a number of seconds"),
        (("--node", "3"), 1, "port '/dev/not-there' does not exist"),
    ],
)
def test_errors(qlinkgen: Run, program: Path, arguments: tuple[str, ...], code: int, text: str) -> None:
    result = qlinkgen("load", "qlink", "/dev/not-there", program, *arguments)
    assert (result.code, result.out) == (code, "")
    assert text in result.err


def test_a_file_that_is_not_there(qlinkgen: Run, tmp_path: Path) -> None:
    result = qlinkgen("load", "qlink", "/dev/not-there", tmp_path / "nothing.hex", "--node", "3")
    assert result.code == 2
    assert "nothing.hex: No such file or directory" in result.err
