"""Runs the tests against mutants, in copies of the tree."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.mutants.drawing import Mutant

_PYTEST = ("-m", "pytest", "-qx", "--tb=no", "--assert=plain", "-p", "no:cacheprovider")
#: Arguments of Python by the name of the stage, cheapest first.
STAGES: Mapping[str, Sequence[str]] = {
    "generate": ("-m", "qlinkgen", "generate", "--check"),
    "plan": (*_PYTEST, "tests/plan", "tests/model", "tests/test_checksum.py", "tests/test_spelling.py"),
    "receiver": (*_PYTEST, "tests/python/test_receiver.py"),
    "whole": (
        *("-m", "tests.whole", "--seeds", "1..44", "--names", "mixed"),
        *("--uncompiled", "--jobs", "1", "--stop"),
    ),
    "schema": (
        *(*_PYTEST, "tests/cli/test_show.py", "tests/python/test_any_value.py"),
        *(f"tests/schema/test_{name}.py" for name in ("broken", "cascades", "echoes", "numbers", "shipped")),
    ),
}
#: A stage may take so many times what it took without a mutant, and so many seconds more.
_TIMES, _MORE = 5, 20
#: Kilobytes of memory that a stage may have, as an endless loop may also grow.
_MEMORY = 6_000_000


@dataclass(frozen=True)
class Stage:
    """One of the stages, and the seconds after which it counts as an endless loop."""

    name: str
    arguments: Sequence[str]
    limit: float


@dataclass(frozen=True)
class Result:
    """The stage that killed a mutant, None where all passed; ``late`` where it was stopped."""

    id: str
    stage: str | None
    late: bool
    seconds: float


class NotFit(Exception):
    """A stage fails without a mutant, or passes although the package cannot be imported."""


def copied(root: Path, folder: Path) -> Path:
    """Copy what git keeps or would keep of a tree, so that the user's files are never changed."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=root,
        check=True,
        capture_output=True,
        text=True,
    )
    for name in listed.stdout.rstrip("\0").split("\0"):
        if (root / name).is_symlink() or (root / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, folder / name, follow_symlinks=False)
    # Python compares such bytecode with the hash of its source, so it is never used for a mutant.
    words = ["-m", "compileall", "-q", "--invalidation-mode", "checked-hash", "."]
    subprocess.run([sys.executable, *words], cwd=folder, check=True)
    return folder


def fit(folder: Path, stages: Mapping[str, Sequence[str]] = STAGES) -> list[Stage]:
    """The stages with their limits, after each has passed in a copy, and failed with a broken import."""
    made = []
    for name, arguments in stages.items():
        begun = time.monotonic()
        check(folder, [Stage(name, arguments, limit=3600)])
        made.append(Stage(name, arguments, _MORE + _TIMES * (time.monotonic() - begun)))
    with _changed(folder / "qlinkgen/plan/__init__.py", "raise ImportError\n"):
        for stage in made:
            if _passes(folder, stage):
                raise NotFit(f"{stage.name} does not import qlinkgen of its folder")
    return made


def check(folder: Path, stages: Sequence[Stage]) -> None:
    """Raise NotFit where a stage fails without a mutant; after a run, its kills may have another cause."""
    for stage in stages:
        if not _passes(folder, stage):
            raise NotFit(f"{stage.name} fails without a mutant; run it: python {' '.join(stage.arguments)}")


def judged(folder: Path, stages: Sequence[Stage], mutant: Mutant) -> Result:
    """Try the stages on a mutant until one fails."""
    begun = time.monotonic()
    with _changed(folder / mutant.module, mutant.text):
        for stage in stages:
            try:
                if _passes(folder, stage):
                    continue
                late = False
            except subprocess.TimeoutExpired:
                late = True
            return Result(mutant.place.id, stage.name, late, round(time.monotonic() - begun, 1))
    return Result(mutant.place.id, None, False, round(time.monotonic() - begun, 1))


@contextlib.contextmanager
def _changed(path: Path, text: str) -> Iterator[None]:
    before = path.read_text("utf-8")
    path.write_text(text, "utf-8")
    try:
        yield
    finally:
        path.write_text(before, "utf-8")


def _passes(folder: Path, stage: Stage) -> bool:
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith(("PYTEST", "QLINKGEN"))},
        # Precedes the folder that an editable install adds to the path.
        "PYTHONPATH": str(folder),
        "PYTHONDONTWRITEBYTECODE": "1",
        "HYPOTHESIS_PROFILE": "mutants",
        "QLINKGEN_SCHEMAS": "0",
    }
    limited = ["sh", "-c", f'ulimit -v {_MEMORY}; exec "$@"', "sh", sys.executable, *stage.arguments]
    with subprocess.Popen(
        limited,
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as process:
        try:
            return process.wait(stage.limit) == 0
        finally:
            # Also what it started; after a normal end the group is empty.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
