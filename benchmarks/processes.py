"""Whole processes, timed from outside: wall clock, and CPU time by the system's accounting."""

from __future__ import annotations

import resource
import subprocess
import time
from collections.abc import Mapping, Sequence

from benchmarks.measure import Timing


class Run:
    """One command, run repeatedly."""

    def __init__(self) -> None:
        self.wall = Timing()
        self.cpu = Timing()

    def add(
        self, command: Sequence[str], environment: Mapping[str, str] | None = None, given: str | None = None
    ) -> None:
        """Run it once more on the input `given`, without its output; a failure raises RuntimeError."""
        before = _cpu()
        start = time.perf_counter()
        done = subprocess.run(
            command, capture_output=True, text=True, env=environment, input=given, check=False
        )
        self.wall.rounds.append(time.perf_counter() - start)
        self.cpu.rounds.append(_cpu() - before)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()}")


def _cpu() -> float:
    """Seconds of CPU time of all child processes so far; os.times() counts only ticks of 10 ms."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def interleave(
    commands: Mapping[str, Sequence[str]],
    rounds: int,
    environment: Mapping[str, str] | None = None,
    warm: bool = True,
    given: str | None = None,
) -> dict[str, Run]:
    """Run all commands in turns; the first turn warms caches up and is not counted."""
    for command in commands.values() if warm else ():
        Run().add(command, environment, given)
    runs = {name: Run() for name in commands}
    for _ in range(rounds):
        for name, command in commands.items():
            runs[name].add(command, environment, given)
    return runs
