"""A ring for the behaviours: blocking or asyncio, on a virtual clock, in memory or over ptys.

A behaviour is written once, as a program that uses the clients of several nodes in turn.
"""

from __future__ import annotations

import asyncio
import contextlib
import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, cast

from qlinkgen.protocols.trio import (
    AsyncMembraneKeypad,
    AsyncMotionCoordinator,
    MembraneKeypad,
    MotionCoordinator,
)
from qlinkgen.sim.port_ring import PortRing
from qlinkgen.sim.virtual_ring import VirtualRing
from qlinkgen.transport import Port, memory_ring, open_port
from tests.support.needs import decided_by_parameter

#: Time limit in seconds of waits that must not fail, also on a busy machine.
PATIENCE = 20.0
CLIENTS: dict[str, dict[str, Any]] = {
    "blocking": {"coordinator": MotionCoordinator, "keypad": MembraneKeypad},
    "asyncio": {"coordinator": AsyncMotionCoordinator, "keypad": AsyncMembraneKeypad},
}


@dataclass(frozen=True)
class Setting:
    """A setting of the behaviours."""

    client: Literal["blocking", "asyncio"]
    transport: Literal["virtual", "memory", "pty"]

    @property
    def name(self) -> str:
        return f"{self.client}-{self.transport}"

    @property
    def needs(self) -> frozenset[str]:
        """Markers of a test in this setting."""
        return frozenset({"pty"} if self.transport == "pty" else ())


SETTINGS = [
    Setting(client, transport)
    for client in ("blocking", "asyncio")
    for transport in ("virtual", "memory", "pty")
]  # fmt: skip


class AsBlocking:
    """Makes a client for asyncio look like a blocking one."""

    def __init__(self, target: Any, loop: asyncio.AbstractEventLoop) -> None:
        object.__setattr__(self, "_target", target)
        object.__setattr__(self, "_loop", loop)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._target, name)
        if not inspect.ismethod(value):
            return value

        def call(*args: Any, **kwargs: Any) -> Any:
            result = value(*args, **kwargs)
            return self._loop.run_until_complete(result) if inspect.iscoroutine(result) else result

        return call

    def __str__(self) -> str:
        return str(self._target)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._target, name, value)


class Rig:
    """The nodes of a ring, each with its client."""

    def __init__(self, setting: Setting, clients: list[Any]) -> None:
        self.setting = setting
        self.clients = clients

    def coordinator(self, place: int = 0) -> MotionCoordinator:
        return cast(MotionCoordinator, self.clients[place])

    def keypad(self, place: int) -> MembraneKeypad:
        return cast(MembraneKeypad, self.clients[place])

    def until(self, condition: Callable[[], object]) -> None:
        """Let time pass until a condition holds on any node."""
        for _ in range(int(PATIENCE / 0.002)):
            if condition():
                return
            self.clients[0].sleep(0.002)
        raise AssertionError("it never got so")

    def rest(self) -> None:
        """Let all messages in transit arrive, without a condition to wait for."""
        self.clients[0].sleep(0.05)


@decided_by_parameter
@contextlib.contextmanager
def make_rig(setting: Setting, ring: str, **options: Any) -> Iterator[Rig]:
    """Make a ring of these nodes and a client for each."""
    kinds = ring.split(",")
    with contextlib.ExitStack() as stack:
        loop = stack.enter_context(asyncio.Runner()).get_loop() if setting.client == "asyncio" else None
        if setting.transport == "virtual":
            simulated = VirtualRing(ring, **options)
            prefix = "async_" if loop else ""
            clients = [getattr(simulated, prefix + kind)(at) for at, kind in enumerate(kinds)]
        else:
            ports = _ports(stack, setting, len(kinds))
            clients = [
                _client(setting, kind, port, loop, options) for kind, port in zip(kinds, ports, strict=True)
            ]
        shown = [AsBlocking(client, loop) if loop else client for client in clients]
        for client in shown:
            stack.callback(client.close)
        yield Rig(setting, shown)


def _ports(stack: contextlib.ExitStack, setting: Setting, count: int) -> list[Port]:
    if setting.transport == "memory":
        return list(memory_ring(count))
    ring = stack.enter_context(PortRing(["port"] * count))
    return [open_port(path) for path in ring.paths]


def _client(
    setting: Setting, kind: str, port: Port, loop: asyncio.AbstractEventLoop | None, options: dict[str, Any]
) -> Any:
    make = CLIENTS[setting.client][kind]
    if loop is None:
        return make(port, **options)

    async def made() -> Any:
        return make(port, **options)

    return loop.run_until_complete(made())
