"""Speed of the generated code, as ratios to other implementations, all taken in one run."""

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
