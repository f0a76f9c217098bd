"""`make demo` shows three outputs that agree, and a bus, a ring and a chip set that move."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from tests.cli.test_boundary import ENVIRONMENT

REPOSITORY = Path(__file__).resolve().parents[2]


def demo(environment: dict[str, str], name: str = "demo.py", *rest: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(REPOSITORY / "examples" / name), *rest]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_all_three_agree(require_tool: Callable[..., str]) -> None:
    require_tool("gcc", package="gcc")
    done = demo(ENVIRONMENT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("\n  equal\n") == 3
    assert "00 12 d6 87 d6 e3" in done.stdout


def test_without_a_compiler() -> None:
    done = demo({**ENVIRONMENT, "PATH": "/nowhere", "CC": ""})
    assert done.returncode == 2
    assert "apt-get install gcc" in done.stderr


def test_the_bus(tmp_path: Path) -> None:
    capture = tmp_path / "demo.pcapng"
    done = demo(ENVIRONMENT, "bus.py", str(capture))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "position 720" in done.stdout
    assert "a5 a5 04 03 03 75 6c" in done.stdout, "the frame that starts node 3"
    assert "0 timeouts" in done.stdout
    command = [sys.executable, "-m", "qlinkgen", "stats", "qlink", str(capture), "--format", "json"]
    stats = json.loads(subprocess.run(command, env=ENVIRONMENT, capture_output=True, check=True).stdout)
    assert {row["name"] for row in stats["rows"]} >= {"node_info", "node_start", "motion"}
    assert sum(row["responses"] for row in stats["rows"]) > 10
    assert stats["faults"] == {}


def test_the_ring() -> None:
    done = demo(ENVIRONMENT, "ring.py")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "the keypad shows 'SPEED:   150', its key '5' was received" in done.stdout
    assert "8a 00 00 2a 00 00 00 00 00 00 00 00 00 35 29 88" in done.stdout, "the message around the ring"


def test_the_chip_set() -> None:
    done = demo(ENVIRONMENT, "chip.py")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "position 3000" in done.stdout
    assert "11 00 02 c0 00" in done.stdout, "the packet of 2.75 counts a sample"


def test_make_runs_all_of_them() -> None:
    text = (REPOSITORY / "Makefile").read_text("utf-8")
    for name in ("demo.py", "bus.py", "ring.py", "chip.py"):
        assert f"examples/{name}" in text
    assert "stats qlink build/demo.pcapng --format html -o build/demo.html" in text
