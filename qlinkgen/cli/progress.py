"""A progress bar for long files, on a terminal that shows nothing else."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import IO

import click

#: Bytes from which a bar is worth its line, and between two updates.
LONG, STEP = 4 << 20, 1 << 18


class Progress:
    """Counts how far a file is read; without a bar nothing happens."""

    def __init__(self) -> None:
        self._advance: Callable[[int], None] | None = None
        self._file: IO[bytes] | None = None
        self._at = 0

    def show(self, advance: Callable[[int], None], file: IO[bytes]) -> None:
        """Call a function with the number of further bytes of a file."""
        self._advance, self._file = advance, file

    def update(self) -> None:
        """Tell that more of the file was read."""
        if self._advance is None or self._file is None:
            return
        at = self._file.tell()
        if at - self._at >= STEP:
            self._advance(at - self._at)
            self._at = at


@contextmanager
def progress(file: IO[bytes], name: str) -> Iterator[Progress]:
    """Show a bar for a long file, if standard error is a terminal and the output goes elsewhere."""
    found = Progress()
    size = os.fstat(file.fileno()).st_size
    if size < LONG or not sys.stderr.isatty() or sys.stdout.isatty():
        yield found
        return
    with click.progressbar(length=size, label=name, file=sys.stderr) as bar:
        found.show(bar.update, file)
        yield found
