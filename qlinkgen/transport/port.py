"""What a driver needs of a port: bytes in, bytes out, a clock, and what the port can do."""

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
    """Whether a port can do something. Many can not say, and that is a third answer."""

    YES = "yes"
    NO = "no"
    UNKNOWN = "unknown"

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a port can do, as found when it was opened.

    Attributes:
        exclusive: other programs are kept out while it is open here. On a pty only those that lock ports too.
        low_latency: the driver hands bytes on as soon as they come.
        rs485: the driver switches the direction of an RS485 transceiver.
        paced: bytes take their time on a line at the baud rate; no on a pty, where they arrive at once.
        latency: most seconds that driver and adapter hold received bytes back, None where that is unknown.
        latency_source: where that number comes from, or why there is none, for people.
        driver: name of the kernel's driver, empty where it is not known.
    """

    exclusive: Ability = Ability.UNKNOWN
    low_latency: Ability = Ability.UNKNOWN
    rs485: Ability = Ability.UNKNOWN
    paced: Ability = Ability.UNKNOWN
    latency: float | None = None
    latency_source: str = ""
    driver: str = ""


class Port(ABC):
    """A byte stream both ways. A port belongs to one driver; it has no lock of its own.

    Attributes:
        name: what the user opened, for error texts.
        baud: speed of the line in bits a second; on a port that is not paced only the arithmetic uses it.
        capabilities: what the port can do.
        own_clock: its time is not the real one, and stands still while nobody reads or sleeps.
    """

    name: str
    baud: int
    capabilities: Capabilities
    own_clock: bool = False

    def now(self) -> float:
        """Seconds on the clock of this port; only differences mean anything."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Let time pass on the clock of this port."""
        time.sleep(seconds)

    @abstractmethod
    def read(self, timeout: float) -> bytes:
        """Return what has come, at once if there is anything, else as soon as something comes.

        Returns b"" when `timeout` seconds brought nothing; 0 only looks.

        Raises:
            PortLost: the port went away, or was closed.
        """

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Hand all bytes to the system in one go; they may still be on their way when this returns.

        Raises:
            PortLost: the port went away, or was closed.
        """

    @abstractmethod
    def close(self) -> None:
        """Give the port back, whatever other threads do with it. Closing twice does no harm.

        Calls that wait return at once with `PortLost`. A descriptor is closed when the last call has left it.
        """

    def fileno(self) -> int | None:
        """Return a descriptor that becomes readable when bytes come, None where there is none.

        Another thread may close the port at any time; see `hold` for a descriptor to wait on.
        """
        return None

    def hold(self, wake: Callable[[], object]) -> AbstractContextManager[int | None]:  # noqa: ARG002
        """Keep the descriptor, None where there is none, from being closed while a block waits on it.

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
    """Return the error for the use of a port that this program has closed."""
    return PortLost(f"{name} was closed here; open it again to use it", port=name)
