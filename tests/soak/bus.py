"""Soak the Q.link master: `python -m tests.soak.bus [--transactions N] [--pty-transactions N] [--seed N]`.

A random mix of all commands goes to five simulated nodes over a line with faults of every kind, and a plain
model computes the expected state of each node and the expected answers. `--output PATH` writes the figures as
a page.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from tests.soak import bus_page as page
from tests.soak import bus_run as run


def main(arguments: list[str] | None = None) -> int:
    """Run both soaks; 1 if a result is wrong."""
    options = _options(arguments)
    results, seconds = [], []
    for soak, count in ((run.virtual, options.transactions), (run.pty, options.pty_transactions)):
        if count:
            began = time.monotonic()
            results.append(soak(count, options.seed))
            seconds.append(time.monotonic() - began)
            print(page.as_text(results[-1], seconds[-1]), flush=True)
    complaints = [complaint for result in results for complaint in result.complaints]
    if options.output and not complaints:
        Path(options.output).write_text(page.as_page(results, seconds, _command(options)), encoding="utf-8")
    for complaint in complaints:
        print(f"soak: {complaint}", file=sys.stderr)
    return 1 if complaints else 0


def _command(options: argparse.Namespace) -> str:
    return (
        f"python -m tests.soak.bus --transactions {options.transactions} "
        f"--pty-transactions {options.pty_transactions} --seed {options.seed} --output docs/soak.md"
    )


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Soak the Q.link master on a simulated bus with faults.")
    parser.add_argument("--transactions", type=int, default=1_000_000, help="on the virtual clock")
    parser.add_argument("--pty-transactions", type=int, default=50_000, help="in real time over a pty")
    parser.add_argument("--seed", type=int, default=1, help="of all random numbers")
    parser.add_argument("--output", help="write the figures to this file, if nothing is wrong")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
