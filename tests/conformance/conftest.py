"""Kits of every protocol, written once in a session and run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conformance import kits

Write = Callable[[str], Path]


@pytest.fixture(scope="session")
def kit(tmp_path_factory: pytest.TempPathFactory) -> Write:
    """Give the kit of a protocol, with its header beside it; nobody changes them."""
    written: dict[str, Path] = {}

    def get(name: str) -> Path:
        if name not in written:
            written[name] = kits.write(name, tmp_path_factory.mktemp(f"kit_{name}"))
        return written[name]

    return get
