"""All measurements, one after the other; text for the terminal, and the page for docs/."""

from __future__ import annotations

import argparse
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks import (
    c_codec,
    generator,
    host,
    imports,
    library,
    python_codec,
    ring,
    starting,
    stream,
    wire,
)
from benchmarks.report import Section, page, section_text

PAGE = Path(__file__).resolve().parent.parent / "docs" / "benchmarks.md"

# Name: the measurement, its rounds, and its rounds with --quick.
SECTIONS: dict[str, tuple[Callable[[int], Section], int, int]] = {
    "python": (python_codec.section, 2000, 60),
    "stream": (stream.section, 1500, 60),
    "library": (library.section, 600, 30),
    "c": (c_codec.section, 1000, 50),
    "imports": (imports.section, 41, 7),
    "starting": (starting.section, 15, 2),
    "generator": (generator.section, 4, 1),
    "wire": (wire.section, 200, 20),
    "ring": (ring.section, 200, 20),
    "host": (host.section, 200, 20),
}

INTRO = """\
# Benchmarks

Written by `python benchmarks/run.py --write`; `make bench` shows the figures of your own machine.
Comparisons are ratios taken in one process, all candidates in turns, the best of {rounds} short slices
each: ratios are comparable between machines, times are not. Differences under 10 % are not significant.
Measured with {machine}, on a shared machine with two cores."""


def machine() -> str:
    """Interpreter, compiler and processor, as they affect ratios."""
    python = f"{platform.python_implementation()} {platform.python_version()}"
    gcc = subprocess.run(
        ["gcc", "-dumpfullversion"], capture_output=True, text=True, check=False
    ).stdout.strip()
    return f"{python}, gcc {gcc or 'absent'}, {platform.machine()}"


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Measure the generated code and its peers.")
    parser.add_argument(
        "--quick", action="store_true", help="few rounds: rough figures in less than a minute"
    )
    parser.add_argument("--write", action="store_true", help=f"write the tables to docs/{PAGE.name}")
    parser.add_argument(
        "--only", choices=SECTIONS, action="append", help="measure only this; may be repeated"
    )
    return parser.parse_args()


def main() -> int:
    """Run the chosen measurements; goals not met are reported, but do not fail."""
    options = arguments()
    if options.write and (options.quick or options.only):
        print("run.py: --write needs the full run: leave out --quick and --only", file=sys.stderr)
        return 2
    sections = [_measure(name, options.quick) for name in options.only or SECTIONS]
    if options.write:
        PAGE.write_text(page(INTRO.format(rounds=SECTIONS["python"][1], machine=machine()), sections))
        print(f"written: docs/{PAGE.name}")
    return 0


def _measure(name: str, quick: bool) -> Section:
    run, rounds, few = SECTIONS[name]
    start = time.monotonic()
    print(f"measuring: {name} ...", file=sys.stderr, flush=True)
    section = run(few if quick else rounds)
    print(section_text(section), flush=True)
    print(f"{name}: {time.monotonic() - start:.0f} s", file=sys.stderr, flush=True)
    return section
