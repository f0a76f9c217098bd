"""Kits of every protocol, built once per session and run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conformance import kits
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
