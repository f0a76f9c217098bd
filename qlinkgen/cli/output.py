"""Files of an output folder: looking at paths, locking, and writing all files or none."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

import click

from qlinkgen._dataclass import dataclass

#: Suffix of temporary files; those of a killed run are removed by the next one.
_PREFIX, _SUFFIX = ".qlinkgen-", ".tmp"
#: Errors of a file system without locks, such as some network file systems.
_NO_LOCKS = (errno.ENOLCK, errno.EBADF, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)


@dataclass(frozen=True, slots=True)
class Found:
    """What is at a path: nothing, a file with its bytes, or an obstacle to writing a file there."""

    data: bytes | None = None
    obstacle: str = ""


def look(root: Path, path: str) -> Found:
    """Look at a path below a folder. Links to folders are followed, unless they leave the folder."""
    place = root
    for part in PurePosixPath(path).parts[:-1]:
        place /= part
        if not place.exists():
            return Found(obstacle=f"{place} is a dangling link" if place.is_symlink() else "")
        if not place.is_dir():
            return Found(obstacle=f"{place} is not a folder")
        if not place.resolve().is_relative_to(root.resolve()):
            return Found(obstacle=f"{place} leads out of {root}, to {place.resolve()}")
    return _look_at(place / PurePosixPath(path).name)


def _look_at(file: Path) -> Found:
    try:
        mode = file.lstat().st_mode
    except FileNotFoundError:
        return Found()
    if stat.S_ISREG(mode):
        return Found(file.read_bytes())
    kinds = {stat.S_IFLNK: "a link", stat.S_IFDIR: "a folder"}
    return Found(obstacle=f"{file} is {kinds.get(stat.S_IFMT(mode), 'not a regular file')}")


@contextlib.contextmanager
def locked(root: Path) -> Iterator[None]:
    """Lock a folder, so that concurrent runs wait for one another.

    The lock is on the folder itself, so a killed run leaves nothing. On systems without such a lock (Windows,
    some network file systems), the user must avoid concurrent runs.
    """
    if sys.platform == "win32":
        yield
        return
    handle = os.open(root, os.O_RDONLY)
    try:
        _lock(handle, root)
        yield
    finally:
        os.close(handle)


if sys.platform != "win32":

    def _lock(handle: int, root: Path) -> None:
        import fcntl  # noqa: PLC0415  # not on every system

        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            click.echo(f"qlinkgen: another run is writing to {root}; waiting for it", err=True)
            fcntl.flock(handle, fcntl.LOCK_EX)
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise


def replace(root: Path, texts: Mapping[str, str], gone: Iterable[str] = (), last: str = "") -> None:
    """Write files, then remove others, then write the ``last`` one.

    Every text is written to a temporary file before the first one is moved into place: a full disk changes
    nothing, and a concurrent compiler never reads half a file.
    """
    staged: list[tuple[Path, Path]] = []
    try:
        for path, text in texts.items():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            _stage(root / path, text, staged)
        for temporary, place in staged:
            if place != root / last:
                temporary.replace(place)
        for path in gone:
            (root / path).unlink()
        for temporary, place in staged:
            if place == root / last:
                temporary.replace(place)
    finally:
        for temporary, _ in staged:
            temporary.unlink(missing_ok=True)


def _stage(place: Path, text: str, staged: list[tuple[Path, Path]]) -> None:
    handle, name = tempfile.mkstemp(_SUFFIX, _PREFIX, place.parent)
    staged.append((Path(name), place))
    with open(handle, "w", encoding="utf-8", newline="\n") as file:  # noqa: PTH123  # a descriptor, not a path
        file.write(text)
    Path(name).chmod(place.stat().st_mode & 0o777 if place.exists() else 0o666 & ~_umask())


def clean(root: Path, paths: Iterable[str]) -> None:
    """Remove temporary files of a killed run at these paths; the folder must be locked."""
    for folder in {(root / path).parent for path in paths}:
        for left in folder.glob(f"{_PREFIX}*{_SUFFIX}"):
            if left.is_file() and not left.is_symlink():
                left.unlink()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
