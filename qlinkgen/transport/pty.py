"""A pseudo-terminal: a serial port that other programs can open, with its other end in this process.

A pty has two ends. The slave end has a device name like /dev/pts/7 and behaves like a serial port; the master
end is `PtyPort`. It is used by simulated nodes and by tests.
"""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

from qlinkgen.errors import CapabilityMissing, PortBusy, PortError
from qlinkgen.transport import pty_lock
from qlinkgen.transport.port import Ability, Capabilities
from qlinkgen.transport.stream import CHUNK, DescriptorChannel, StreamPort

if sys.platform != "win32":
    import tty

#: Directory of the slave ends.
_SLAVES = Path("/dev/pts")

_CAPABILITIES = Capabilities(
    exclusive=Ability.YES,
    low_latency=Ability.YES,
    rs485=Ability.NO,
    paced=Ability.NO,
    latency=0.0,
    latency_source="a pty delivers bytes immediately",
)

#: Seconds before a full buffer is emptied; a reader needs microseconds.
_STALL = 0.05


class PtyChannel(DescriptorChannel):
    """The master end. Like a line, it does not wait for a reader: a full buffer is discarded.

    Attributes:
        dropped: number of discarded bytes.
    """

    def __init__(self, master: int, slave: int) -> None:
        """Take ownership of both descriptors."""
        super().__init__(master, _STALL)
        self._master = master
        self._slave = slave
        self.dropped = 0

    def _stalled(self, data: memoryview) -> memoryview:
        waiting = self._throw_away()
        self.dropped += waiting
        if waiting or self._wait(0, writable=True):
            return data
        self.dropped += len(data)  # a program has stopped the pty, so its buffer cannot be emptied
        return data[:0]

    def _throw_away(self) -> int:
        # Reading from our descriptor of the slave end empties the buffer in place of the missing reader.
        count = 0
        with contextlib.suppress(BlockingIOError):
            while data := os.read(self._slave, CHUNK):
                count += len(data)
        return count

    def close(self) -> None:
        """Close both ends."""
        super().close()
        os.close(self._slave)
        os.close(self._master)


class PtyPort(StreamPort):
    """The master end of a new pty. Programs may open and close the slave end as often as they like.

    Attributes:
        path: device name of the slave end.
        link: symbolic link to it, if requested; removed when the port is closed.
    """

    def __init__(self, link: str | os.PathLike[str] | None = None, *, baud: int = 115200) -> None:
        """See `open_pty`."""
        if sys.platform == "win32":
            raise CapabilityMissing(
                "this system has no ptys; use memory_pair() or a pair of virtual COM ports"
            )
        try:
            master, slave = os.openpty()
        except OSError as error:
            raise PortError(f"cannot open a pty: {error.strerror}; close some, or raise the limit") from error
        path = os.ttyname(slave)
        super().__init__(path if link is None else str(link), baud)
        # Our descriptor of the slave end stays open: otherwise the master would read EIO whenever no program
        # has the slave end open.
        self._pty = PtyChannel(master, slave)
        self._use(self._pty)
        self.path = path
        self.link: Path | None = None
        self.capabilities = _CAPABILITIES
        try:
            tty.setraw(slave)
            os.set_blocking(master, False)
            os.set_blocking(slave, False)
            if link is not None:
                pty_lock.lock(slave, Path(link))  # before others can see the link
                self.link = _make_link(Path(link), self.path)
                self._held.callback(self._unlink)
        except BaseException:
            self.close()
            raise

    @property
    def dropped(self) -> int:
        """Number of bytes discarded because no program has read them in time."""
        return self._pty.dropped

    def _unlink(self) -> None:
        """Remove the link, unless it points elsewhere by now."""
        link, self.link = self.link, None
        with contextlib.suppress(OSError):
            if link is not None and str(link.readlink()) == self.path:
                link.unlink()


def open_pty(link: str | os.PathLike[str] | None = None, *, baud: int = 115200) -> PtyPort:
    """Open a new pty and return its master end, raw and without echo.

    Args:
        link: path for a symbolic link to the slave end, so that its name is known beforehand. A link left by
            a
            killed program is replaced; other files are not.
        baud: nominal speed, used only in arithmetic.

    Raises:
        PortError: the link cannot be made; PortBusy: it is that of a running program.
        CapabilityMissing: this system has no ptys.
    """
    return PtyPort(link, baud=baud)


def _make_link(link: Path, target: str) -> Path:
    """Create or replace a link atomically."""
    if os.path.lexists(link):
        _check_stale(link, target)
    new = link.with_name(f".{link.name}.{os.urandom(4).hex()}")
    try:
        new.symlink_to(target)
        new.replace(link)
    except OSError as error:
        with contextlib.suppress(OSError):
            new.unlink()
        raise PortError(
            f"cannot make the link {link}: {error.strerror}; its folder must exist and be writable",
            port=str(link),
        ) from error
    return link.absolute()


def _check_stale(link: Path, target: str) -> None:
    """Refuse to replace anything but the link of a killed program, whose pty number `target` may reuse."""
    if not link.is_symlink() or (link.exists() and link.resolve().parent != _SLAVES):
        raise PortError(
            f"{link} exists and is not a link to a pty, so it is not replaced; "
            "remove it, or choose another path",
            port=str(link),
        )
    device = str(link.resolve())
    if device != target and link.exists() and pty_lock.is_locked(device, link):
        raise PortBusy(
            f"{link} is a link to {device} and belongs to a running program; stop that program, or "
            "choose another path",
            port=str(link),
        )
