"""The pytest plugin: the fixture `bus_pair` joins a master of a generated bus module with slaves."""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, TypeVar, overload

import pytest

if TYPE_CHECKING:  # pytest imports this module in every run
    from qlinkgen.bus import aio, blocking, ring, ring_aio
    from qlinkgen.bus.ring_status import RingHandlers
    from qlinkgen.link.slave import Node
    from qlinkgen.sim.joining import Joined
    from qlinkgen.sim.joining_rings import JoinedRing

    G = TypeVar("G", bound=ring.Ring | ring_aio.AsyncRing)
    M = TypeVar("M", bound=blocking.Calls | aio.AsyncCalls)

#: Classes of a bus module that ask; a schema has one of them.
_ASKERS = ("Bus", "Device", "Peer", "Ring")


class BusPairs:
    """Makes pairs, which are closed after the test."""

    def __init__(self, stack: contextlib.ExitStack) -> None:
        self._stack = stack

    @overload
    def __call__(self, master: type[M], *handlers: Node, **options: Any) -> Joined[M]: ...

    @overload
    def __call__(self, master: type[G], *handlers: RingHandlers, **options: Any) -> JoinedRing[G]: ...

    @overload
    def __call__(self, master: str, *handlers: Any, **options: Any) -> Any: ...

    def __call__(self, master: Any, *handlers: Any, asynchronous: bool = False, **options: Any) -> Any:
        """Join a master with slaves; see `qlinkgen.sim.joining.join` for the arguments.

        Of a ring, join a node with others; see `qlinkgen.sim.joining_rings.join_ring`.

        Args:
            master: a class such as `oven_bus.Bus`, or the module of a protocol, such as "my.wire.oven".
            handlers: the slaves.
            asynchronous: take the class for asyncio, if `master` is a module.
            options: `transport`, `faults`, `turnaround` and options of the class.
        """
        if isinstance(master, str):
            master = _class_of(master, "Async" if asynchronous else "")
        from qlinkgen.bus import ring, ring_aio  # noqa: PLC0415

        if issubclass(master, ring.Ring | ring_aio.AsyncRing):
            from qlinkgen.sim.joining_rings import join_ring  # noqa: PLC0415

            return self._stack.enter_context(join_ring(master, *handlers, **options))
        from qlinkgen.sim.joining import join  # noqa: PLC0415

        return self._stack.enter_context(join(master, *handlers, **options))


def _class_of(name: str, prefix: str) -> Any:
    """The class of a protocol that asks."""
    module = importlib.import_module(f"{name}_bus")
    for each in _ASKERS:
        if hasattr(module, prefix + each):
            return getattr(module, prefix + each)
    wanted = " or ".join(prefix + each for each in _ASKERS)
    raise ValueError(f"{name}_bus has no {wanted}; pass the class that asks, such as {name}_bus.Host")


@pytest.fixture
def bus_pair() -> Iterator[BusPairs]:
    """Join a master with slaves: `bus_pair("my.wire.oven", Oven(3)).master.node(3).get_zones()`."""
    with contextlib.ExitStack() as stack:
        yield BusPairs(stack)
