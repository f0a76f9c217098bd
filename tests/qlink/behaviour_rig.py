"""A bus to try behaviours on: blocking or asyncio, on a virtual clock, in memory or over a pty, with faults.

A behaviour is written once, for a `Rig`. It uses the bus as a user would, with `rig.sure` for calls that a
user would repeat after a LinkError. It defines its nodes by `Slave`; the first of them may be a firmware on
an emulated chip.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar, cast

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError
from qlinkgen.link import EchoMode, Event, SlaveEngine
from qlinkgen.protocols.qlink import AsyncBus, Bus, VirtualNode
from qlinkgen.sim import Echo, FaultPlan, VirtualPort, Wire
from qlinkgen.sim.fault_kinds import RateLike
from qlinkgen.transport import Port
from tests.firmware.firmware import TARGETS
from tests.firmware.node import FirmwareNode, RealPauses
from tests.qlink.behaviour_drivers import AsBlocking
from tests.support.memory_line import MemoryLine
from tests.support.needs import decided_by_parameter
from tests.support.pty_line import PtyLine

T = TypeVar("T")
#: Seconds of host slack: more than the longest answer takes. In real time, which skips silence, longer than a
#: busy machine keeps a thread waiting.
SLACK = {"virtual": 0.012, "memory": 5.0, "pty": 5.0}
#: An answer so late misses its deadline, and still comes while the line has to be quiet.
LATE = (0.018, 0.024)
HIGH = 0.15
MIXED = dict.fromkeys(("drop", "flip", "stray", "noise"), 0.05)
#: Rounds after which a call that fails again and again has failed.
PATIENCE = 100


@dataclass(frozen=True)
class Setting:
    """A setting of the behaviours; `firmware` names the target of the first node."""

    name: str
    client: Literal["blocking", "asyncio"] = "blocking"
    transport: Literal["virtual", "memory", "pty"] = "virtual"
    rates: Mapping[str, RateLike] = field(default_factory=dict)
    echo: EchoMode = "none"
    partial: float = 0.0
    changed: float = 0.0
    firmware: str = ""

    @property
    def needs(self) -> frozenset[str]:
        """Markers of a test in this setting."""
        program = {"program"} if self.firmware else set()
        return frozenset(program | ({"pty"} if self.transport == "pty" else set()))

    @property
    def faulty(self) -> bool:
        """Whether calls may fail."""
        return bool(self.rates or self.partial or self.changed)


CLEAN = [
    Setting(f"{client}-{transport}", client, transport)
    for client in ("blocking", "asyncio")
    for transport in ("virtual", "memory", "pty")
]
FAULTS = [
    *(Setting(f"faults-{kind}", rates={kind: HIGH}) for kind in ("drop", "flip", "truncate", "delay")),
    Setting("faults-late", rates={"late": (HIGH, *LATE)}),
    Setting("faults-duplicate", rates={"duplicate": HIGH}),
    Setting("faults-stray", rates={"stray": 2 * HIGH}),
    Setting("faults-noise", rates={"noise": 2 * HIGH}),
    Setting("faults-silent", rates={"silent": (HIGH, 0.02, 0.1)}),
    Setting("faults-mixed-asyncio", "asyncio", rates=MIXED),
]
ECHOES = [
    Setting("echo-expect", echo="expect"),
    Setting("echo-auto", echo="auto"),
    Setting("echo-partial", echo="expect", partial=HIGH),
    Setting("echo-changed", echo="expect", changed=HIGH),
    Setting("echo-noise", echo="expect", rates={"noise": HIGH}),
    Setting("echo-drop", echo="expect", rates={"drop": HIGH}),
]
FIRMWARES = [Setting(f"firmware-{target}", firmware=target) for target in TARGETS]
FIRMWARES += [Setting("firmware-posix-asyncio", "asyncio", firmware="posix")]
FIRMWARE_FAULTS = [
    Setting(
        f"firmware-{target}-faults", rates={**MIXED, "truncate": 0.05, "duplicate": 0.05}, firmware=target
    )
    for target in TARGETS
]


class Slave:
    """A node to make; the settings are those of `VirtualNode`."""

    def __init__(self, number: int = 1, **settings: Any) -> None:
        self.number = number
        self.settings = settings


class Probe(VirtualNode):
    """A virtual node that records requests, and can lose answers.

    Attributes:
        heard: requests, in their order.
        mute: number of answers to be lost from now on; a busy machine may lose requests too.
        deaf: number of requests to be lost from now on.
        old_number: it answers a node_setup with its old number.
    """

    def __init__(self, number: int = 1, *, old_number: bool = False, **settings: Any) -> None:
        super().__init__(number, record=True, **settings)
        self.heard: list[qlink.Message] = []
        self.mute = self.deaf = 0
        self.old_number = old_number

    def handle(self, request: qlink.Message, now: float) -> qlink.Message | None:
        if self.deaf:
            self.deaf -= 1
            return None
        before = self.number
        self.heard.append(request)
        response = super().handle(request, now)
        if response is not None and self.mute:
            self.mute -= 1
            return None
        if self.old_number and isinstance(response, qlink.NodeSetupResponse):
            response.node = before
        return response

    @property
    def words(self) -> list[int]:
        """All words ever queued."""
        assert self.record is not None
        return self.record.words.tolist()

    @property
    def loaded(self) -> bytes | None:
        """Text of the loaded program, once its end record was received."""
        return self.program.text if self.program is not None else None

    @property
    def stored(self) -> int:
        """Bytes that the program has put into memory."""
        return self.program.size if self.program is not None else 0

    def memory(self, size: int) -> bytes:
        """Bytes of the program from address 0 on."""
        assert self.program is not None
        return bytes(map(self.program.memory().__getitem__, range(size)))

    @property
    def capacity(self) -> int:
        """Capacity of its FIFO in words."""
        return self.path.capacity

    @property
    def waiting(self) -> int:
        """Words in the FIFO."""
        return self.path.waiting

    @property
    def started(self) -> bool:
        """Whether the motor consumes words."""
        return self.path.started

    @property
    def position(self) -> int:
        """Where the motor is."""
        return self.path.position

    @position.setter
    def position(self, value: int) -> None:
        self.path.position = value

    def switch_input_1(self, level: int) -> float:
        """Set the level of input 1 and clear the others. Return the time."""
        now = self.clock()
        self.set_inputs(level, now)
        return now

    def clock(self) -> float:
        """Time of the last request, in seconds of the node's clock."""
        assert self.now is not None, "it has heard nothing yet"
        return self.now


Node = Probe | FirmwareNode


class Rig:
    """A bus, its nodes, and the line between them.

    Attributes:
        paced: bytes take their time, on a virtual clock.
        exact: the nodes live by that clock as well.
    """

    def __init__(self, setting: Setting, nodes: tuple[Probe, ...], bus: Bus, wire: Wire) -> None:
        self.setting = setting
        self.nodes = nodes
        self.bus = bus
        self.wire = wire
        self.faulty = setting.faulty
        self.paced = setting.transport == "virtual"
        self.exact = self.paced and not setting.firmware
        self.events: list[Event] = []

    @property
    def node(self) -> Probe:
        """The first node, or the only one."""
        return self.nodes[0]

    def now(self) -> float:
        return self.bus.port.now()

    def sleep(self, seconds: float) -> None:
        self.bus.port.sleep(seconds)

    def sure(self, call: Callable[[], T]) -> T:
        """Call with retries on a bad line. On a good line no call may fail."""
        for _ in range(PATIENCE if self.faulty else 0):
            with contextlib.suppress(LinkError):
                return call()
        return call()

    def move(self, number: int, words: list[int], outputs: int = 0) -> qlink.MotionResponse:
        """Send unique words; settle them after a missing answer."""
        for _ in range(PATIENCE if self.faulty else 1):
            try:
                return self.bus.motion(number, outputs=outputs, segments=words)
            except LinkError:
                if not self.faulty:
                    raise
                pending = self.bus.state.motions[number].pending
                if pending is not None and pending.segments == words:
                    return self.sure(lambda: self.bus.motion(number, outputs=outputs))
        raise AssertionError("the words were never sent")

    def until(self, condition: Callable[[], bool]) -> None:
        """Keep sending requests, so that time advances for the nodes too, until a condition holds."""
        for _ in range(5000):
            self.sure(lambda: self.bus.read(self.node.number, size=1))
            if condition():
                return
            self.sleep(0.01)
        raise AssertionError("it never got so")


@decided_by_parameter
@contextlib.contextmanager
def make_rig(setting: Setting, *nodes: Node, turnaround: float = 0.0, **options: Any) -> Iterator[Rig]:
    """Put nodes on a line, and a bus at its outside."""
    echo = Echo(partial=setting.partial, changed=setting.changed, seed=1) if setting.echo != "none" else False
    plan = FaultPlan(**setting.rates, seed=7, strays=_stray) if setting.rates else None  # type: ignore[arg-type]
    paced = setting.transport == "virtual"
    wire = Wire(baud=115200 if paced else None, faults=plan, echo=echo, chunks="random" if paced else "frame")
    for node in nodes:
        if isinstance(node, FirmwareNode):
            wire.attach(node.engine)
        else:
            wire.attach(SlaveEngine(qlink, node, turnaround=turnaround))
    given = {"echo": setting.echo, "health": None, "slack": SLACK[setting.transport], **options}
    with contextlib.ExitStack() as stack:
        port, loop_factory = stack.enter_context(_port(setting, wire))
        bus: Bus
        if setting.client == "blocking":
            bus = stack.enter_context(Bus(port, **given))
        else:
            runner = stack.enter_context(asyncio.Runner(loop_factory=loop_factory))
            loop = runner.get_loop()
            client = AsyncBus(port, **given)
            stack.callback(client.close)
            bus = cast(Bus, AsBlocking(client, loop))
        # A firmware node has the same attributes.
        yield Rig(setting, cast(tuple[Probe, ...], nodes), bus, wire)


#: Makes an event loop; None for the usual one.
LoopFactory = Callable[[], asyncio.AbstractEventLoop] | None


@contextlib.contextmanager
def _port(setting: Setting, wire: Wire) -> Iterator[tuple[Port, LoopFactory]]:
    if setting.transport == "virtual":
        clock = RealPauses if setting.firmware else VirtualPort
        yield clock(wire, reaction=(0.0, 0.0003)), None
    elif setting.transport == "pty":
        with PtyLine(wire) as line:
            yield line.port, line.loop_factory
    else:
        with MemoryLine(wire) as port:
            yield port, None


def _stray(chance: random.Random) -> bytes:
    """A valid answer of a missing node; that of an existing one could answer the pending request."""
    node = chance.randrange(12, 17)
    answers: list[qlink.Message] = [
        qlink.MotionResponse(node=node, counter=chance.randrange(256), fifo_space=255),
        qlink.MotorPositionResponse(node=node, position=-1),
        qlink.ReadResponse(node=node, data=b"\xff\xff\xff"),
        qlink.NodeProgramLoadResponse(node=node, counter=chance.randrange(256)),
        qlink.ClearFifoResponse(node=node),
    ]
    return chance.choice(answers).to_frame()
