"""Import time of a generated module over a bare interpreter."""

from __future__ import annotations

import importlib.util
import shutil
import sys
import tempfile
from pathlib import Path

from benchmarks import ROOT
from benchmarks.processes import Run, interleave
from benchmarks.report import Goal, Section

CODECS = "qlinkgen.codecs"
BARE = "bare interpreter"
LIMITS_MS = {"qlink": 10.0, "trio": 10.0, "mc1231a": 30.0}
GOALS = ("qlink", "mc1231a")
OTHERS = ("dataclasses", "enum", "construct", "serial", "pymavlink.mavutil", "cantools")

INTRO = """\
A new interpreter for each import, in turns with one that imports nothing (`python -I -S`, bytecode
cached); the cost of an import is the difference of the two. The goals apply to the best wall clock. The
others are for comparison."""


def _command(module: str, path: str = "") -> list[str]:
    """`-S` leaves site-packages out, so the folders of a peer are added to the path."""
    setup = f"import sys; sys.path[:0] = {[path] if path else _site()!r}; " if module else ""
    return [sys.executable, "-I", "-S", "-c", f"{setup}import {module}" if module else ""]


def _site() -> list[str]:
    return [entry for entry in sys.path if entry.endswith("-packages")]


def section(rounds: int) -> Section:
    """Imports of nothing, of generated modules and of known ones, interleaved."""
    result = Section(
        "Import time over a bare interpreter", INTRO, ["", "wall, best", "wall, median", "CPU, median"]
    )
    others = [name for name in OTHERS if importlib.util.find_spec(name.partition(".")[0])]
    result.missing = [f"{name} (not installed)" for name in OTHERS if name not in others]
    with tempfile.TemporaryDirectory() as folder:  # a copy: the bytecode is written there
        shutil.copytree(ROOT / "qlinkgen" / "codecs", Path(folder, "qlinkgen", "codecs"))
        shutil.copy(ROOT / "qlinkgen" / "__init__.py", Path(folder, "qlinkgen"))
        commands = {BARE: _command("")}
        commands |= {f"{CODECS}.{name}": _command(f"{CODECS}.{name}", folder) for name in LIMITS_MS}
        commands |= {name: _command(name) for name in others}
        runs = interleave(commands, rounds)
    result.rows = [_row(name, runs) for name in commands]
    result.goals = [_goal(name, runs) for name in GOALS]
    return result


def _row(name: str, runs: dict[str, Run]) -> list[str]:
    run, bare = runs[name], runs[BARE]
    if name == BARE:
        return [name, *(f"({seconds * 1e3:.1f} ms)" for seconds in _figures(run))]
    costs = (mine - its for mine, its in zip(_figures(run), _figures(bare), strict=True))
    return [name, *(f"{seconds * 1e3:.1f} ms" for seconds in costs)]


def _figures(run: Run) -> tuple[float, float, float]:
    return run.wall.best, run.wall.median, run.cpu.median


def _goal(name: str, runs: dict[str, Run]) -> Goal:
    cost = runs[f"{CODECS}.{name}"].wall.best - runs[BARE].wall.best
    return Goal(f"import of {name}", cost * 1e3, LIMITS_MS[name], "ms over bare")
