"""A bus of any protocol to try behaviours on: blocking or asyncio, on a virtual clock, in memory or on a pty.

A behaviour is written once, for a `Rig`: it says what happens to the next transmissions, and asks.
"""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import random
from collections import deque
from collections.abc import Callable, Coroutine, Iterator
from dataclasses import dataclass
from typing import Any, Literal

from qlinkgen.bus.blocking import Link
from qlinkgen.bus.host import Host
from qlinkgen.bus.host_aio import AsyncHost
from qlinkgen.link import Timing
from qlinkgen.link.events import Event
from qlinkgen.link.host_events import HostCounters
from qlinkgen.model.naming import method
from qlinkgen.sim import FaultPlan, VirtualPort, Wire
from qlinkgen.sim.fault_record import Disturbed
from qlinkgen.sim.generic import GenericNode
from qlinkgen.sim.joining import USUAL_SPEED, Joined, join_at
from qlinkgen.sim.refusals import Refusals
from qlinkgen.transport import Port
from tests.bus.cases import Case, numbers_of
from tests.bus.wires import asker, codec_of
from tests.library.protocols import described
from tests.soak.buses import vary
from tests.support.cmaster import CMaster
from tests.support.memory_line import MemoryLine
from tests.support.needs import decided_by_parameter
from tests.support.pty_line import PtyLine

#: Seconds of host slack; in real time, which skips silence, longer than a busy machine lets a thread wait.
SLACK = {"virtual": 0.012, "memory": 5.0, "pty": 5.0}
#: What happens to a transmission.
Fault = Callable[[bytes], Disturbed]


@dataclass(frozen=True)
class Setting:
    """The client and the transport of a rig; the client "c" is a blocking one whose engine is in C."""

    client: Literal["blocking", "asyncio", "c"]
    transport: Literal["virtual", "memory", "pty"]

    def __str__(self) -> str:
        """Name it in the id of a test."""
        return f"{self.client}-{self.transport}"

    @property
    def needs(self) -> frozenset[str]:
        """Markers of a test in this setting."""
        if self.client == "c":
            return frozenset({"program"})
        return frozenset({"pty"} if self.transport == "pty" else ())

    @property
    def paced(self) -> bool:
        """Bytes take their time, on a virtual clock."""
        return self.transport == "virtual"


def lost(data: bytes) -> Disturbed:
    """Nothing arrives."""
    return Disturbed(b"", len(data))


def half(data: bytes) -> Disturbed:
    """The second half is missing."""
    return Disturbed(data[: len(data) // 2], 0, len(data) - len(data) // 2)


def whole(data: bytes) -> Disturbed:
    """Nothing happens."""
    return Disturbed(data)


def flipped(bit: int) -> Fault:
    """One bit arrives changed."""

    def damage(data: bytes) -> Disturbed:
        at, mask = divmod(bit % (8 * len(data)), 8)
        return Disturbed(bytes((*data[:at], data[at] ^ 1 << mask, *data[at + 1 :])))

    return damage


def beginning(size: int) -> Fault:
    """Only so many bytes arrive, fewer than all."""
    return lambda data: half(data) if size >= len(data) else Disturbed(data[:size], 0, len(data) - size)


def late(seconds: float, byte_time: float) -> Fault:
    """It is complete so long after it could have begun."""
    return lambda data: Disturbed(data, wait=max(0.0, seconds - len(data) * byte_time))


def after(other: bytes, gap: float) -> Fault:
    """It follows other bytes, after a pause."""
    return lambda data: Disturbed(other, after=[(gap, data)])


class Script(FaultPlan):
    """A line whose faults are written down.

    Attributes:
        answers: what happens to the next transmissions of slaves.
        always: what happens to them after that; None: nothing.
        requests: what happens to the next transmissions of the master.
        drawn: faults at random besides, None without.
    """

    def __init__(self) -> None:
        super().__init__()
        self.drawn: FaultPlan | None = None
        self.answers: deque[Fault] = deque()
        self.always: Fault | None = None
        self.requests: deque[Fault] = deque()

    def disturb(self, data: bytes, now: float, source: str, *, to_master: bool) -> Disturbed | None:
        """Return the disturbed transmission."""
        if self.drawn is not None:
            return self.drawn.disturb(data, now, source, to_master=to_master)
        written = self.answers if to_master else self.requests
        fault = written.popleft() if written else self.always if to_master else None
        return None if fault is None else fault(data)


class Slave(GenericNode):
    """A node that answers with random numbers.

    Attributes:
        made: its answers.
        heard: the requests.
    """

    def __init__(self, codec: Any, number: int, refusals: Refusals | None = None) -> None:
        super().__init__(codec, number, refusals=refusals)
        self.made: list[Any] = []
        self.heard: list[Any] = []
        self._varies = refusals is None
        self._chance = random.Random(number)

    def handle(self, request: Any, now: float) -> Any:
        """Keep the request."""
        self.heard.append(request)
        return super().handle(request, now)

    def _answer(self, kind: Any, request: Any, echoes: Any, given: Any) -> Any:
        answer = super()._answer(kind, request, echoes, given)
        command = self._commands[type(request)]
        many = command.many
        kept = {
            answer.ADDRESS,
            *echoes,
            *getattr(answer, "PARTS", ()),
            *(reply.switch for reply in command.replies.values()),
        }
        kept |= {getattr(many, "by", ""), getattr(many, "key", ""), *((many.until or ())[:1] if many else ())}
        if self._varies:
            vary(answer, self._chance, kept)
        self.made.append(answer)
        return answer


class Rig:
    """A bus, its two nodes, and the line between them.

    Attributes:
        setting: how it is made.
        codec: the generated module.
        master: the bus.
        script: the faults of the line.
        nodes: the nodes; on a link without addresses there is one.
        events: the events of the bus.
        sent: when the master has begun and ended to send, for each transmission.
    """

    def __init__(self, setting: Setting, joined: Joined[Any], nodes: list[Slave], script: Script) -> None:
        self.setting = setting
        self.master = joined.master
        self.codec = self.master.codec
        self.wire = joined.wire
        self.nodes = nodes
        self.script = script
        self.events: list[Event] = []
        self.sent: list[tuple[float, float]] = []
        self.master.on_event = self.events.append
        self._runner: asyncio.Runner | None = None

    @property
    def timing(self) -> Timing:
        """The deadlines."""
        engine = self.master.engine
        found: Timing = getattr(engine, "master", engine).timing
        return found

    @property
    def hosted(self) -> bool:
        """The master is the host of a device."""
        return isinstance(self.master, Host | AsyncHost)

    def tries(self, case: Case, attempts: int) -> int:
        """The transmissions of a request without a right answer: one if a host stays out of step."""
        return attempts if case.command.repeat_safe and not self.hosted else 1

    def select(self, case: Case) -> None:
        """Let a host select what a command acts on, and count from there."""
        if self.hosted and case.where:
            self.ask(case)
            self.master.engine.count = HostCounters()
            self.events.clear()
            self.sent.clear()
            for node in self.nodes:
                node.made.clear()
                node.heard.clear()

    def call(self, case: Case, **other: Any) -> Any:
        """Call the method of a command: its result, or a coroutine."""
        return getattr(self.master, method(case.command.name))(*case.where, **{**case.values, **other})

    def wait(self, result: Any) -> Any:
        """Wait for what a call returns."""
        return result if self._runner is None else self._runner.run(result)

    def ask(self, case: Case, **other: Any) -> Any:
        """Call the method of a command."""
        return self.wait(self.call(case, **other))

    def ask_right(self, case: Case) -> None:
        """Ask, and compare the answers to those that the slave has made last."""
        self.check(self.ask(case))

    def ask_own(self, case: Case) -> int:
        """Ask; all answers must be among those made for this request. Return the size of the longest."""
        for node in self.nodes:
            node.made.clear()
        told = frames_of(self.ask(case))
        made = {wire_of(each) for node in self.nodes for each in node.made}
        assert made.issuperset(told)
        return max(map(len, told))

    def check(self, result: Any) -> None:
        """Compare answers to the last ones of the slaves."""
        told = frames_of(result)
        made = [wire_of(each) for node in self.nodes for each in node.made]
        assert told
        assert told == made[-len(told) :]

    def settle(self) -> None:
        """Wait until the slaves have received all that was sent, and nothing is answered."""
        assert not self.master.port.read(1.0)

    def run(self, task: Callable[[], Coroutine[Any, Any, Any]]) -> Any:
        """Run a coroutine in the event loop of the rig."""
        assert self._runner is not None
        return self._runner.run(task())


def frames_of(result: Any) -> list[bytes]:
    """The frames of the answers that a call returns."""
    if isinstance(result, dict):
        result = list(result.values())
    return [wire_of(each) for each in (result if isinstance(result, list | tuple) else [result])]


def wire_of(answer: Any) -> bytes:
    """The frame of an answer; of a packet its payload, with zeros for the check value over its request."""
    if "request" in inspect.signature(answer.to_frame).parameters:
        return bytes(answer.to_bytes().ljust(answer.MAX_WIRE_SIZE, b"\0"))
    return bytes(answer.to_frame())


@decided_by_parameter
@contextlib.contextmanager
def make_rig(
    setting: Setting, protocol: str, *, refused: str = "", echoes: bool = False, **options: Any
) -> Iterator[Rig]:
    """Put nodes on a line, and a bus at its outside.

    Args:
        setting: how.
        protocol: its name.
        refused: a command that is refused each time.
        echoes: the adapter echoes what the bus sends, which expects it.
        options: of the bus.
    """
    codec, script = codec_of(protocol), Script()
    kind = asker(protocol, "Async" if setting.client == "asyncio" else "")
    speed = codec.BUS.baud or USUAL_SPEED
    wire = Wire(
        baud=speed if setting.paced else None,
        bits_per_byte=codec.BUS.bits_per_byte,
        faults=script,
        echo=echoes,
        collisions=not has_host(protocol),  # which has a line for each direction
    )
    numbers = numbers_of(codec)[: 1 if both_ask(protocol) or has_host(protocol) else 2]
    refusals = Refusals(codec, {refused: 1.0}) if refused else None
    nodes = [Slave(codec, number, refusals) for number in numbers]
    given = {"slack": SLACK[setting.transport], **options}
    if not both_ask(protocol) and not has_host(protocol):
        given = {"health": None, "echo": "expect" if echoes else "none", **given}
    with contextlib.ExitStack() as stack:
        port, loop_factory = stack.enter_context(_port(setting, wire))
        joined = stack.enter_context(join_at(port, wire, kind, *nodes, **given))
        if setting.client == "c":
            timing, expected = joined.master.engine.timing, given["echo"] == "expect"
            model = described(protocol).model
            joined.master.engine = CMaster(model, codec, timing, echoes=expected)
        rig = Rig(setting, joined, nodes, script)
        wire.taps.append(
            lambda at, source, data: (
                rig.sent.append((at - len(data) * wire.byte_time, at)) if source == "outside" else None
            )
        )
        if setting.client == "asyncio":
            rig._runner = stack.enter_context(asyncio.Runner(loop_factory=loop_factory))
        yield rig


def both_ask(protocol: str) -> bool:
    """Both sides of the link ask."""
    return issubclass(asker(protocol), Link)


def has_host(protocol: str) -> bool:
    """The protocol has a host and its device."""
    return issubclass(asker(protocol), Host)


@contextlib.contextmanager
def _port(
    setting: Setting, wire: Wire
) -> Iterator[tuple[Port, Callable[[], asyncio.AbstractEventLoop] | None]]:
    if setting.transport == "virtual":
        yield VirtualPort(wire), None
    elif setting.transport == "memory":
        with MemoryLine(wire) as port:
            yield port, None
    else:
        with PtyLine(wire) as line:
            yield line.port, line.loop_factory
