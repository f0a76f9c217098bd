"""A port on a simulated line with a virtual clock: fast and deterministic."""

from __future__ import annotations

import math
import random

from qlinkgen.sim.errors import SimulationError
from qlinkgen.sim.wire import Wire
from qlinkgen.transport.port import Ability, Capabilities, Port, closed_here


class VirtualPort(Port):
    """The outside's port on a `Wire`. Time advances only in `read` and `sleep`, independently of real time.

    Collisions are those of the line: if it has a speed, and is not made with ``collisions=False``, bytes of
    transmissions that overlap are changed at random for every receiver, this port and the stations alike, and
    `wire.collisions` counts the transmissions that began during another one. On a line without a speed bytes
    take no time, so nothing overlaps. With an echo, `write` during another transmission gives a garbled echo.

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
            wire: the line; it has one port.
            baud: nominal speed; that of the line if it has one, else 115200.
            reaction: seconds from the arrival of bytes until the host can read them; one number, or the
                bounds of a random one.
            seed: seed of the random numbers.
            start: initial time of the clock, in seconds.
            name: name in error texts.

        Raises:
            SimulationError: a negative or infinite reaction, or bounds in the wrong order.
        """
        low, high = reaction if isinstance(reaction, tuple) else (reaction, reaction)
        if not 0 <= low <= high < math.inf:
            raise SimulationError(f"reaction must be 0 s or more, the lower bound first, not {reaction}")
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
        """Return received bytes, or let time pass until some arrive, at most `timeout` seconds.

        Returns b"" if none arrived; the clock has then advanced by exactly `timeout`.

        Raises:
            PortLost: the port was closed.
            SimulationError: an infinite timeout without any pending event.
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
                f"{self.name}: read with a timeout of {timeout} s would never return, as no station is going "
                "to send; use a finite timeout, or send first"
            )
        self._now = end
        return b""

    def write(self, data: bytes) -> None:
        """Send. The clock does not advance: the bytes are in transit when this returns.

        Raises:
            PortLost: the port was closed.
        """
        self._check_open()
        self.wire.transmit(data, self._now)

    def sleep(self, seconds: float) -> None:
        """Let time pass. Bytes arriving meanwhile can be read afterwards.

        Raises:
            PortLost: the port was closed.
            SimulationError: negative or infinite seconds.
        """
        self._check_open()
        if not 0 <= seconds < math.inf:
            raise SimulationError(f"{self.name}: sleep must be 0 s or more and finite, not {seconds}")
        self._now += seconds
        self.wire.advance(self._now)

    def close(self) -> None:
        """Close the port; the line continues without it. Closing twice is allowed."""
        self._closed = True

    def _check_open(self) -> None:
        if self._closed:
            raise closed_here(self.name)

    def _react(self) -> float:
        low, high = self._reaction
        return low if low == high else self._random.uniform(low, high)
