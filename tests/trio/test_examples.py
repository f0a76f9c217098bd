"""The document's two programs run to their expected end; so do the benchmarks."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import ring
from tests.cli.test_boundary import ENVIRONMENT

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("trio_two_keypads.py", "VR(2) = 0.3, speed 150, NETSTAT 0"),
        ("trio_two_coordinators.py", "the slave starts with feed length 2.5 and speed 0.03"),
    ],
)
def test_an_example_ends_as_it_should(name: str, shown: str) -> None:
    command = [sys.executable, str(REPOSITORY / "examples" / name)]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    assert shown in done.stdout


def test_the_benchmark_measures() -> None:
    section = ring.section(1)
    figures = {row[0]: row[1] for row in section.rows}
    assert figures["added latency for each hop, cut-through"] == "1.00"
    assert figures["added latency for each hop, store-and-forward"] == "16.0"
    assert section.goals[0].met
    assert len(section.rows) == 8
