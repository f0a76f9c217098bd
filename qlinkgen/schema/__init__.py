"""Schema files: YAML text to the checked model, every fault with its line and column."""

from qlinkgen.schema.loader import find, lint, load, loads, shipped

__all__ = ["find", "lint", "load", "loads", "shipped"]
