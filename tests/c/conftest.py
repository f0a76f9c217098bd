"""Protocols, headers and drivers, each built once per session."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import find, load
from tests.support.cdriver import WARNINGS, Driver, build

SHIPPED = ("qlink", "trio", "mc1231a")
OTHERS = ("kitchen_sink", "modbus_rtu", "dynamixel")
PROTOCOLS = SHIPPED + OTHERS
#: Warnings are errors, and a wrong access ends the program. Not optimised: the optimiser could remove errors
#: that a sanitizer should find, and takes four times as long.
SANITIZED = (
    *("-O0", "-g1", "-std=c99", *WARNINGS),
    *("-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
)


@functools.cache
def protocol_of(name: str) -> Protocol:
    """A shipped protocol, or one of those for tests."""
    path = Path(__file__).parents[1] / "schemas" / f"{name}.yaml"
    return load(find(name) if name in SHIPPED else path)


@pytest.fixture(scope="session")
def drivers(shared: Path, require_tool: Callable[..., str]) -> Iterator[Callable[[str], Driver]]:
    """Give the driver of a protocol, under address and undefined-behaviour sanitizers."""
    compiler = require_tool("gcc", package="gcc")
    running: dict[str, Driver] = {}

    def get(name: str) -> Driver:
        if name not in running:
            running[name] = Driver(build(protocol_of(name), shared / "drivers", compiler, SANITIZED))
        return running[name]

    yield get
    for driver in running.values():
        driver.close()
