"""How fast the generated code is, as ratios taken in one run beside other ways to do the same."""

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
