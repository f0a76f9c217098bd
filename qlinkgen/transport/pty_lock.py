"""Determines whether the program that made a link to a pty is still running.

The kernel reuses the number of a closed pty for the next terminal, so the link of a killed simulator may
point to a shell, or to another simulator. A lock on the slave end decides: it covers one byte, whose offset
follows from the path of the link, and ends with its program. It belongs to one opening of the device, so
other openings in the same process do not end it, and it is independent of the `flock` by which serial
programs exclude one another.
"""

from __future__ import annotations

import os
import struct
import sys
import zlib
from pathlib import Path

if sys.platform != "win32":
    import fcntl

#: struct flock of <fcntl.h>: type, whence, start, length, process.
_FLOCK = struct.Struct("hhqqi4x")


def lock(slave: int, link: Path) -> None:
    """Lock the link of this process, if the system has such locks."""
    if sys.platform == "linux":
        fcntl.fcntl(slave, fcntl.F_OFD_SETLK, _byte_of(link))


def is_locked(device: str, link: Path) -> bool:
    """Return whether the program of a link is running; on systems without locks, whether the pty exists."""
    try:
        slave = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except FileNotFoundError:
        return False
    except OSError:  # of another user
        return True
    try:
        if sys.platform != "linux":
            return True
        kind = _FLOCK.unpack(fcntl.fcntl(slave, fcntl.F_OFD_GETLK, _byte_of(link)))[0]
        return bool(kind != fcntl.F_UNLCK)
    finally:
        os.close(slave)


def _byte_of(link: Path) -> bytes:
    path = link.parent.resolve() / link.name
    return _FLOCK.pack(fcntl.F_WRLCK, os.SEEK_SET, zlib.crc32(os.fsencode(path)), 1, 0)
