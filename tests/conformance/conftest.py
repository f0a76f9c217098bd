"""Kits of every protocol, built once per session and run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conformance import emulators, kits
from tests.support.sharing import made_once

Write = Callable[[str], Path]


@pytest.fixture(scope="session")
def kit(shared: Path) -> Write:
    """Give the kit of a protocol, next to its header; tests must not change them."""

    def get(name: str) -> Path:
        folder = shared / "kits" / name
        with made_once(folder) as first:
            if first:
                kits.write(name, folder)
        return folder / f"{name}_conformance.c"

    return get


@pytest.fixture(scope="session")
def simulator(tmp_path_factory: pytest.TempPathFactory, require_tool: Callable[..., str]) -> Path:
    """Give the program that runs a firmware of an ATmega328P to its end."""
    return emulators.avr_simulator(tmp_path_factory.mktemp("simavr"), require_tool)
