"""What a slave answers, and what it does not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.c.conftest import SHIPPED
from tests.c.test_compile import header, run
from tests.support.cdriver import WARNINGS

SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")

PROGRAMS = Path(__file__).parent / "programs"


@pytest.mark.parametrize("name", SHIPPED)
def test_dispatch(name: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    compiler = require_tool("gcc", package="gcc")
    header(name, tmp_path)
    program = PROGRAMS / f"dispatch_{name}.c"
    run(compiler, "-std=gnu99", "-g", *WARNINGS, *SANITIZED, "-I", tmp_path, program, "-o", tmp_path / "test")
    run(tmp_path / "test")
