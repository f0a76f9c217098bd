"""One run of the firmware measurements: print the tables, write them, check the budget."""

from __future__ import annotations

import sys
from pathlib import Path

from benchmarks import firmware_peers
from benchmarks.firmware_budget import complaints
from benchmarks.firmware_build import TARGETS, ToolMissing, Workshop, temporary
from benchmarks.firmware_measure import Measured, measure
from benchmarks.firmware_page import PAGE, peers, renewed, rewritten, tables, written


def main(*, write: bool, check: bool) -> int:
    """Measure everything; 1 if `check` finds the budget exceeded, 2 if a tool is missing."""
    try:
        measured = measure()
    except ToolMissing as missing:
        print(f"firmware: {missing}", file=sys.stderr)
        return 2
    library = written(PAGE.read_text("utf-8"))["library"]  # measured by benchmarks.firmware_library
    made = {**tables(measured), "peers": _peers(measured, write), "library": library}
    for name, table in made.items():
        print(f"{name}\n{'=' * len(name)}\n{table}\n")
    if write:
        PAGE.write_text(rewritten(PAGE.read_text("utf-8"), made), "utf-8")
        print(f"written: docs/{PAGE.name}")
    found = complaints(measured)
    for complaint in found:
        print(f"firmware: {complaint}", file=sys.stderr)
    return 1 if check and found else 0


def _peers(measured: Measured, write: bool) -> str:
    missing: list[str] = []
    with temporary() as folder:
        found = firmware_peers.measured(Workshop(Path(folder)), TARGETS, missing)
    if not (missing and write):
        return peers(measured, found, missing)
    for reason in missing:
        print(f"firmware: not measured: {reason}; the page keeps its table of peers", file=sys.stderr)
    return renewed(written(PAGE.read_text("utf-8"))["peers"], measured)
