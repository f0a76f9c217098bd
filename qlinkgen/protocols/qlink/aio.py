"""The asyncio client of a Q.link bus: the same methods as coroutines."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import AsyncGenerator, Callable, Iterable, Mapping
from os import PathLike
from typing import TypeVar, Unpack

from qlinkgen.codecs import qlink
from qlinkgen.codecs.qlink_bus import AsyncMasterCalls, AsyncNodeCalls
from qlinkgen.link.echo import EchoMode
from qlinkgen.link.events import Event
from qlinkgen.link.health import HealthPolicy
from qlinkgen.link.master import MasterEngine
from qlinkgen.link.transaction import Question, Reply
from qlinkgen.protocols.qlink import survey
from qlinkgen.protocols.qlink.bus_state import BusState, make_engine
from qlinkgen.protocols.qlink.facts import BAUD, BROADCAST, NODES, PIECE
from qlinkgen.protocols.qlink.loading import LoadProgress, LoadReport
from qlinkgen.protocols.qlink.motion import MotionProgress, Repeats, move
from qlinkgen.protocols.qlink.options import BusOptions
from qlinkgen.protocols.qlink.pacing import SyncReport, SyncTick
from qlinkgen.transport.aio import AsyncMaster
from qlinkgen.transport.opening import closing_on_error, open_port
from qlinkgen.transport.port import Port

R = TypeVar("R", bound=qlink.Message)


class AsyncBus(AsyncMaster, AsyncMasterCalls):
    """A Q.link bus, for any number of tasks of one event loop. Otherwise like `Bus`.

    Example:
        >>> async with AsyncBus.open("/dev/ttyUSB0") as bus:  # doctest: +SKIP
        ...     (await bus.node(3).motor_position()).position
    """

    engine: MasterEngine

    def __init__(
        self,
        port: Port,
        *,
        attempts: int = 3,
        echo: EchoMode = "auto",
        health: HealthPolicy | None = HealthPolicy(),  # noqa: B008  # immutable
        slack: float | None = None,
        crc: str | None = None,
        repeats: Repeats = "answered",
        on_event: Callable[[Event], None] | None = None,
    ) -> None:
        """Take ownership of a port; arguments as for `Bus`."""
        engine = make_engine(port, attempts=attempts, echo=echo, health=health, slack=slack, crc=crc)
        super().__init__(engine, port, on_event=on_event)
        self.state = BusState(repeats)
        self._moving: defaultdict[int, asyncio.Lock] = defaultdict(asyncio.Lock)

    @classmethod
    def open(cls, name: str, *, baud: int | None = None, **options: Unpack[BusOptions]) -> AsyncBus:
        """Open a device name or a URL of pyserial, like `Bus.open`. Opening is fast, so it is synchronous."""
        with closing_on_error(open_port(name, baud=baud or BAUD)) as port:
            return cls(port, **options)

    async def transact(self, request: Question, *, attempts: int | None = None, trial: bool = False) -> Reply:
        """As `Bus.transact`."""
        self.state.check(request)
        response = None
        try:
            reply = await super().transact(request, attempts=attempts, trial=trial)
            response = reply.response
            return reply
        finally:
            self.state.note(request, response)

    def node(self, number: int) -> AsyncNode:
        """Return one node, 1..16."""
        return AsyncNode(self, number)

    async def ask(self, request: qlink.Message, response: type[R]) -> R:  # noqa: ARG002  # for type checkers
        """Send a request and return its answer."""
        answer: R = (await self.transact(request)).response
        return answer

    async def tell(self, request: qlink.Message) -> None:
        """Send a request without a response."""
        await self.transact(request)

    async def motion(
        self, node: int, *, counter: int | None = None, outputs: int = 0, segments: list[int] | None = None
    ) -> qlink.MotionResponse:
        """As `Bus.motion`."""
        if counter is not None:
            return await super().motion(node, counter=counter, outputs=outputs, segments=segments)
        async with self._moving[node]:
            request = qlink.MotionRequest(node=node, outputs=outputs, segments=segments)
            reply = await self.run(move(self.state.motions[node], request))
            answer: qlink.MotionResponse = reply.response
            return answer

    async def clear_fifo(self, node: int) -> qlink.ClearFifoResponse:
        """As `Bus.clear_fifo`."""
        async with self._moving[node]:
            self.state.motions[node].drop()  # also without an answer: the node may have executed it
            response = await super().clear_fifo(node)
            self.state.motions[node].forget()
            return response

    async def node_reset(self, node: int) -> qlink.NodeResetResponse:
        """As `Bus.node_reset`."""
        async with self._moving[node]:
            self.state.motions[node].drop()  # also without an answer: the node may have executed it
            response = await super().node_reset(node)
            self.state.motions[node].forget()
            return response

    async def node_sync(self, *, counter: int | None = None) -> None:
        """As `Bus.node_sync`."""
        await self.tell(qlink.NodeSyncRequest(node=BROADCAST, counter=self.state.next_sync(counter)))

    def stream_motion(
        self,
        words: Mapping[int, Iterable[int]],
        *,
        outputs: int | Mapping[int, int] = 0,
        patience: float = 2.0,
        full_pause: float = 0.002,
    ) -> AsyncGenerator[MotionProgress, None]:
        """As `Bus.stream_motion`, for `async for`."""
        return self.iterate(self.state.stream(words, outputs, patience, full_pause))

    async def complete_motor_request(
        self, node: int, motor_data: bytes, *, poll_interval: float = 0.01, timeout: float = 5.0
    ) -> qlink.MotorResponsePollResponse:
        """As `Bus.complete_motor_request`."""
        return await self.run(self.state.complete(node, motor_data, poll_interval, timeout))

    async def sync(
        self,
        interval: float,
        *,
        count: int | None = None,
        stop: Callable[[], bool] | None = None,
        on_tick: Callable[[SyncTick], None] | None = None,
    ) -> SyncReport:
        """As `Bus.sync`."""
        return await self.run(self.state.sync(interval, count, stop), on_tick)

    async def load(
        self,
        node: int,
        program: str | PathLike[str] | bytes,
        *,
        piece: int = PIECE,
        patience: float = 5.0,
        progress: Callable[[LoadProgress], None] | None = None,
    ) -> LoadReport:
        """As `Bus.load`."""
        return await self.run(self.state.load(node, program, piece, patience), progress)

    async def scan(
        self, nodes: Iterable[int] = NODES, *, progress: Callable[[survey.Found], None] | None = None
    ) -> list[survey.Found]:
        """As `Bus.scan`."""
        return await self.run(survey.scan(nodes), progress)

    async def status(self, nodes: Iterable[int] = NODES) -> list[survey.NodeStatus]:
        """As `Bus.status`."""
        return await self.run(survey.status(nodes))


class AsyncNode(AsyncNodeCalls):
    """One node of a bus: every command of the document without the node argument.

    Attributes:
        bus: the bus.
        number: address of the node, 1..16.
    """

    def __init__(self, bus: AsyncBus, number: int) -> None:
        if number not in NODES:
            raise ValueError(f"node must be 1..16, not {number}")
        self.bus = bus
        self.number = number

    async def ask(self, request: qlink.Message, response: type[R]) -> R:
        """Send a request and return its answer."""
        return await self.bus.ask(request, response)

    async def tell(self, request: qlink.Message) -> None:
        """Send a request without a response."""
        await self.bus.tell(request)

    async def motion(
        self, *, counter: int | None = None, outputs: int = 0, segments: list[int] | None = None
    ) -> qlink.MotionResponse:
        """As `Bus.motion`."""
        return await self.bus.motion(self.number, counter=counter, outputs=outputs, segments=segments)

    async def clear_fifo(self) -> qlink.ClearFifoResponse:
        """As `Bus.clear_fifo`."""
        return await self.bus.clear_fifo(self.number)

    async def node_reset(self) -> qlink.NodeResetResponse:
        """As `Bus.node_reset`."""
        return await self.bus.node_reset(self.number)

    async def complete_motor_request(
        self, motor_data: bytes, *, poll_interval: float = 0.01, timeout: float = 5.0
    ) -> qlink.MotorResponsePollResponse:
        """As `Bus.complete_motor_request`."""
        return await self.bus.complete_motor_request(
            self.number, motor_data, poll_interval=poll_interval, timeout=timeout
        )

    async def load(
        self,
        program: str | PathLike[str] | bytes,
        *,
        piece: int = PIECE,
        patience: float = 5.0,
        progress: Callable[[LoadProgress], None] | None = None,
    ) -> LoadReport:
        """As `Bus.load`."""
        return await self.bus.load(self.number, program, piece=piece, patience=patience, progress=progress)
