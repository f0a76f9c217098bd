"""`qlinkgen scan`: finds the nodes of a bus."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.backends.python import load
from qlinkgen.link import SlaveEngine
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.schema import load as load_schema
from qlinkgen.sim import Wire
from qlinkgen.sim.generic import GenericNode
from tests.cli.conftest import OnLine, Run
from tests.cli.full_disk import FULL_DISK
from tests.cli.wire import CALM, REPOSITORY, call, line, objects, on_terminal, simulated


def test_table() -> None:
    with simulated("qlink", "--nodes", "1,3,16") as (path, _):
        done = call("scan", "qlink", path, "--nodes", "1,3,16", *CALM)
    assert (done.returncode, done.stderr) == (0, "")
    head, rule, *rows = done.stdout.splitlines()
    assert head.split("  ")[0] == "node"
    assert "answer time" in head
    assert set(rule) == {"-", " "}
    pattern = r" *(\d+) +1 +0 +0 +1\.0 +1\.0 +jvl_mactalk +(\d+) +\d+\.\d\d ms"
    found = [re.fullmatch(pattern, row) for row in rows if row]
    assert [row and row.groups() for row in found] == [("1", "1001"), ("3", "1003"), ("16", "1016")]


def test_json_and_a_node_without_node_info(qlinkgen: Run, on_line: OnLine) -> None:
    mute = VirtualNode(5, unsupported=["node_info"])
    known = VirtualNode(2, version=(2, 7), product_id=99, serial_number=12345, t1_delay=0.3, position_type=77)
    port = on_line(line(mute, known))
    found = objects(qlinkgen("scan", "qlink", port, "--nodes", "2,4-5", "--json").out)
    seconds = [each.pop("seconds") for each in found]
    assert seconds == [0, 0]
    assert found[0] == {
        "message": "node_info.response",
        "node": 2,
        "fields": {
            "version_major": 2,
            "version_minor": 7,
            "product_id": 99,
            "serial_number": 12345,
            "t1_delay": 0.3,
            "t2_delay": 1.0,
            "position_type": 77,
        },
    }
    assert found[1] == {"message": "loop_back.response", "node": 5, "fields": {"offset": 0, "data": "5ac3"}}


def test_two_nodes_with_one_number_are_garbled(qlinkgen: Run, on_line: OnLine) -> None:
    nodes = VirtualNode(3), VirtualNode(5, serial_number=1), VirtualNode(5, serial_number=2)
    port = on_line(line(*nodes, baud=115200))
    both = qlinkgen("scan", "qlink", port, "--nodes", "3-6")
    assert both.code == 0
    rows = {row.split()[0]: row for row in both.out.splitlines() if row}
    assert "garbled: two nodes with this number, or a wrong --baud" in rows["5"]
    assert {"4", "6"}.isdisjoint(rows)
    (only,) = objects(qlinkgen("scan", "qlink", port, "--nodes", "5", "--json").out)
    assert only["garbled"] is True
    assert qlinkgen("scan", "qlink", port, "--nodes", "5").code == 1
    asked = qlinkgen("send", "qlink", port, "node_info", "--node", "5")
    assert "bytes were received that form no frame; two nodes may have answered at once" in asked.err


MODBUS = REPOSITORY / "tests" / "schemas" / "modbus_rtu.yaml"


class Shy(GenericNode):
    """A node that refuses every request."""

    def handle(self, request: Any, now: float) -> Any:
        reply = next(iter(self.codec.COMMANDS[request.NAME.removesuffix(".request")].replies))
        return reply(address=self.number, code=2)

    def __init__(self, codec: Any, number: int) -> None:
        super().__init__(codec, number)
        self.codec = codec


def test_any_schema(qlinkgen: Run, on_line: OnLine) -> None:
    codec = load(load_schema(MODBUS))
    wire = Wire(baud=19200)
    for node in (GenericNode(codec, 7), Shy(codec, 9)):
        wire.attach(SlaveEngine(codec, node, turnaround=0.01, baud=19200))
    port = on_line(wire)
    asked = ("scan", MODBUS, port, "read_input_registers", "start=1", "--nodes", "6-9")
    found = objects(qlinkgen(*asked, "--json").out)
    assert [each.pop("seconds", 0) > 0 for each in found] == [True, True]  # type: ignore[operator]
    assert found == [
        {"message": "read_input_registers.response", "address": 7, "fields": {"registers": [0]}},
        {
            "message": "read_input_registers.exception",
            "address": 9,
            "fields": {"code": "illegal_data_address"},
            "refused": True,
        },
    ]
    text = qlinkgen(*asked, "--trace")
    assert "refused by read_input_registers.exception" in text.out
    assert re.search(r"sent      07 04 .* \[read_input_registers.request address 7 start=1", text.err)
    assert re.search(r"received  07 04 .* \[read_input_registers.response address 7 registers=0\]", text.err)


@pytest.mark.parametrize(
    ("protocol", "words", "text"),
    [
        ("trio", (), "there is nothing to scan"),
        ("vesc", (), "there is nothing to scan"),
        ("dynamixel_1", ("--nodes", "1"), "has no request without values"),
        ("qlink", ("node_start",), "node_start is not answered, so it finds no node"),
        ("qlink", ("motion.response",), "is a response; send its request"),
    ],
)
def test_nothing_to_ask(qlinkgen: Run, protocol: str, words: tuple[str, ...], text: str) -> None:
    result = qlinkgen("scan", protocol, "x", *words)
    assert (result.code, result.out) == (2, "")
    assert text in result.err


def test_the_question_of_a_library_protocol(qlinkgen: Run) -> None:
    """It reads something, sets nothing, and may be repeated."""
    result = qlinkgen("scan", "tmcl", "/dev/not-there", "--nodes", "1", "--baud", "9600")
    assert "qlinkgen: asking with " in result.err


def test_nobody(qlinkgen: Run, on_line: OnLine) -> None:
    port = on_line(line(VirtualNode(3)))
    result = qlinkgen("scan", "qlink", port, "--nodes", "1-2")
    assert (result.code, result.out) == (1, "")
    assert f"no node answers on {port}; check power, wiring and --baud" in result.err


def test_progress_on_a_terminal() -> None:
    with simulated("qlink", "--nodes", "1-2") as (path, _):
        code, out, shown = on_terminal("scan", "qlink", path, "--nodes", "1-2", *CALM)
    assert code == 0
    assert "looking for nodes" in shown
    assert "looking" not in out


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (("/dev/not-there",), 1, "port '/dev/not-there' does not exist"),
        (("",), 2, "give a device such as /dev/ttyUSB0, or a URL"),
        (("/dev/null",), 1, "is not a serial port"),
        (("nonsense://x",), 1, "nonsense://x"),
        (("x", "--nodes", "0-3"), 2, "nodes are 1..16"),
        (("x", "--slack", "-1"), 2, "--slack -1: not a number of seconds"),
        (("x", "--slack", "nan"), 2, "--slack nan: not a number of seconds"),
        (("x", "--set", "crc=nope"), 2, "unknown checksum algorithm 'nope'"),
    ],
)
def test_errors(qlinkgen: Run, arguments: tuple[str, ...], code: int, text: str) -> None:
    result = qlinkgen("scan", "qlink", *arguments)
    assert (result.code, result.out) == (code, "")
    assert text in result.err


@FULL_DISK
def test_a_full_disk_leaves_a_usable_bus() -> None:
    with simulated("qlink") as (path, _):
        with Path("/dev/full").open("wb") as full:
            done = call("scan", "qlink", path, "--nodes", "1", *CALM, stdout=full)
        assert done.returncode == 1
        assert "No space left on device" in done.stderr
        assert "Traceback" not in done.stderr
        assert call("scan", "qlink", path, "--nodes", "1", *CALM).returncode == 0
