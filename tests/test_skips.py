"""If skips are forbidden, a skipped test fails, except for a missing tool that its test marks as optional."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CONFTEST = Path(__file__).with_name("conftest.py")
TESTS = """
import pytest

@pytest.mark.optional_tool("no-such-checker")
def test_marked(optional_tool):
    optional_tool("no-such-checker", how="build it")

@pytest.mark.optional_tool("no-such-checker")
def test_marked_for_another(optional_tool):
    optional_tool("no-such-prover", how="build it")

@pytest.mark.optional_tool("no-such-checker")
def test_marked_and_skipped_for_no_tool():
    pytest.skip("not today")

def test_not_marked(optional_tool):
    optional_tool("no-such-checker", how="build it")

def test_required(require_tool):
    require_tool("no-such-compiler", package="no-such-package")
"""


@pytest.mark.parametrize(("strict", "outcome"), [("1", "4 failed, 1 skipped"), ("0", "5 skipped")])
def test_what_may_be_skipped(strict: str, outcome: str, tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST.read_text("utf-8"))
    (tmp_path / "test_tools.py").write_text(TESTS)
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "no:cacheprovider",
        "--rootdir",
        str(tmp_path),
        str(tmp_path),
    ]
    environment = {**os.environ, "PYTHONPATH": str(CONFTEST.parents[1]), "QLINKGEN_NO_SKIPS": strict}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert outcome in done.stdout, done.stdout
    assert "without no-such-checker, which is optional: build it" in done.stdout
