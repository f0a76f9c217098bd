"""Responses of a slave, and requests that it does not answer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.model.naming import snake
from tests.c.conftest import PROTOCOLS, SHIPPED, protocol_of
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


def test_transactions_have_all_constants(tmp_path: Path) -> None:
    """Each command has the constants that apply to it, and no others."""
    for name in PROTOCOLS:
        text, protocol = header(name, tmp_path), protocol_of(name)
        assert ("_ADDRESSING_EITHER 2 " in text) == bool(protocol.address_name and protocol.commands)
        for command in protocol.commands:
            constant = f"#define {name.upper()}_{snake(command.name).upper()}"
            assert (f"{constant}_RESPONSE_BITS " in text) == (command.response is not None)
            assert (f"{constant}_RESPONSE_US " in text) == (command.response is not None)
            if protocol.address_name:
                kind = f"{name.upper()}_ADDRESSING_{command.addressing.upper()}"
                assert f"{constant}_ADDRESSING {kind}\n" in text
            if command.repeat.counter:
                how = f"{name.upper()}_REPEAT_BY_COUNTER /* field {command.repeat.counter} */"
            else:
                how = f"{name.upper()}_REPEAT_{'SAFE' if command.repeat.safe else 'UNSAFE'}"
            assert f"{constant}_REPEAT {how}\n" in text
