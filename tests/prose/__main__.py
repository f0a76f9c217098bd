"""Check the prose of the project; exit code 1 if there is something to reword."""

from __future__ import annotations

import sys

from tests.prose import hits, texts


def main() -> int:
    """Print each phrase of the list with its replacement."""
    found = [hit for path, text in texts() for hit in hits(path, text)]
    print(*found, sep="\n", end="\n" if found else "")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
