"""Profiles of a simulated axis, sample by sample: good enough to move, to be changed on the way, to arrive.

Positions, velocities and accelerations are whole numbers of 1/2^32 counts, so nothing is ever rounded away:
an axis arrives at its destination exactly.
"""

from __future__ import annotations

from collections import deque
from math import isqrt
from typing import Final

#: Whole counts begin at this bit.
COUNTS: Final = 32
TRAPEZOIDAL: Final = 0
VELOCITY: Final = 1
S_CURVE: Final = 2
GEAR: Final = 3
#: Samples over which an acceleration is built up at most; a jerk near 0 would take hours.
LONGEST_RAMP: Final = 1 << 14


def way_to_stop(velocity: int, acceleration: int) -> int:
    """Return how far an axis still goes that loses `acceleration` in each sample; both 0 or more."""
    if not acceleration:
        return 0
    samples = velocity // acceleration
    return samples * velocity - acceleration * samples * (samples + 1) // 2


def point_to_point(distance: int, velocity: int, limit: int, acceleration: int) -> tuple[int, int]:
    """One sample on the way to a destination.

    Args:
        distance: from here to the destination, with its sign.
        velocity: in the sample before, with its sign.
        limit: velocity that is not exceeded, 0 or more.
        acceleration: most change of velocity in a sample, 0 or more.

    Returns:
        How far it moves in this sample, and the velocity then. It moves the whole distance, with a velocity
        of 0 then, when it arrives.
    """
    if velocity < 0 or (velocity == 0 and distance < 0):
        step, new = point_to_point(-distance, -velocity, limit, acceleration)
        return -step, -new
    slowest = max(velocity - acceleration, 0)
    if distance < 0:  # on the way from it: stop first
        return slowest, slowest
    fastest = max(min(velocity + acceleration, limit), min(slowest, velocity))
    # Velocities m * a, ..., 2a, a cover a * m * (m + 1) / 2; from more than that it could not stop in time.
    still_stops = (isqrt(acceleration * (acceleration + 8 * distance)) - acceleration) // 2
    new = max(min(fastest, max(still_stops, 1)), slowest)
    if new >= distance and slowest <= acceleration:
        return distance, 0
    return new, new


class Smoothing:
    """Turns a trapezoidal profile into an S-curve: each position is the mean of the last few.

    The mean over as many samples as the acceleration takes to build up has just that jerk, and arrives where
    the trapezoidal profile does.
    """

    def __init__(self, position: int, samples: int) -> None:
        self._positions = deque([position] * samples, maxlen=samples)
        self._sum = position * samples

    def put(self, position: int) -> int:
        """Take the next position of the trapezoidal profile; return that of the S-curve."""
        self._sum += position - self._positions[0]
        self._positions.append(position)
        return self._sum // len(self._positions)


class Trajectory:
    """The target position of an axis, in time.

    Attributes:
        mode: TRAPEZOIDAL, VELOCITY, S_CURVE or GEAR.
        position: target position.
        velocity: what it moved in the last sample.
        moving: it has not come to its end.
    """

    def __init__(self) -> None:
        self.mode = TRAPEZOIDAL
        self.position = 0
        self.velocity = 0
        self.moving = False
        self._destination = 0
        self._ahead = 0  # position and velocity of the trapezoidal profile, of which an S-curve is the mean
        self._speed = 0
        self._smoothing: Smoothing | None = None
        self._stopping = False

    def move_to(self, destination: int, ramp: int) -> None:
        """Begin to move; `ramp` are the samples in which an S-curve builds up its acceleration."""
        self._destination = destination
        self._stopping = False
        if self.mode == S_CURVE and not (self.moving and self._smoothing):
            self._smoothing = Smoothing(self.position, min(max(ramp, 1), LONGEST_RAMP))
            self._ahead, self._speed = self.position, 0
        elif not self.moving:
            self._smoothing = None
        self.moving = True

    def run_free(self) -> None:
        """Begin to follow the acceleration alone, as in velocity mode."""
        self._smoothing = None
        self._stopping = False
        self.moving = True

    def halt(self) -> None:
        """Stop here and now."""
        self.velocity = self._speed = 0
        self.moving = self._stopping = False
        self._smoothing = None

    def slow_down(self, acceleration: int) -> None:
        """Begin to stop."""
        if not self.moving or self.mode == GEAR:
            return
        here, speed = (self._ahead, self._speed) if self._smoothing else (self.position, self.velocity)
        way = way_to_stop(abs(speed), acceleration)
        self._destination = here + (way if speed >= 0 else -way)
        self._stopping = True

    def shift(self, counts: int) -> None:
        """Call the place where it is another one, for an axis that is at rest or runs free."""
        self.position += counts
        self._ahead += counts
        if self._smoothing:
            self._smoothing = Smoothing(self.position, 1)

    def sample(self, limit: int, acceleration: int) -> None:
        """Move on by one sample; a negative acceleration leads backwards in velocity mode."""
        before = self.position
        if self.mode == VELOCITY:
            self._sample_free(limit, acceleration)
        elif self._smoothing is not None:
            self._sample_smooth(self._smoothing, limit, abs(acceleration))
        else:
            step, self.velocity = point_to_point(
                self._destination - before, self.velocity, limit, abs(acceleration)
            )
            self.position = before + step
            self.moving = self.position != self._destination or self.velocity != 0
        if self._smoothing is not None:
            self.velocity = self.position - before

    def _sample_free(self, limit: int, acceleration: int) -> None:
        wanted = 0 if self._stopping or not acceleration else limit if acceleration > 0 else -limit
        change = abs(acceleration)
        self.velocity = max(min(wanted, self.velocity + change), self.velocity - change)
        self.position += self.velocity
        if not self.velocity and not wanted:
            self.moving = self._stopping = False

    def _sample_smooth(self, smoothing: Smoothing, limit: int, acceleration: int) -> None:
        step, self._speed = point_to_point(self._destination - self._ahead, self._speed, limit, acceleration)
        self._ahead += step
        self.position = smoothing.put(self._ahead)
        self.moving = self.position != self._destination or self._speed != 0
        if not self.moving:
            self._smoothing = None
            self.velocity = 0
