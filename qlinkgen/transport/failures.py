"""Errors of opening a port, with their cause and fix."""

from __future__ import annotations

import errno
import os
import stat
import sys
from pathlib import Path
from urllib.parse import urlsplit

from qlinkgen.errors import PortBusy, PortError, PortMissing

if sys.platform != "win32":
    import grp

#: The kernel's list of processes.
PROC = Path("/proc")

_BUSY = {errno.EBUSY, errno.EAGAIN}
_FORBIDDEN = {errno.EACCES, errno.EPERM}
#: EIO comes from a device file without hardware, such as most of /dev/ttyS*.
_MISSING = {errno.ENOENT, errno.ENOTDIR, errno.ENXIO, errno.ENODEV, errno.EIO}
_NO_TERMINAL = {errno.ENOTTY, errno.EISDIR, errno.EINVAL}

_URLS = "write socket://HOST:PORT for plain TCP, or rfc2217://HOST:PORT for a serial device server"


def explain(name: str, error: Exception) -> PortError:
    """Convert an error of pyserial or the system on opening `name` to a PortError."""
    if "://" in name:
        return _explain_url(name, error)
    number = _errno(error)
    if number in _BUSY:
        return busy(name)
    if number in _FORBIDDEN:
        return _forbidden(name)
    if number in _MISSING:
        return missing(name)
    if number in _NO_TERMINAL:
        return PortError(f"{name} is not a serial port; {_ports_here()}", port=name)
    return PortError(f"{name} cannot be opened: {_words(error)}; {_ports_here()}", port=name)


def _errno(error: Exception) -> int | None:
    # pyserial sets the number, or only the context.
    for each in (error, error.__context__):
        if isinstance(each, OSError) and each.errno is not None:
            return each.errno
        if each is not None and type(each).__module__ == "termios" and each.args:
            return int(each.args[0])
    # On Windows only the text has it.
    text = str(error)
    named = {"PermissionError": errno.EBUSY, "FileNotFoundError": errno.ENOENT}
    return next((number for word, number in named.items() if word in text), None)


def _words(error: Exception) -> str:
    cause = error.__context__ or error
    return str(getattr(cause, "strerror", None) or cause)


def _explain_url(name: str, error: Exception) -> PortError:
    if name.lower().startswith("hwgrep://"):
        return PortMissing(f"no port matches {name}; {_ports_here()}", port=name)
    if isinstance(error.__context__, OSError):
        return PortMissing(
            f"{name} cannot be reached: {_words(error)}; check host and port, and that its server runs",
            port=name,
        )
    return PortError(f"{name} cannot be opened: {error}; {_URLS}", port=name)


def check_url(name: str) -> None:
    """Refuse a network URL without host or port, for which pyserial's error is unclear."""
    parts = urlsplit(name)
    if parts.scheme not in {"socket", "rfc2217"}:
        return
    try:
        complete = bool(parts.hostname) and parts.port is not None
    except ValueError:  # the port is not a number, or too large
        complete = False
    if not complete:
        raise PortError(f"{name} has no host and port (1 to 65535); {_URLS}", port=name)


def missing(name: str) -> PortMissing:
    """Return the error for a missing port, with a list of existing ones."""
    what = f"port {name!r} does not exist" if not os.path.lexists(name) else f"{name} has no hardware"
    if Path(name).is_symlink() and not Path(name).exists():
        what = f"{name} is a link to {Path(name).readlink()}, which does not exist"
    return PortMissing(f"{what}; {_ports_here()}", port=name)


def _ports_here() -> str:
    from serial.tools import list_ports  # noqa: PLC0415  # only errors need it

    ports = [
        each.device + (f" ({each.description})" if each.description not in {None, "", "n/a"} else "")
        for each in sorted(list_ports.comports())
    ]
    return f"available ports: {', '.join(ports)}" if ports else "no serial ports found: connect the adapter"


def busy(name: str) -> PortBusy:
    """Return the error for a port in use, with the name of the program if it can be determined."""
    who = holders(name)
    if who:
        return PortBusy(f"{name} is in use by {', '.join(who)}; end it, or use another port", port=name)
    return PortBusy(f"{name} is in use by another program; find it with `sudo fuser -v {name}`", port=name)


def _forbidden(name: str) -> PortBusy:
    if sys.platform == "win32":
        return busy(name)
    state = Path(name).stat()
    try:
        group = grp.getgrgid(state.st_gid).gr_name
    except KeyError:
        group = str(state.st_gid)
    why = f"no permission to open {name} ({stat.filemode(state.st_mode)}, group {group})"
    if state.st_mode & stat.S_IRGRP and state.st_mode & stat.S_IWGRP and state.st_gid:
        return PortBusy(f"{why}; `sudo usermod -aG {group} $USER`, then log out and in again", port=name)
    fix = 'a udev rule with GROUP="dialout", MODE="0660" opens it to the members of dialout'
    return PortBusy(f"{why}; {fix}", port=name)


def holders(name: str) -> list[str]:
    """Return the programs that hold a port, if visible to this user, such as `minicom (process 812)`."""
    numbers = _lockers(name) or _openers(name)
    return [f"{_program(number)} (process {number})" for number in numbers]


def _lockers(name: str) -> list[int]:
    """Return the processes with a lock on the device file. Every user may read this list."""
    try:
        state = Path(name).stat()
        locks = (PROC / "locks").read_text("ascii").splitlines()
    except OSError:
        return []
    file = f"{os.major(state.st_dev):02x}:{os.minor(state.st_dev):02x}:{state.st_ino}"
    # Such as "1: FLOCK  ADVISORY  WRITE 812 00:18:3 0 EOF"; -1 is an invisible process.
    rows = [line.split() for line in locks]
    return sorted({int(row[4]) for row in rows if row[5:6] == [file] and row[4].isdigit()})


def _openers(name: str) -> list[int]:
    """Return the processes that have the device open, among those visible to this user."""
    device = os.path.realpath(name)
    found = []
    for folder in PROC.glob("[0-9]*/fd"):
        try:
            if any(os.path.realpath(link) == device for link in folder.iterdir()):
                found.append(int(folder.parent.name))
        except OSError:  # not permitted, or ended meanwhile
            continue
    return sorted(found)


def _program(number: int) -> str:
    try:
        return (PROC / str(number) / "comm").read_text("utf-8", "replace").strip()
    except OSError:
        return "a program"
