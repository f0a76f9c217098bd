"""Profiles of a simulated axis, sample by sample, with changes during the motion and exact arrival.

Positions, velocities and accelerations are integers in 1/2^32 counts, so nothing is rounded.
"""

from __future__ import annotations

from collections import deque
from math import isqrt
from typing import Final

#: Bit position of whole counts.
COUNTS: Final = 32
TRAPEZOIDAL: Final = 0
VELOCITY: Final = 1
S_CURVE: Final = 2
GEAR: Final = 3
#: Largest number of samples of a ramp of the acceleration; a jerk near 0 would take hours.
LONGEST_RAMP: Final = 1 << 14


def way_to_stop(velocity: int, acceleration: int) -> int:
    """Return the stopping distance of an axis that loses `acceleration` in each sample; both 0 or more."""
    if not acceleration:
        return 0
    samples = velocity // acceleration
    return samples * velocity - acceleration * samples * (samples + 1) // 2


def point_to_point(distance: int, velocity: int, limit: int, acceleration: int) -> tuple[int, int]:
    """Compute one sample of a motion to a destination.

    Args:
        distance: signed distance to the destination.
        velocity: signed velocity of the previous sample.
        limit: largest velocity, 0 or more.
        acceleration: largest change of velocity in a sample, 0 or more.

    Returns:
        The movement in this sample, and the new velocity. On arrival these are the whole distance and 0.
    """
    if velocity < 0 or (velocity == 0 and distance < 0):
        step, new = point_to_point(-distance, -velocity, limit, acceleration)
        return -step, -new
    slowest = max(velocity - acceleration, 0)
    if distance < 0:  # moving away: stop first
        return slowest, slowest
    fastest = max(min(velocity + acceleration, limit), min(slowest, velocity))
    # Velocities m * a, ..., 2a, a cover a * m * (m + 1) / 2; with more it could not stop in time.
    still_stops = (isqrt(acceleration * (acceleration + 8 * distance)) - acceleration) // 2
    new = max(min(fastest, max(still_stops, 1)), slowest)
    if new >= distance and slowest <= acceleration:
        return distance, 0
    return new, new


class Smoothing:
    """Converts a trapezoidal profile to an S-curve: each position is the mean of the last ones.

    The mean over as many samples as the ramp of the acceleration has exactly that jerk, and ends at the
    position of the trapezoidal profile.
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
    """The target position of an axis over time.

    Attributes:
        mode: TRAPEZOIDAL, VELOCITY, S_CURVE or GEAR.
        position: target position.
        velocity: movement in the last sample.
        moving: the motion has not ended.
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
        """Start a motion; `ramp` is the number of samples of an S-curve's acceleration ramp."""
        self._destination = destination
        self._stopping = False
        if self.mode == S_CURVE and not (self.moving and self._smoothing):
            self._smoothing = Smoothing(self.position, min(max(ramp, 1), LONGEST_RAMP))
            self._ahead, self._speed = self.position, 0
        elif not self.moving:
            self._smoothing = None
        self.moving = True

    def run_free(self) -> None:
        """Start following only the acceleration, as in velocity mode."""
        self._smoothing = None
        self._stopping = False
        self.moving = True

    def halt(self) -> None:
        """Stop immediately."""
        self.velocity = self._speed = 0
        self.moving = self._stopping = False
        self._smoothing = None

    def slow_down(self, acceleration: int) -> None:
        """Start decelerating to a stop."""
        if not self.moving or self.mode == GEAR:
            return
        here, speed = (self._ahead, self._speed) if self._smoothing else (self.position, self.velocity)
        way = way_to_stop(abs(speed), acceleration)
        self._destination = here + (way if speed >= 0 else -way)
        self._stopping = True

    def shift(self, counts: int) -> None:
        """Redefine the current position, for an axis at rest or in velocity mode."""
        self.position += counts
        self._ahead += counts
        if self._smoothing:
            self._smoothing = Smoothing(self.position, 1)

    def sample(self, limit: int, acceleration: int) -> None:
        """Advance by one sample; a negative acceleration moves backwards in velocity mode."""
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
