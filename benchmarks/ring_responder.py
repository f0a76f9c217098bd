"""A node of a ring in its own process, at the pty on its standard input.

Started as `python -m benchmarks.ring_responder KIND`: `raw` forwards every byte unchanged, by two system
calls; `node` is a Motion Coordinator whose program sleeps.
"""

from __future__ import annotations

import os
import sys
import time

from qlinkgen.protocols.trio import MotionCoordinator


def raw(descriptor: int) -> None:
    """The minimum for a node in Python."""
    while data := os.read(descriptor, 512):
        os.write(descriptor, data)


def node(name: str) -> None:
    """Forward in the node's thread, while this one does nothing."""
    with MotionCoordinator.open(name):
        while True:
            time.sleep(60)


def main() -> None:
    if sys.argv[1] == "raw":
        raw(0)
    else:
        node(os.ttyname(0))


if __name__ == "__main__":
    main()
