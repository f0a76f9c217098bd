"""Recordings of ports while they are used."""

from __future__ import annotations

import os
import re
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

from qlinkgen.captures.writer import Writer
from qlinkgen.link.codec import Fault
from qlinkgen.link.events import Frame

#: What a generated module says of its schema: the file, and the beginning of its hash.
_ORIGIN = re.compile(r"\bfrom\s+(\S+) \(([0-9a-f]{12})\)")
_PROGRAM = "qlinkgen"


class Recording:
    """A pcapng file of the traffic of ports, for any number of threads.

    Example:
        >>> with Recording("line.pcapng") as recording:  # doctest: +SKIP
        ...     bus = Bus.open("/dev/ttyUSB0", on_frame=recording.port("/dev/ttyUSB0", oven))
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Create or replace the file.

        Raises:
            OSError: it cannot be written.
        """
        self._writer = Writer(path, _PROGRAM)
        self._lock = threading.Lock()

    def port(
        self,
        name: str,
        codec: object,
        *,
        speed: int | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> RecordedPort:
        """Add a port, and return what is called with its frames, as `on_frame` of buses and slaves.

        Args:
            name: its name.
            codec: the generated module of the protocol, whose schema is named in the file.
            speed: bits per second.
            clock: that of the port, in seconds; another one only where time is simulated.
        """
        origin = _ORIGIN.search(getattr(codec, "__doc__", None) or "")
        comments = [f"schema {origin[1]} {origin[2]}"] if origin else []
        with self._lock:
            number = self._writer.add_interface(name, comments, speed)
        return RecordedPort(self._writer, self._lock, number, time.time_ns() - round(clock() * 1e9))

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class RecordedPort:
    """Appends the frames of one port."""

    def __init__(self, writer: Writer, lock: threading.Lock, number: int, start: int) -> None:
        """Use `Recording.port`; `start` is the time of day at 0 on the clock of the port, in nanoseconds."""
        self._writer = writer
        self._lock = lock
        self._number = number
        self._start = start

    def __call__(self, frame: Frame) -> None:
        """Append a frame that an engine tells of.

        Raises:
            OSError: the file cannot be written.
        """
        self.add(frame.at, frame.data, sent=frame.sent, fault=frame.fault)

    def add(self, at: float, data: bytes, *, sent: bool, fault: Fault | None = None) -> None:
        """Append bytes.

        Args:
            at: seconds on the clock of the port.
            data: a frame, or bytes that are none.
            sent: by the owner of the port.
            fault: what is wrong with them.

        Raises:
            OSError: the file cannot be written.
        """
        comments = [] if fault is None else [f"{fault.kind}: {fault.message}"]
        with self._lock:
            self._writer.write(
                self._number,
                max(0, self._start + round(at * 1e9)),
                data,
                "sent" if sent else "received",
                comments,
            )
