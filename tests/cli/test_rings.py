"""`qlinkgen simulate` and `send` with a ring of a schema of one's own."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest

from tests.bus.test_rings import CELL
from tests.cli.conftest import Run
from tests.cli.wire import call, end, read_until, simulated


@pytest.fixture
def schema(tmp_path: Path) -> Path:
    """The schema of a ring."""
    path = tmp_path / "cell.yaml"
    path.write_text(CELL)
    return path


@pytest.mark.pty
def test_nodes_forward_and_print_what_they_take(schema: Path) -> None:
    with simulated(schema, "--ring", "passive,passive") as (path, process):
        sent = call("send", str(schema), path, "move", "place=300", "--address", "2", "--seconds", "0.05")
        assert (sent.returncode, sent.stdout) == (0, "")
        told = json.loads(read_until(process.stdout, "\n"))
        assert told.pop("at") > 0
        assert told == {"node": 2, "message": "move", "address": 1, "fields": {"place": 300, "speed": 5}}
        code, _, err = end(process, signal.SIGTERM)
    assert code == 0
    assert "qlinkgen: 2 nodes of " in err
    assert "qlinkgen: address 1: 0 taken, 1 forwarded, 0 damaged\n" in err
    assert err.endswith("qlinkgen: address 2: 1 taken, 0 forwarded, 0 damaged\n")


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (("--ring", "passive,keypad"), "unknown kind of node 'keypad'; nodes of"),
        (("--ring", ",".join(7 * ["passive"])), "8 places, including the outside's; a ring has at most 7"),
        (("--closed",), "--closed is for trio; nodes of cell are passive: omit it"),
        (("--seconds", "3"), "--seconds is for trio"),
        (("--nodes", "3"), "--nodes requires a bus with a master; cell is a ring: omit it"),
        (("--faults", "drop=1,to=master"), "a ring has neither master nor slaves"),
    ],
)
def test_what_nodes_of_a_schema_are_not(
    qlinkgen: Run, schema: Path, words: tuple[str, ...], error: str
) -> None:
    result = qlinkgen("simulate", schema, *words)
    assert (result.code, result.out) == (2, "")
    assert error in result.err
