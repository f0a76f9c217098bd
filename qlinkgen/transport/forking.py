"""Objects with locks in a process that forks.

A lock held by another thread during a fork stays locked in the child, because that thread does not exist
there. `after_fork` of such objects is called in the child before anything else, and makes new locks.
"""

from __future__ import annotations

import os
from typing import Protocol
from weakref import WeakSet


class Forkable(Protocol):
    """An object that must be notified in a forked child."""

    def after_fork(self) -> None:
        """Discard the state of other threads. Called in the child, by its only thread."""


_alive: WeakSet[Forkable] = WeakSet()


def tell_of_forks(each: Forkable) -> None:
    """Call the object's `after_fork` in every child forked while the object lives."""
    _alive.add(each)


def _in_child() -> None:
    for each in list(_alive):
        each.after_fork()


if hasattr(os, "register_at_fork"):  # Windows does not fork
    os.register_at_fork(after_in_child=_in_child)
