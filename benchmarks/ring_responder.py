"""A node of a ring in a process of its own, at the pty that is its standard input.

Started as `python -m benchmarks.ring_responder KIND`: `raw` sends every byte on as it is, by two system
calls; `node` is a Motion Coordinator whose program sleeps.
"""

from __future__ import annotations

import os
import sys
import time

from qlinkgen.protocols.trio import MotionCoordinator


def raw(descriptor: int) -> None:
    """The least that a node in Python could do."""
    while data := os.read(descriptor, 512):
        os.write(descriptor, data)


def node(name: str) -> None:
    """Send on in the node's thread, while this one does nothing."""
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
