"""`qlinkgen scan`: finds the nodes of a bus."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from qlinkgen.protocols.qlink import VirtualNode
from tests.cli.conftest import OnLine, Run
from tests.cli.full_disk import FULL_DISK
from tests.cli.wire import CALM, call, line, objects, on_terminal, simulated


def test_table() -> None:
    with simulated("qlink", "--nodes", "1,3,16") as (path, _):
        done = call("scan", "qlink", path, "--nodes", "1,3,16", *CALM)
    assert (done.returncode, done.stderr) == (0, "")
    head, rule, *rows = done.stdout.splitlines()
    assert head.split("  ")[0] == "node"
    assert "answer time" in head
    assert set(rule) == {"-", " "}
    found = [re.fullmatch(r" *(\d+) +1\.0 +0 +(\d+) +\d+\.\d\d ms", row) for row in rows if row]
    assert [row and row.groups() for row in found] == [("1", "1001"), ("3", "1003"), ("16", "1016")]


def test_json_and_a_node_without_node_info(qlinkgen: Run, on_line: OnLine) -> None:
    mute = VirtualNode(5, unsupported=["node_info"])
    known = VirtualNode(2, version=(2, 7), product_id=99, serial_number=12345, t1_delay=0.3, position_type=77)
    port = on_line(line(mute, known))
    found = objects(qlinkgen("scan", "qlink", port, "--nodes", "2,4-5", "--json").out)
    seconds = [each.pop("seconds") for each in found]
    assert seconds == [0, 0]
    assert found[0] == {
        "node": 2,
        "version": "2.7",
        "product_id": 99,
        "serial_number": 12345,
        "t1_delay": 0.3,
        "t2_delay": 1.0,
        "position_type": 77,
        "garbled": False,
    }
    assert found[1] == {**dict.fromkeys(found[0]), "node": 5, "garbled": False}
    assert "does not support node_info" in qlinkgen("scan", "qlink", port, "--nodes", "5").out


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
        (("x", "--set", "crc=nope"), 2, "unknown 16-bit CRC 'nope'"),
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
