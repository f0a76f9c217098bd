"""Lazy import of asyncio clients."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Collection


def asyncio_clients(package: str, names: Collection[str]) -> Callable[[str], object]:
    """Return a package's `__getattr__` for names of its module `aio`: importing asyncio takes 50 ms."""

    def find(name: str) -> object:
        if name in names:
            found: object = getattr(importlib.import_module(f"{package}.aio"), name)
            return found
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return find
