"""Keeps the models of schemas as data, so that most commands need not read and check a schema again.

A file is found by the text of its schema, the version of the protocol, and the code that made the model; it
is believed only if other users cannot write it, as with the compiled modules of Python.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import stat
import tempfile
from functools import cache
from pathlib import Path

from qlinkgen.model.protocol import Protocol
from qlinkgen.model.stored import NotStorable, restore, store

#: Folder of the files, "" for none; by default below that of the user.
VARIABLE = "QLINKGEN_CACHE"
#: Most files; then the oldest ones are removed.
MOST = 100
_PACKAGE = Path(__file__).resolve().parents[1]


def recall(schema: Path, version: str | None) -> Protocol | None:
    """Return the model of a schema file, None if it has to be read."""
    try:
        file = _file(schema, version)
        if file is None or not _is_own(file.parent) or not _is_own(file):
            return None
        protocol = restore(json.loads(file.read_bytes()))
        return protocol if _hash(schema, protocol) == protocol.schema_hash else None
    except (OSError, ValueError, RecursionError, NotStorable):  # ValueError: no text, no JSON
        return None


def keep(schema: Path, version: str | None, protocol: Protocol) -> None:
    """Keep a model, unless its folder cannot be written."""
    with contextlib.suppress(OSError, ValueError, NotStorable):
        file = _file(schema, version)
        if file is None:
            return
        text = json.dumps(store(protocol), separators=(",", ":"))
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not _is_own(file.parent):
            return
        _prune(file.parent)
        descriptor, name = tempfile.mkstemp(dir=file.parent, prefix="new-")
        try:
            with os.fdopen(descriptor, "w", encoding="ascii") as out:
                out.write(text)
            Path(name).replace(file)
        finally:
            Path(name).unlink(missing_ok=True)


def _file(schema: Path, version: str | None) -> Path | None:
    """Return where the model of a schema is kept; None if it is not a file, or nothing is kept."""
    folder = os.environ.get(VARIABLE)
    if folder == "" or not schema.is_file():
        return None
    if folder is None:
        base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache"
        folder = str(Path(base, "qlinkgen"))
    key = hashlib.sha256(f"{_code()} {schema.name} {version or ''} ".encode() + schema.read_bytes())
    return Path(folder, f"{key.hexdigest()[:40]}.json")


@cache
def _code() -> str:
    """Return what changes with the code that makes models."""
    files = [each for part in ("model", "schema") for each in os.scandir(_PACKAGE / part) if each.is_file()]
    told = sorted((each.name, each.stat().st_size, each.stat().st_mtime_ns) for each in files)
    return hashlib.sha256(repr(told).encode()).hexdigest()


def _hash(schema: Path, protocol: Protocol) -> str:
    """Return the hash of the schema with what it includes now, as the loader computes it."""
    text = schema.read_text("utf-8")
    if protocol.includes:
        text += (schema.parent / protocol.includes).read_text("utf-8")
    text += f"\nversion {protocol.version}" if protocol.version else ""
    return hashlib.sha256(text.replace("\r\n", "\n").encode()).hexdigest()[:12]


def _is_own(path: Path) -> bool:
    """Whether only the user can write a file or a folder; systems without users of this kind say nothing."""
    found = path.stat()
    if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
        return False  # reading a pipe waits
    if not hasattr(os, "getuid"):
        return True
    return found.st_uid == os.getuid() and not found.st_mode & 0o022


def _prune(folder: Path) -> None:
    files = sorted(folder.glob("*.json"), key=lambda each: each.stat().st_mtime)
    for each in files[: max(0, len(files) - MOST + 1)]:
        each.unlink(missing_ok=True)
