"""Runs a Python file or the command line as on Windows, as far as that can be shown on another system.

`sys.platform` is win32, modules and functions that Windows lacks are missing, `select` takes sockets only.
Packages of others, and those of Python itself, are imported before: they ask for the real system.

Run as `python windows.py FILE ARGUMENTS` or `python windows.py qlinkgen ARGUMENTS`.
"""

from __future__ import annotations

import importlib
import os
import runpy
import select
import signal
import stat
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Protocol

OTHERS = (
    "asyncio",
    "click._compat",
    "click.shell_completion",
    "concurrent.futures.thread",
    "ctypes",
    "jinja2",
    "pydantic.types",
    "serial.urlhandler.protocol_socket",
    "subprocess",
    "tempfile",
    "yaml",
    "zoneinfo",
)
MODULES = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")
FUNCTIONS: tuple[tuple[ModuleType, tuple[str, ...]], ...] = (
    (os, ("fork", "openpty", "register_at_fork", "set_blocking", "ttyname")),
    (select, ("epoll", "poll")),
    (signal, ("SIGHUP",)),
)


class HasFileno(Protocol):
    """A file or socket."""

    def fileno(self) -> int:
        """Return its descriptor."""


Waited = int | HasFileno


class Missing(MetaPathFinder):
    """Refuses the modules that Windows lacks."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname in MODULES:
            raise ModuleNotFoundError(f"No module named '{fullname}'", name=fullname)
        return None


def pretend() -> None:
    """Take away what Windows lacks."""
    for name in OTHERS:
        importlib.import_module(name)
    for name in MODULES:
        sys.modules.pop(name, None)
    sys.meta_path.insert(0, Missing())
    for owner, names in FUNCTIONS:
        for name in names:
            delattr(owner, name)
    real = select.select

    def sockets_only(
        readers: Sequence[Waited], writers: Sequence[Waited], others: Sequence[Waited], *timeout: float | None
    ) -> object:
        for each in (*readers, *writers, *others):
            descriptor = each if isinstance(each, int) else each.fileno()
            if not stat.S_ISSOCK(os.fstat(descriptor).st_mode):
                raise OSError("an operation was attempted on something that is not a socket")
        return real(readers, writers, others, *timeout)

    select.select = sockets_only  # type: ignore[assignment]
    sys.platform = "win32"


if __name__ == "__main__":
    pretend()
    what, sys.argv = sys.argv[1], sys.argv[1:]
    if what == "qlinkgen":
        from qlinkgen.cli import main

        main()
    runpy.run_path(what, run_name="__main__")
