"""Generated packages of protocols of the library, to drive them by their bus modules."""

from __future__ import annotations

import functools
import importlib
import sys
import tempfile
import weakref
from pathlib import Path
from typing import Any

from qlinkgen.backends import python
from qlinkgen.backends.base import Options
from qlinkgen.backends.python import bus
from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import loads
from tests.library.protocols import described

#: Package of the modules.
PACKAGE = "wire_of_buses"


@functools.cache
def _folder() -> Path:
    folder = tempfile.TemporaryDirectory(prefix="buses-")
    weakref.finalize(write, folder.cleanup)
    sys.path.insert(0, folder.name)
    return Path(folder.name)


def write(protocol: Protocol, folder: Path, package: str = PACKAGE) -> None:
    """Write the modules of a protocol."""
    options = Options(package=package)
    for path, text in {**python.generate(protocol, options), **bus.generate(protocol, options)}.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, "utf-8")


@functools.cache
def bus_of(name: str) -> Any:
    """The bus module of a protocol of the library."""
    return _imported(described(name).model)


@functools.cache
def codec_of(name: str) -> Any:
    """Its codec."""
    bus_of(name)
    return importlib.import_module(f"{PACKAGE}.{name}")


@functools.cache
def of_text(text: str) -> Any:
    """The bus module of a schema."""
    protocol, faults = loads(text, "own.yaml")
    assert protocol is not None, faults
    return _imported(protocol)


def _imported(protocol: Protocol) -> Any:
    write(protocol, _folder())
    importlib.invalidate_caches()
    return importlib.import_module(f"{PACKAGE}.{protocol.name}_bus")


def asker(name: str, prefix: str = "") -> Any:
    """The class of a protocol that asks."""
    module = bus_of(name)
    return next(
        getattr(module, prefix + each) for each in ("Bus", "Device", "Peer") if hasattr(module, prefix + each)
    )
