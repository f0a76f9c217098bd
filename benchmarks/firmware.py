"""Cost of the C headers on small chips: `python -m benchmarks.firmware [--write] [--check]`.

Builds programs for a Cortex-M0 and an AVR with and without a part of a header, runs some of them in simavr,
and builds the whole slave of examples/firmware; also MAVLink and nanopb if they are installed. `--write`
writes the tables to docs/firmware.md, `--check` exits 1 if a figure is more than 10 % above its budget, or an
answer of the slave is late.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def main(arguments: list[str] | None = None) -> int:
    """Measure, print, write, check; 1 if the budget is exceeded, 2 if a tool is missing."""
    options = _options(arguments)
    # Without installation this package, the compiler and the generated code are found from here.
    sys.path.insert(0, str(ROOT))
    run = importlib.import_module("benchmarks.firmware_run")
    status: int = run.main(write=options.write, check=options.check)
    return status


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Measure the cost of the C headers on small chips.")
    parser.add_argument("--write", action="store_true", help="write the tables into docs/firmware.md")
    parser.add_argument("--check", action="store_true", help="exit 1 if the budget is exceeded")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
