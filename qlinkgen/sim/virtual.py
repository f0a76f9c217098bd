"""A port on a simulated line with a clock of its own: hours of bus time in seconds, the same every time."""

from __future__ import annotations

import math
import random

from qlinkgen.sim.errors import SimulationError
from qlinkgen.sim.wire import Wire
from qlinkgen.transport.port import Ability, Capabilities, Port, closed_here


class VirtualPort(Port):
    """The outside's port on a `Wire`. Time moves only while it reads or sleeps, and never by the real clock.

    Attributes:
        wire: the line.
    """

    own_clock = True

    def __init__(
        self,
        wire: Wire,
        *,
        baud: int | None = None,
        reaction: float | tuple[float, float] = 0.0,
        seed: int = 0,
        start: float = 0.0,
        name: str = "virtual",
    ) -> None:
        """Open the port.

        Args:
            wire: the line; one port for each.
            baud: speed for the arithmetic of a driver; that of the line if it has one, else 115200.
            reaction: seconds the host needs from the arrival of bytes until it has them in hand; one number,
                or the two that it is drawn between.
            seed: of the draws.
            start: the time at which the clock begins, in seconds.
            name: for error texts.

        Raises:
            SimulationError: a reaction below 0 or without end, or the greater of the two first.
        """
        low, high = reaction if isinstance(reaction, tuple) else (reaction, reaction)
        if not 0 <= low <= high < math.inf:
            raise SimulationError(f"reaction is {reaction}: seconds from 0 on, the lower bound first")
        self.wire = wire
        self.name = name
        self.baud = baud or wire.baud or 115200
        self.capabilities = Capabilities(
            exclusive=Ability.YES,
            low_latency=Ability.YES,
            rs485=Ability.YES,
            paced=Ability.YES if wire.baud else Ability.NO,
            latency=high,
            latency_source="the reaction time of the simulated host",
        )
        self._reaction = (low, high)
        self._random = random.Random(f"reaction {seed}")
        self._take = wire.take if wire.chunks == "frame" else wire.take_piece
        self._now = start
        self._closed = False

    def now(self) -> float:
        """Seconds on the virtual clock."""
        return self._now

    def read(self, timeout: float) -> bytes:
        """Return what has come, or let time pass until something comes, at most `timeout` seconds.

        Returns b"" when nothing came; the clock has then moved by exactly `timeout`.

        Raises:
            PortLost: the port was closed.
            SimulationError: an endless timeout, and nothing that could ever end it.
        """
        self._check_open()
        data = self._take(self._now)
        if data or timeout <= 0:
            return data
        end = self._now + timeout
        at = self.wire.run(end)
        if at is not None:
            self._now = at + self._react()
            return self._take(self._now)
        if not end < math.inf:
            raise SimulationError(
                f"{self.name}: read with a timeout of {timeout} s, but nobody on the line is going to send: "
                "it would never return; give a timeout that ends, or send first"
            )
        self._now = end
        return b""

    def write(self, data: bytes) -> None:
        """Send. The clock does not move: the bytes are on their way when this returns.

        Raises:
            PortLost: the port was closed.
        """
        self._check_open()
        self.wire.transmit(data, self._now)

    def sleep(self, seconds: float) -> None:
        """Let time pass. What arrives meanwhile waits to be read.

        Raises:
            PortLost: the port was closed.
            SimulationError: less than 0 seconds, or endless ones.
        """
        self._check_open()
        if not 0 <= seconds < math.inf:
            raise SimulationError(f"{self.name}: sleep of {seconds} s: it must be 0 or more, and end")
        self._now += seconds
        self.wire.advance(self._now)

    def close(self) -> None:
        """Close the port; the line goes on without it. Closing twice does no harm."""
        self._closed = True

    def _check_open(self) -> None:
        if self._closed:
            raise closed_here(self.name)

    def _react(self) -> float:
        low, high = self._reaction
        return low if low == high else self._random.uniform(low, high)
