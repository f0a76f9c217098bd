"""Measure the generated code and its peers: `python benchmarks/run.py [--quick] [--write] [--only NAME]`.

Installed peers are measured; the others are listed. Every important figure is a ratio to the raw `struct`
module, or to hand-written C, taken in the same run, so it is comparable between machines.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def main() -> int:
    # Without installation this package, the compiler and the generated code are found from here.
    sys.path.insert(0, str(ROOT))
    status: int = importlib.import_module("benchmarks.suite").main()
    return status


if __name__ == "__main__":
    sys.exit(main())
