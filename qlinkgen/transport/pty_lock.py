"""Whether the program that made a link to a pty is still running.

The kernel gives the number of a pty that is gone to the next terminal that is opened, so the link of a killed
simulator may lead to a shell, or to another simulator. A lock on the slave end tells: it covers one byte,
whose place follows from the path of the link, and ends with the program that holds it. It belongs to one
opening of the device, so other openings in the same process do not end it, and it is independent of the
`flock` by which serial programs keep one another out.
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
    """Say that this process makes a link to a pty, as far as the system has such locks."""
    if sys.platform == "linux":
        fcntl.fcntl(slave, fcntl.F_OFD_SETLK, _byte_of(link))


def is_locked(device: str, link: Path) -> bool:
    """Return whether the maker of a link to a pty is running; where nothing tells, whether the pty exists."""
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
