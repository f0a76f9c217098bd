"""The interface of ports: reading, writing, a clock, and capabilities."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from enum import Enum
from types import TracebackType
from typing import Self

from qlinkgen.errors import PortLost


class Ability(Enum):
    """Whether a port has an ability; unknown for many ports."""

    YES = "yes"
    NO = "no"
    UNKNOWN = "unknown"

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True, slots=True)
class Capabilities:
    """Capabilities of a port, determined when it was opened.

    Attributes:
        exclusive: other programs cannot open it meanwhile. On a pty, only those that lock ports too.
        low_latency: the driver delivers bytes as soon as they are received.
        rs485: the driver switches the direction of an RS485 transceiver.
        paced: bytes are transmitted at the baud rate; not so on a pty, where they arrive immediately.
        latency: longest time in seconds that driver and adapter hold received bytes back, None if unknown.
        latency_source: source of that number, or why it is unknown.
        driver: name of the kernel's driver, empty if unknown.
    """

    exclusive: Ability = Ability.UNKNOWN
    low_latency: Ability = Ability.UNKNOWN
    rs485: Ability = Ability.UNKNOWN
    paced: Ability = Ability.UNKNOWN
    latency: float | None = None
    latency_source: str = ""
    driver: str = ""


class Port(ABC):
    """A bidirectional byte stream. A port belongs to one driver and has no lock.

    Attributes:
        name: device or URL, for error texts.
        baud: speed of the line in bits per second; on an unpaced port it only serves arithmetic.
        capabilities: capabilities of the port.
        own_clock: the port has a simulated clock, which advances only in `read` and `sleep`.
    """

    name: str
    baud: int
    capabilities: Capabilities
    own_clock: bool = False

    def now(self) -> float:
        """Return the time of this port's clock in seconds; only differences are meaningful."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Sleep on the clock of this port."""
        time.sleep(seconds)

    @abstractmethod
    def read(self, timeout: float) -> bytes:
        """Return received bytes, immediately if there are any, else as soon as some arrive.

        Returns b"" after `timeout` seconds without a byte; a timeout of 0 polls.

        Raises:
            PortLost: the port was lost or closed.
        """

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Pass all bytes to the system in one call; they may not be transmitted when this returns.

        Raises:
            PortLost: the port was lost or closed.
        """

    def send_break(self, seconds: float) -> None:  # noqa: B027  # most ports have none
        """Hold the line in a break for some time, once all bytes are transmitted.

        A pty, a simulated line or a raw connection has no breaks: this does nothing there, and the other end
        receives the frames without them.

        Raises:
            PortLost: the port was lost or closed.
        """

    def transmit(self, frame: bytes, after: float = 0.0) -> None:
        """Write a frame, after a break of so many seconds unless that is 0.

        Raises:
            PortLost: the port was lost or closed.
        """
        if after:
            self.send_break(after)
        self.write(frame)

    @abstractmethod
    def close(self) -> None:
        """Close the port, even while other threads use it. Closing twice is allowed.

        Waiting calls raise `PortLost` immediately. The descriptor is closed after the last of them.
        """

    def fileno(self) -> int | None:
        """Return a descriptor that becomes readable when bytes arrive, None for a port without one.

        Another thread may close the port at any time; see `hold` for a descriptor to wait on.
        """
        return None

    def hold(self, wake: Callable[[], object]) -> AbstractContextManager[int | None]:  # noqa: ARG002
        """Keep the descriptor, if the port has one, from being closed while a block waits on it.

        Args:
            wake: called by the thread that closes the port meanwhile; the block must then end soon.

        Raises:
            PortLost: the port was closed.
        """
        return nullcontext(self.fileno())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def closed_here(name: str) -> PortLost:
    """Return the error for using a port that this program has closed."""
    return PortLost(f"{name} was closed here; open it again to use it", port=name)
