"""Resources that one worker builds once per session for all workers."""

from __future__ import annotations

import contextlib
import fcntl
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Let one process at a time enter the block."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


@contextlib.contextmanager
def made_once(folder: Path) -> Iterator[bool]:
    """Enter the block exclusively; yields whether it is the first time and the folder must be filled."""
    folder.mkdir(parents=True, exist_ok=True)
    done = folder.with_suffix(".done")
    with locked(folder.with_suffix(".lock")):
        yield not done.exists()
        done.touch()
