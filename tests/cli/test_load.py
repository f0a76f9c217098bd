"""`qlinkgen load`: a program arrives complete and once, or the error states how much was acknowledged."""

from __future__ import annotations

import re
import signal
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from qlinkgen.cli.codec import load_codec
from qlinkgen.codecs import qlink
from qlinkgen.link.slave import SlaveEngine
from qlinkgen.protocols.hexfile import read_hex
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.schema import load
from qlinkgen.sim import FaultPlan, Wire
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
        ((), 2, "the program is for one node of qlink; add --node N, 1..16"),
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


#: A link whose device takes an image in pieces of two bytes.
FLASH = """
qlinkgen: 1
protocol: {name: flasher, revision: "1", source: None}
frame:
  parts:
    start: {value: 02}
    length: {type: u8, counts: [command, data]}
    command: {role: message, type: u8}
    data: {role: payload, size: 0..8}
    check: {type: u8, algorithm: sum8, over: [length, command, data]}
bus: {kind: master_slave, baud: 9600}
commands:
  write_flash:
    id: 1
    request: {number: u8, image: "bytes[0..2]"}
    response: {number: {type: u8, echo: true}}
    repeat: {counter: number}
"""

#: A second command that could carry pieces, before the first one.
OTHER = """
  other: {id: 2, request: {number: u8, part: "bytes[0..2]"}, response: {}, repeat: {counter: number}}
  write_flash:
"""


class Flash:
    """Keeps the requests, each once although it may be repeated."""

    number = 0

    def __init__(self, codec: ModuleType) -> None:
        self.codec = codec
        self.stored: list[tuple[int, bytes]] = []

    def handle(self, request: Any, now: float) -> Any:
        piece = (request.number, bytes(request.image))
        if [piece] != self.stored[-1:]:
            self.stored.append(piece)
        return self.codec.WriteFlashResponse(number=request.number)


def test_an_image_into_a_device_of_any_schema(qlinkgen: Run, on_line: OnLine, tmp_path: Path) -> None:
    schema, image = tmp_path / "flasher.yaml", tmp_path / "image.bin"
    schema.write_text(FLASH)
    image.write_bytes(bytes(range(256)) * 2 + b"\x07")
    codec = load_codec(load(schema))
    device = Flash(codec)
    wire = Wire(baud=None, faults=FaultPlan(drop=0.05, seed=3))
    wire.attach(SlaveEngine(codec, device), "device")
    result = qlinkgen(
        "load", str(schema), on_line(wire), image, "--raw", "--patience", "60", "--slack", "0.05"
    )
    assert result.code == 0
    assert re.fullmatch(r"device: 513 bytes in 257 pieces, [1-9]\d* repeats?, \d+\.\d\d s\n", result.out)
    assert [number for number, _ in device.stored] == [*range(256), 0], "no empty request: none may be empty"
    assert b"".join(data for _, data in device.stored) == image.read_bytes()


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (
            "repeat: {counter: number}",
            "repeat: safe",
            "a repeated piece twice; write repeat: {counter: FIELD}",
        ),
        (
            'image: "bytes[0..2]"',
            "image: u8",
            "no command whose request carries a piece of a program; give one",
        ),
        ('"bytes[0..2]"', '"bytes[2..2]"', "image has at least 2 bytes, and the last piece"),
        ("number: u8,", "number: {type: u8, range: 1..9},", "number does not count 0, 1, 2..; write a type"),
        ("number: u8,", "number: u8, zone: {type: u8, range: 1..9},", "zone has no default"),
        (
            "  write_flash:\n",
            OTHER,
            "several commands that take a program in pieces; choose of other, write_flash",
        ),
    ],
)
def test_what_a_schema_lacks_is_named(qlinkgen: Run, tmp_path: Path, old: str, new: str, text: str) -> None:
    assert old in FLASH
    schema = tmp_path / "flasher.yaml"
    schema.write_text(FLASH.replace(old, new, 1))
    result = qlinkgen("load", str(schema), "/dev/not-there", tmp_path / "image.bin", "--raw")
    assert (result.code, result.out) == (2, "")
    assert text in result.err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (
            ("trio", "x"),
            "trio is of bus kind ring, and pieces of a program are acknowledged by the node of a",
        ),
        (("mc1231a", "x"), "mc1231a is of bus kind host"),
        (("qlink", "x"), "the program is for one node of qlink; add --node N, 1..16"),
        (
            ("qlink", "x", "--command", "motion"),
            "motion.request has no field of bytes, and a piece of a program",
        ),
        (("qlink", "x", "--command", "write"), "write does not say which field numbers its requests"),
        (("qlink", "x", "--command", "node_program_laod"), "did you mean node_program_load?"),
        (("modbus_rtu", "x"), "; give one a field of bytes"),
    ],
)
def test_what_cannot_be_loaded(qlinkgen: Run, words: tuple[str, ...], text: str) -> None:
    name, *rest = words
    result = qlinkgen("load", name, "/dev/not-there", *rest)
    assert (result.code, result.out) == (2, "")
    assert text in result.err
