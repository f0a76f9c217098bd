"""A peer: statements that do the same work, and their namespace."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from benchmarks import messages

FIELDS = messages.ResponseFields._fields
READ_FIELDS = ", ".join(f"m.{name}" for name in FIELDS)
KEYWORDS = ", ".join(f"{name}={value}" for name, value in messages.RESPONSE._asdict().items())


class PeerMissing(Exception):
    """A peer that cannot be measured; the text names the package to install."""


@dataclass(frozen=True)
class Peer:
    """Statements that encode, build and encode, decode, decode and read every field."""

    name: str
    names: dict[str, Any]
    encode: str
    build: str
    decode: str
    read: str


def load(package: str, install: str = "") -> ModuleType:
    """Import a package that is not a dependency of the project."""
    if importlib.util.find_spec(package.partition(".")[0]) is None:  # find_spec imports parents
        raise PeerMissing(f"{package} is not installed (pip install {install or package})")
    return importlib.import_module(package)


def generated_module(source: Path, name: str) -> ModuleType:
    """Import a file just written by a peer's generator."""
    spec = importlib.util.spec_from_file_location(name, source)
    if spec is None or spec.loader is None:
        raise PeerMissing(f"{name} was not generated")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
