"""The generated C header and hand-written C, compiled here and timed in one process."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

from benchmarks.measure import Timing
from benchmarks.report import Goal, Section, number

HERE = Path(__file__).resolve().parent
GENERATED = HERE.parent / "generated" / "c"
FLAGS = ("-O2", "-std=c99")
COMPILERS = ("gcc", "clang")
WORK = {
    "encode": "struct to wire bytes",
    "decode": "wire bytes to struct",
    "receive": "byte at a time, to struct",
}
LIMIT = 1.2

INTRO = """\
motion.response with a CRC table of 256 entries on both sides, `-O2`, each frame one call that the
compiler does not inline. `benchmarks/c/hand.h` is written by hand for this message only; the generated
header has all of them."""


def section(rounds: int) -> Section:
    """Each installed compiler; the goals apply to gcc."""
    result = Section("C, generated header over hand-written", INTRO, ["", "ratio", "generated", "by hand"])
    for compiler in COMPILERS:
        if shutil.which(compiler) is None:
            result.missing.append(f"C by {compiler} (apt install {compiler})")
            continue
        timings = _run(compiler, rounds)
        result.rows += [_row(compiler, work, timings) for work in WORK]
        if compiler == "gcc":
            result.goals = [_goal(work, timings) for work in ("encode", "decode")]
    return result


def _run(compiler: str, rounds: int) -> dict[str, Timing]:
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder, "bench")
        source = HERE / "c" / "bench.c"
        build = [compiler, *FLAGS, f"-I{GENERATED}", f"-I{source.parent}", str(source), "-o", str(program)]
        subprocess.run(build, check=True)
        done = subprocess.run([str(program), str(rounds)], check=True, capture_output=True, text=True)
    names, *lines = (line.split("\t") for line in done.stdout.splitlines())
    columns = zip(*lines, strict=True)
    return {
        name: Timing([float(cell) * 1e-9 for cell in column])
        for name, column in zip(names, columns, strict=True)
    }


def _row(compiler: str, work: str, timings: dict[str, Timing]) -> list[str]:
    own, hand = timings[f"generated {work}"], timings[f"hand {work}"]
    times = [f"{timing.best * 1e9:.0f} ns" for timing in (own, hand)]
    return [f"{compiler}: {WORK[work]}", number(own.over(hand)), *times]


def _goal(work: str, timings: dict[str, Timing]) -> Goal:
    ratio = timings[f"generated {work}"].over(timings[f"hand {work}"])
    return Goal(f"C {work} of a frame, gcc -O2", ratio, LIMIT, "x hand-written")
