"""Timing on a shared machine: short slices, interleaved, and the best of many.

Noise only adds time, so the smallest time of many short slices is closest to that of the code. All cases take
turns within a round, so that a slow period of the machine affects all of them, and ratios stay valid.
"""

from __future__ import annotations

import gc
import statistics
import timeit
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

SLICE_SECONDS = 0.0004


@dataclass(frozen=True)
class Case:
    """One statement to time; each run of it does `per` operations."""

    name: str
    statement: str
    names: Mapping[str, object]
    per: float = 1


@dataclass
class Timing:
    """Seconds for one operation, one entry per round."""

    rounds: list[float] = field(default_factory=list)

    @property
    def best(self) -> float:
        """The smallest: the time of the undisturbed code."""
        return min(self.rounds)

    @property
    def median(self) -> float:
        """The median of all rounds."""
        return statistics.median(self.rounds)

    def over(self, base: Timing) -> float:
        """The ratio to the base: best over best."""
        return self.best / base.best

    def spread_over(self, base: Timing) -> tuple[float, float]:
        """The middle half of the ratios of each round."""
        ratios = [mine / its for mine, its in zip(self.rounds, base.rounds, strict=True)]
        low, _, high = statistics.quantiles(ratios, n=4)
        return low, high


def measure(cases: Sequence[Case], rounds: int) -> dict[str, Timing]:
    """Time every case once a round; errors of a statement are raised by the first, untimed call."""
    timers = [(case, timeit.Timer(case.statement, globals=dict(case.names))) for case in cases]
    numbers = [_number(timer) for _, timer in timers]
    timings = {case.name: Timing() for case in cases}
    gc.collect()  # timeit disables the collector while it times
    for _ in range(rounds):
        for (case, timer), number in zip(timers, numbers, strict=True):
            timer.timeit(1 + number // 8)  # warms the caches up
            seconds = timer.timeit(number) / number / case.per
            timings[case.name].rounds.append(seconds)
    return timings


def _number(timer: timeit.Timer) -> int:
    """Number of runs of the statement in one slice."""
    timer.timeit(1)
    once = min(timer.timeit(3) / 3 for _ in range(5))
    return max(1, round(SLICE_SECONDS / once))
