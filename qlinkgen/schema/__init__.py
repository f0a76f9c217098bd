"""Schema files: converts YAML text to a validated model and reports faults with line and column."""

from qlinkgen.schema.loader import find, library, lint, load, loads, shipped

__all__ = ["find", "library", "lint", "load", "loads", "shipped"]
