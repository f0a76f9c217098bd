"""Timing for a machine that others use too: short slices, interleaved, and the best of many.

Noise only ever adds time, so the smallest time of many short slices is the one closest to the code's own. All
cases take turns within a round, so that a slow spell of the machine meets them all alike, and ratios keep
their meaning.
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
    """One statement to time; `per` operations happen each time it runs."""

    name: str
    statement: str
    names: Mapping[str, object]
    per: float = 1


@dataclass
class Timing:
    """Seconds for one operation, one entry a round."""

    rounds: list[float] = field(default_factory=list)

    @property
    def best(self) -> float:
        """The smallest: what the code needs when nobody disturbs it."""
        return min(self.rounds)

    @property
    def median(self) -> float:
        """What it needed in the middle of all rounds."""
        return statistics.median(self.rounds)

    def over(self, base: Timing) -> float:
        """How many times the base it takes: best over best."""
        return self.best / base.best

    def spread_over(self, base: Timing) -> tuple[float, float]:
        """The middle half of the ratios taken round by round."""
        ratios = [mine / its for mine, its in zip(self.rounds, base.rounds, strict=True)]
        low, _, high = statistics.quantiles(ratios, n=4)
        return low, high


def measure(cases: Sequence[Case], rounds: int) -> dict[str, Timing]:
    """Time every case once a round; the statement's own errors come out of the first, untimed call."""
    timers = [(case, timeit.Timer(case.statement, globals=dict(case.names))) for case in cases]
    numbers = [_number(timer) for _, timer in timers]
    timings = {case.name: Timing() for case in cases}
    gc.collect()  # while it times, timeit switches the collector off
    for _ in range(rounds):
        for (case, timer), number in zip(timers, numbers, strict=True):
            timer.timeit(1 + number // 8)  # brings its code back into the caches
            seconds = timer.timeit(number) / number / case.per
            timings[case.name].rounds.append(seconds)
    return timings


def _number(timer: timeit.Timer) -> int:
    """How often to run the statement for one slice."""
    timer.timeit(1)
    once = min(timer.timeit(3) / 3 for _ in range(5))
    return max(1, round(SLICE_SECONDS / once))
