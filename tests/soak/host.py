"""Soak the MC1231A host: `python -m tests.soak.host [--commands N] [--faults PLAN] [--seed N]`.

A random session over a line with faults of every kind, against a plain model of the registers: host and chip
set must agree at the end, and no call may have sent an action twice. Once with a chip set that waits for the
rest of a packet for ever, and once with one that drops it after a silence.
"""

from __future__ import annotations

import argparse
import sys
import time

from qlinkgen.sim import FaultPlan
from tests.soak.host_run import Result, Session

#: Seconds of silence after which the second chip set drops an incomplete packet.
FORGETS = 0.005


def main(arguments: list[str] | None = None) -> int:
    """Run both sessions; 1 if a result is wrong."""
    options = _options(arguments)
    complaints = []
    for title, forgets in (("chip set that never forgets", 0.0), ("chip set that forgets", FORGETS)):
        began = time.monotonic()
        faults = FaultPlan.parse(f"{options.faults},seed={options.seed}")
        result = Session(faults, seed=options.seed, forgets=forgets).run(options.commands)
        print(as_text(title, result, time.monotonic() - began), flush=True)
        complaints += [f"{title}: {complaint}" for complaint in result.complaints]
    for complaint in complaints:
        print(f"soak.host: {complaint}", file=sys.stderr)
    return 1 if complaints else 0


def as_text(title: str, result: Result, seconds: float) -> str:
    """The account of one session."""
    count = result.counters
    facts = {
        "packets": count["requests"],
        "faults": result.faults,
        "out of step": count["out_of_step"],
        "in step again": count["in_step"],
        "filling bytes": count["fills"],
        "packets filled up": count["completed"],
        "repeats": count["repeats"],
        "calls that failed": result.failed,
        "most times that one call sent an action": result.most_sent,
        "packets carried out and never sent": result.made_up,
        "of these not noticed": result.unnoticed,
        "wrong values with a correct checksum": result.wrong_reads,
        "registers written again": result.rewritten,
    }
    lines = [f"{title}: {result.commands} commands in {seconds:.0f} s ({result.seconds:.0f} s on the line)"]
    lines += [f"  {number:8} {what}" for what, number in facts.items()]
    return "\n".join([*lines, f"  {'; '.join(result.complaints[:3]) or 'host and chip set agree'}"])


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Soak the MC1231A host on a simulated line with faults.")
    parser.add_argument("--commands", type=int, default=100_000, help="of each session")
    parser.add_argument("--faults", default="all=0.02", help="plan of faults, as for `qlinkgen simulate`")
    parser.add_argument("--seed", type=int, default=1, help="of all random numbers")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
