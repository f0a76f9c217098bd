"""A chip set to try behaviours on: blocking or asyncio, on a virtual clock, in memory or over a pty.

A behaviour is written once, for a `Rig`. It uses the host as a user would; the rig changes the signals
wired to the chip set, in the thread that runs the chip set.
"""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, cast

from qlinkgen.codecs.mc1231a import AxisStatus
from qlinkgen.protocols.mc1231a import AsyncAxis, AsyncHost, ChipEngine, ChipSet, Host
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.sim.chip_bus import chip_wire
from qlinkgen.sim.pty_bus import PtyBus
from qlinkgen.transport import Port
from tests.support.memory_line import MemoryLine
from tests.support.needs import decided_by_parameter
from tests.support.pty_line import PtyLine

BAUD = 115200
#: Seconds of host slack; in real time, which skips silence, longer than a thread waits on a busy machine.
SLACK = {"virtual": 0.002, "memory": 5.0, "pty": 5.0}
#: Seconds after which something that must happen has not happened.
PATIENCE = 20.0


@dataclass(frozen=True)
class Setting:
    """Where a behaviour is tried."""

    client: Literal["blocking", "asyncio"] = "blocking"
    transport: Literal["virtual", "memory", "pty"] = "virtual"

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
]


class Breaking(Port):
    """A port that records the written bytes, and can change them.

    Attributes:
        sent: what the host has written, piece by piece.
        outward: changes of the next pieces that are written, in their order; None for none.
        inward: changes of the next pieces that are read.
    """

    def __init__(self, port: Port) -> None:
        self._port = port
        self.name, self.baud, self.capabilities = port.name, port.baud, port.capabilities
        self.sent: list[bytes] = []
        self.outward: deque[Callable[[bytes], bytes] | None] = deque()
        self.inward: deque[Callable[[bytes], bytes] | None] = deque()

    def read(self, timeout: float) -> bytes:
        data = self._port.read(timeout)
        change = self.inward.popleft() if data and self.inward else None
        return change(data) if change else data

    def write(self, data: bytes) -> None:
        self.sent.append(data)
        change = self.outward.popleft() if self.outward else None
        changed = change(data) if change else data
        if changed:
            self._port.write(changed)

    def now(self) -> float:
        return self._port.now()

    def sleep(self, seconds: float) -> None:
        self._port.sleep(seconds)

    def fileno(self) -> int | None:
        return self._port.fileno()

    def close(self) -> None:
        self._port.close()


class AsBlocking:
    """Makes an AsyncHost look like a Host."""

    def __init__(self, target: Any, loop: asyncio.AbstractEventLoop) -> None:
        self._target = target
        self._loop = loop

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._target, name)
        return self._wrapped(value) if inspect.ismethod(value) else value

    def _wrapped(self, method: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            result = method(*args, **kwargs)
            if inspect.iscoroutine(result):
                return self._loop.run_until_complete(result)
            return AsBlocking(result, self._loop) if isinstance(result, AsyncAxis) else result

        return call


class Rig:
    """A host, its chip set, and the line between them."""

    def __init__(
        self, host: Host, port: Breaking, engine: ChipEngine, do: Callable[[Callable[[], Any]], Any]
    ) -> None:
        self.host = host
        self.port = port
        self.engine = engine
        self.chip = engine.chip
        self._do = do

    def wired(self, action: Callable[[ChipSet], Any]) -> Any:
        """Do something to the inputs of the chip set, or look at it, at this moment."""

        def act() -> Any:
            self.chip.advance(self.port.now())
            return action(self.chip)

        return self._do(act)

    @property
    def packets(self) -> list[str]:
        """Packets that were carried out, in hex."""
        assert self.engine.record is not None
        return [packet.hex() for packet in self.engine.record]

    def sleep(self, seconds: float) -> None:
        self.port.sleep(seconds)

    def until(self, axis: int, mask: int, *, value: int | None = None) -> int:
        """Ask for the status until some of its bits are as wanted, all set unless said otherwise."""
        wanted = mask if value is None else value
        end = self.port.now() + PATIENCE
        status = 0
        while self.port.now() < end:
            status = self.host.axis(axis).get_status().status
            if status & mask == wanted:
                return status
            self.sleep(0.002)
        raise AssertionError(f"status of axis {axis} stays 0x{status:04X}")

    def arrive(self, axis: int) -> int:
        return self.until(axis, AxisStatus.IN_MOTION, value=0)


def _by_line(line: PtyBus) -> Callable[[Callable[[], Any]], Any]:
    """How to do something in the thread that runs a line."""

    def do(action: Callable[[], Any]) -> Any:
        done: list[Any] = []
        ready = threading.Event()

        def act() -> None:
            done.append(action())
            ready.set()

        line.call(act)
        assert ready.wait(PATIENCE)
        return done[0]

    return do


@dataclass(frozen=True)
class _Place:
    """A port, how to do something in the thread of its line, and what makes an event loop."""

    port: Port
    do: Callable[[Callable[[], Any]], Any]
    loop_factory: Callable[[], asyncio.AbstractEventLoop] = asyncio.new_event_loop


@contextlib.contextmanager
def _line(setting: Setting, wire: Wire) -> Iterator[_Place]:
    if setting.transport == "virtual":
        yield _Place(VirtualPort(wire), lambda action: action())
    elif setting.transport == "pty":
        with PtyLine(wire) as line:
            yield _Place(line.port, _by_line(line.bus), line.loop_factory)
    else:
        with MemoryLine(wire, BAUD) as port:
            yield _Place(port, port.do)


@decided_by_parameter
@contextlib.contextmanager
def make_rig(
    setting: Setting, *, illegal: tuple[str, ...] = (), forgets: float = 0.0, **options: Any
) -> Iterator[Rig]:
    """A rig; options are those of the host."""
    engine = ChipEngine(ChipSet(illegal=illegal, geared=(1, 2)), forgets=forgets, record=True)
    wire = chip_wire(engine, baud=BAUD if setting.transport == "virtual" else None)
    options.setdefault("slack", SLACK[setting.transport])
    with contextlib.ExitStack() as stack:
        place = stack.enter_context(_line(setting, wire))
        port = Breaking(place.port)
        if setting.client == "blocking":
            host = stack.enter_context(Host(port, **options))
        else:
            loop = place.loop_factory()
            stack.callback(loop.close)
            client = AsyncHost(port, **options)
            stack.callback(client.close)
            host = cast(Host, AsBlocking(client, loop))
        yield Rig(host, port, engine, place.do)


def virtual(**options: Any) -> contextlib.AbstractContextManager[Rig]:
    """A rig on a virtual clock with a blocking host."""
    return make_rig(Setting(), **options)


def lose(*places: int) -> Callable[[bytes], bytes]:
    """A change that loses the bytes at these places."""
    return lambda data: bytes(byte for at, byte in enumerate(data) if at not in places)


def become(text: str) -> Callable[[bytes], bytes]:
    """A change into other bytes altogether, in hex."""
    return lambda _data: bytes.fromhex(text)


def flip(place: int, bits: int) -> Callable[[bytes], bytes]:
    """A change of some bits of one byte."""
    return lambda data: bytes(byte ^ bits if at == place else byte for at, byte in enumerate(data))
