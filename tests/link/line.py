"""A scripted line: bytes at given times, and the events of an engine."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError
from qlinkgen.link import EchoMode, HealthPolicy, MasterEngine, Reply, SlaveEngine, Timing
from qlinkgen.link.events import Event
from qlinkgen.protocols.qlink.matching import ACCEPTS
from qlinkgen.sim import VirtualPort, Wire

#: Host slack of most tests here, in seconds.
SLACK = 0.002
BYTE = 10 / 115200
#: Two moments that differ only by how they were computed; far below a bit.
EPSILON = 1e-9

Arrivals = Iterable[tuple[float, bytes]]


def timing(*, slack: float = SLACK, paced: bool = True, attempts: int = 3, baud: int | None = None) -> Timing:
    """The timing of a Q.link bus."""
    return Timing.of(qlink, host_slack=slack, paced=paced, attempts=attempts, baud=baud)


def make(
    *,
    slack: float = SLACK,
    paced: bool = True,
    attempts: int = 3,
    baud: int | None = None,
    echo: EchoMode = "none",
    health: HealthPolicy | None = None,
) -> MasterEngine:
    """A Q.link master engine with the checks of the protocol."""
    terms = timing(slack=slack, paced=paced, attempts=attempts, baud=baud)
    return MasterEngine(qlink, terms, echo=echo, health=health, accepts=ACCEPTS)


@dataclass
class Run:
    """The course of one transaction."""

    reply: Reply | None = None
    error: LinkError | None = None
    end: float = 0.0
    sent: list[tuple[float, bytes]] = field(default_factory=list)

    @property
    def response(self) -> Any:
        assert self.reply is not None, self.error
        return self.reply.response

    @property
    def frames(self) -> list[bytes]:
        return [frame for _, frame in self.sent]


def drive(
    engine: MasterEngine,
    request: Any,
    arrivals: Arrivals = (),
    now: float = 0.0,
    *,
    attempts: int | None = None,
    trial: bool = False,
    limit: int = 10_000,
) -> Run:
    """Perform one transaction while bytes arrive at given times; the engine is called at each of its timers.

    Earlier bytes are read when the transaction begins, as drivers do.
    """
    queue = sorted(arrivals, key=lambda item: item[0])
    run = Run()
    while queue and queue[0][0] < now:
        engine.receive(queue.pop(0)[1], now)
    engine.start(request, now, attempts=attempts, trial=trial)
    for _ in range(limit):
        if frame := engine.bytes_to_send(now):
            run.sent.append((now, frame))
        timer = engine.next_timer()
        if timer is None:
            break
        if queue and queue[0][0] <= timer:
            now, data = queue.pop(0)
            engine.receive(data, now)
        else:
            now = max(now, timer)
        if now >= timer:
            engine.handle_timer(now)
    else:
        raise AssertionError("the engine does not come to an end")
    run.end = now
    try:
        run.reply = engine.take()
    except LinkError as error:
        run.error = error
    return run


def pieces(data: bytes, at: float, size: int = 1, every: float = BYTE) -> list[tuple[float, bytes]]:
    """Data cut into pieces that arrive one after the other."""
    cuts = range(0, len(data), size)
    return [(at + every * place, data[cut : cut + size]) for place, cut in enumerate(cuts)]


def changed(data: bytes, index: int, mask: int = 0x40) -> bytes:
    """Data with one byte changed."""
    out = bytearray(data)
    out[index] ^= mask
    return bytes(out)


def taken(engine: MasterEngine) -> list[Event]:
    """Remove and return the events so far."""
    events = list(engine.events)
    engine.events.clear()
    return events


class Node:
    """A simple node: `answer` returns the response to a request."""

    def __init__(self, number: int, answer: Callable[[Any], Any] | None = None) -> None:
        self.number = number
        self.heard: list[Any] = []
        self._answer = answer or self.usual

    def handle(self, request: Any, now: float) -> Any:
        self.heard.append(request)
        return self._answer(request)

    def usual(self, request: Any) -> Any:
        """Return the response of a node without state."""
        node, kind = self.number, type(request)
        if kind is qlink.MotionRequest:
            return qlink.MotionResponse(node=node, counter=request.counter, fifo_space=200)
        if kind is qlink.MotorPositionRequest:
            return qlink.MotorPositionResponse(node=node, position=node * 1000)
        if kind is qlink.LoopBackRequest:
            return qlink.LoopBackResponse(node=node, offset=request.offset, data=request.data)
        if kind is qlink.ReadRequest:
            return qlink.ReadResponse(node=node, data=bytes(request.size))
        if kind is qlink.WriteReadRequest:
            return qlink.WriteReadResponse(node=node, inputs=0x123456)
        if kind is qlink.NodeInfoRequest:
            return qlink.NodeInfoResponse(node=node)
        if kind is qlink.NodeResetRequest:
            return qlink.NodeResetResponse(node=node)
        if kind is qlink.ClearFifoRequest:
            return qlink.ClearFifoResponse(node=node)
        return None


class Setter:
    """A node of a made-up protocol: it answers each request with the response of `set`."""

    def __init__(self, module: Any, number: int = 3) -> None:
        self.number = number
        self._response = module.SetResponse

    def handle(self, request: Any, now: float) -> Any:
        return self._response(node=self.number)


def bus(*numbers: int, **options: Any) -> tuple[Wire, VirtualPort, list[Node]]:
    """A simulated line with usual nodes, and the master's port on it."""
    wire = Wire(baud=options.pop("baud", 115200), **options)
    nodes = [Node(number) for number in numbers]
    for node in nodes:
        wire.attach(SlaveEngine(qlink, node, turnaround=3 * wire.byte_time), f"node {node.number}")
    return wire, VirtualPort(wire), nodes


def ends_in_mark(make_response: Callable[[int], Any]) -> Any:
    """The first message whose checksum ends in A5, so that one more byte follows it on the wire."""
    return next(
        message
        for number in range(1 << 16)
        if (message := make_response(number)).to_frame()[-2:] == b"\xa5\x00"
    )


#: Required arguments of requests.
NEEDED: dict[str, dict[str, Any]] = {
    "motor_request": {"motor_data": b"?"},
    "read": {"size": 2},
    "write": {"data": b"?"},
    "loop_back": {"data": b"?"},
}


def request_of(command: Any, node: int = 3) -> Any:
    """A request of a command, to a node if it has an address."""
    address = 0 if command.addressing == "broadcast" else node
    return command.request(node=address, **NEEDED.get(command.name, {}))
