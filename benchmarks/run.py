"""Measure the generated code beside its peers: `python benchmarks/run.py [--quick] [--write] [--only NAME]`.

The peers that are installed are measured; those that are not are named. Every figure that matters is a ratio
to the raw `struct` module, or to hand-written C, taken in the same run: it means the same on another machine.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def main() -> int:
    # Works in a bare checkout too: this package, the compiler and the generated code are found from here.
    sys.path.insert(0, str(ROOT))
    status: int = importlib.import_module("benchmarks.suite").main()
    return status


if __name__ == "__main__":
    sys.exit(main())
