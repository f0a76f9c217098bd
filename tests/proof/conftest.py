"""Compiled outputs."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.proof import cases
from tests.proof.outputs import COMPILED, OUTPUTS, COutput, Output
from tests.support.cdriver import Driver, build
from tests.support.needs import decided_by_parameter

Make = Callable[[str, str], Output]
#: Every output, as parameters.
EVERY = [*OUTPUTS, *(pytest.param(name, marks=pytest.mark.program) for name in COMPILED)]


@pytest.fixture(scope="session")
@decided_by_parameter
def make(shared: Path, require_tool: Callable[..., str]) -> Iterator[Make]:
    """Give a function that returns an output of a protocol, built once."""
    made: dict[tuple[str, str], Output] = {}
    programs = contextlib.ExitStack()

    def compiled(name: str, output: str) -> Output:
        compiler, flags = COMPILED[output]
        path = require_tool(compiler, package=compiler)
        program = build(cases.protocol(name), shared / "drivers", path, flags)
        return COutput(cases.protocol(name), programs.enter_context(Driver(program)))

    def get(name: str, output: str) -> Output:
        if (name, output) not in made:
            made[name, output] = OUTPUTS[output](name) if output in OUTPUTS else compiled(name, output)
        return made[name, output]

    with programs:
        yield get
