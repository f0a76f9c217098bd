"""Modules with every kind of field pass ruff with its own settings."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from qlinkgen.backends import construct, python
from qlinkgen.backends.base import Options
from tests.scalars import test_bcd, test_floats, test_lists, test_pads, test_rows, test_wide
from tests.scalars.protocols import protocol_of

REQUESTS = {
    "bcd": test_bcd.REQUEST, "floats": test_floats.REQUEST, "lists": test_lists.REQUEST,
    "pads": test_pads.REQUEST, "rows": test_rows.REQUEST, "wide": test_wide.REQUEST,
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("linted")
    for name, request in REQUESTS.items():
        protocol = protocol_of(request, types=test_lists.TYPES if name == "lists" else "")
        for backend in (python, construct):
            for path, text in backend.generate(protocol, Options()).items():
                file = place / name / path
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text)
    return place


@pytest.mark.parametrize("arguments", [("check",), ("format", "--check", "--diff")])
def test_ruff_has_nothing_to_say(folder: Path, arguments: tuple[str, ...]) -> None:
    command = [sys.executable, "-m", "ruff", *arguments, "--isolated", "--no-cache", "--quiet", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout + done.stderr == ""
