"""Objects with locks in a process that forks.

A lock that another thread holds during a fork stays held in the child for ever, because that thread does not
exist there. Such objects are told in the child, before anything else runs, and make new locks.
"""

from __future__ import annotations

import os
from typing import Protocol
from weakref import WeakSet


class Forkable(Protocol):
    """An object that has to know that it is in a forked child."""

    def after_fork(self) -> None:
        """Forget the other threads. Called in the child, by its only thread."""


_alive: WeakSet[Forkable] = WeakSet()


def tell_of_forks(each: Forkable) -> None:
    """Call the object's `after_fork` in every child forked while the object lives."""
    _alive.add(each)


def _in_child() -> None:
    for each in list(_alive):
        each.after_fork()


if hasattr(os, "register_at_fork"):  # Windows does not fork
    os.register_at_fork(after_in_child=_in_child)
