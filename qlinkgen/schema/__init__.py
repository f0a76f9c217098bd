"""Schema files: converts YAML text to a validated model and reports faults with line and column.

The loader is imported when it is first used: it takes longer than all else that most commands do.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from qlinkgen.schema.finding import find, library, shipped

if TYPE_CHECKING:
    from qlinkgen.schema.loader import lint, load, loads

__all__ = ["find", "library", "lint", "load", "loads", "shipped"]

_OF_LOADER = ("lint", "load", "loads")


def __getattr__(name: str) -> object:
    if name in _OF_LOADER:
        found: object = getattr(importlib.import_module("qlinkgen.schema.loader"), name)
        return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
