"""Finds schema files by name; imports nothing that reads them."""

from __future__ import annotations

from pathlib import Path

from qlinkgen._resources import library_dir, schemas_dir
from qlinkgen.errors import Fault, SchemaError
from qlinkgen.model.spelling import similar


def shipped() -> tuple[str, ...]:
    """Names of the protocols whose code is in the package."""
    return tuple(sorted(path.stem for path in schemas_dir().glob("*.yaml")))


def library() -> tuple[str, ...]:
    """Names of the public protocols in the package."""
    return tuple(sorted(path.stem for path in library_dir().glob("*.yaml")))


def find(protocol: str) -> Path:
    """The file of a schema in the package, or of a path. Raises SchemaError for an unknown name."""
    path = Path(protocol)
    if "/" in protocol or path.suffix:
        return path
    for folder in (schemas_dir(), library_dir()):
        if (file := folder / f"{protocol}.yaml").is_file():
            return file
    close = similar(protocol, (*shipped(), *library()))
    otherwise = "`qlinkgen list` names those of qlinkgen; or give the path of a .yaml file"
    hint = f"did you mean '{close[0]}'?" if close else otherwise
    raise SchemaError([Fault(protocol, 1, 1, "file-unreadable", "unknown schema", hint)])
