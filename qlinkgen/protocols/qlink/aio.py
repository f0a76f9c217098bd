"""The client of a Q.link bus for asyncio; `qlinkgen.protocols.qlink.bus` is derived from it."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Callable, Iterable, Mapping
from os import PathLike
from typing import Self, Unpack

from qlinkgen.bus.making import open_line
from qlinkgen.bus.options import BusOptions, Parity, StopBits
from qlinkgen.codecs import qlink, qlink_bus
from qlinkgen.link.procedure import FAILURES
from qlinkgen.link.transaction import Question, Reply
from qlinkgen.protocols.qlink import survey
from qlinkgen.protocols.qlink.bus_state import BusState
from qlinkgen.protocols.qlink.facts import BROADCAST, NODES, PIECE
from qlinkgen.protocols.qlink.loading import LoadProgress, LoadReport
from qlinkgen.protocols.qlink.matching import ACCEPTS
from qlinkgen.protocols.qlink.motion import MotionProgress, MotionState, Repeats, move, unanswered
from qlinkgen.protocols.qlink.options import QlinkOptions
from qlinkgen.protocols.qlink.pacing import SyncReport, SyncTick
from qlinkgen.transport.opening import closing_on_error
from qlinkgen.transport.port import Port


class AsyncBus(qlink_bus.AsyncBus):
    """A Q.link bus, for any number of tasks of one event loop.

    Every command of the document is a method with the node as its first argument, and a method of `node(n)`
    without it. They return the response, and raise LinkError (NoReply, BadReply, Collision), PortLost, or,
    before anything is sent, the EncodeError of `qlinkgen.codecs.qlink`.

    Example:
        >>> async with AsyncBus.open("/dev/ttyUSB0") as bus:  # doctest: +SKIP
        ...     await bus.node(3).motor_position()
    """

    accepts = ACCEPTS

    def __init__(
        self,
        port: Port,
        *,
        crc: str | None = None,
        repeats: Repeats = "answered",
        **options: Unpack[BusOptions],
    ) -> None:
        """Take ownership of a port; closing the bus closes it.

        Args:
            port: the port of the bus.
            crc: 16-bit CRC of the catalogue in place of the schema's.
            repeats: whether nodes answer a motion that is sent again under its number (section 7.10 does not
                say): `answered`, `silent`, or `auto` to find out with the first motion to each node.
            options: see `qlinkgen.bus.options`.
        """
        self.state = BusState(repeats)
        self._begin(port, qlink if crc is None else qlink.Codec(crc), **options)

    @classmethod
    def open(
        cls,
        name: str,
        *,
        baud: int | None = None,
        parity: Parity = "none",
        stop_bits: StopBits = 1,
        reopen: bool = False,
        **options: Unpack[QlinkOptions],
    ) -> Self:
        """Open a device name or a URL of pyserial, by default at 115200 baud; the rest as for the class.

        Raises:
            PortMissing: the port does not exist.
            PortBusy: another program uses it, or this user lacks the permission.
        """
        opened = open_line(qlink, name, baud=baud, parity=parity, stop_bits=stop_bits, reopen=reopen)
        with closing_on_error(opened) as port:
            return cls(port, **options)

    async def transact(self, request: Question, *, attempts: int | None = None, trial: bool = False) -> Reply:
        """As `AsyncMaster.transact`.

        Raises:
            CommandError: a preset of the position, while the last status of the node says that its motor
                runs.
        """
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

    async def motion(
        self, node: int, *, counter: int | None = None, outputs: int = 0, segments: list[int] | None = None
    ) -> qlink.MotionResponse:
        """Send words and outputs to a node, which takes them exactly once and in order (section 7.10).

        Without an answer, NoReply is raised and the motion stays pending: it is sent again under its number
        before the next one, unless clear_fifo or node_reset drops it.

        Args:
            node: address of the node, 1..16.
            counter: number of the motion, 0..255. By default the bus counts, and repeats are safe.
            outputs: bit 0 is output 1; 0..255.
            segments: words of path data; 0..12 items, each 0..65535. Not more than `fifo_space` of the last
                answer, which `stream_motion` observes.
        """
        if counter is not None:
            return await super().motion(node, counter=counter, outputs=outputs, segments=segments)
        async with self.transaction():
            request = qlink.MotionRequest(node=node, outputs=outputs, segments=segments)
            state = self.state.motions[node]
            moved = self._quick(state, request) if state.ready else self.run(move(state, request))
            reply = await moved
            answer: qlink.MotionResponse = reply.response
            return answer

    async def _quick(self, state: MotionState, request: qlink.MotionRequest) -> Reply:
        """Fast path of `move` without a pending motion, at three quarters of its cost."""
        request.counter = state.counter
        fresh = state.begin(request)
        try:
            reply = await self.transact(request)
        except FAILURES as error:
            return await self.run(unanswered(state, request, error, fresh=fresh))
        state.settled(request)
        return reply

    async def clear_fifo(self, node: int) -> qlink.ClearFifoResponse:
        """Drop all words queued in a node, and its pending motion (section 7.12)."""
        async with self.transaction():
            self.state.motions[node].drop()  # also without an answer: the node may have executed it
            response = await super().clear_fifo(node)
            self.state.motions[node].forget()
            return response

    async def node_reset(self, node: int) -> qlink.NodeResetResponse:
        """Reset a node; it answers first (section 7.7). Its pending motion is dropped."""
        async with self.transaction():
            self.state.motions[node].drop()  # also without an answer: the node may have executed it
            response = await super().node_reset(node)
            self.state.motions[node].forget()
            return response

    async def node_sync(self, *, counter: int | None = None) -> None:
        """Synchronise all nodes (section 7.5); by default the counter is one more than in the last sync."""
        await self.tell(qlink.NodeSyncRequest(node=BROADCAST, counter=self.state.next_sync(counter)))

    def stream_motion(
        self,
        words: Mapping[int, Iterable[int]],
        *,
        outputs: int | Mapping[int, int] = 0,
        patience: float = 2.0,
        full_pause: float = 0.002,
    ) -> AsyncGenerator[MotionProgress, None]:
        """Stream path words to one or several nodes; iterate to continue.

        Each FIFO is kept as full as possible, without overflow. The words are taken from their iterables as
        needed, so these may be endless or lazy.

        Args:
            words: words for each node, 0..65535.
            outputs: outputs 1-8, for all or by node.
            patience: seconds that a node may be silent while the others continue.
            full_pause: seconds without requests when every FIFO is full.

        Raises:
            LinkError: a node was silent for longer. Its acknowledged words are queued, the last motion is
                pending.
        """
        return self.iterate(self.state.stream(words, outputs, patience, full_pause))

    async def complete_motor_request(
        self, node: int, motor_data: bytes, *, poll_interval: float = 0.01, timeout: float = 5.0
    ) -> qlink.MotorResponsePollResponse:
        """Send a motor request and poll for its result (sections 7.8, 7.9).

        Raises:
            NoReply: not completed within `timeout` seconds, or the node does not answer. The request itself
                is sent once: a repeat could be executed twice.
        """
        return await self.run(self.state.complete(node, motor_data, poll_interval, timeout))

    async def sync(
        self,
        interval: float,
        *,
        count: int | None = None,
        stop: Callable[[], bool] | None = None,
        on_tick: Callable[[SyncTick], None] | None = None,
    ) -> SyncReport:
        """Send node_sync every `interval` seconds, `count` times or until `stop()`; return the jitter."""
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
        """Load an Intel HEX file into a node (section 7.6); it is checked before anything is sent.

        Args:
            node: address of the node, 1..16.
            program: path of the file, or a checked text.
            piece: bytes in one request, 1..25.
            patience: time limit for one piece in seconds; no piece is stored twice.
            progress: called after each acknowledged piece.

        Raises:
            HexFileError: the file is invalid.
            LoadError: a piece was not acknowledged.
        """
        return await self.run(self.state.load(node, program, piece, patience), progress)

    async def scan(
        self, nodes: Iterable[int] = NODES, *, progress: Callable[[survey.Found], None] | None = None
    ) -> list[survey.Found]:
        """Find the nodes that answer."""
        return await self.run(survey.scan(nodes), progress)

    async def status(self, nodes: Iterable[int] = NODES) -> list[survey.NodeStatus]:
        """Ask nodes for position, inputs and last completion."""
        return await self.run(survey.status(nodes))


class AsyncNode(qlink_bus.AsyncNode):
    """One node of a bus: every command of the document without the node argument.

    Attributes:
        bus: the bus.
        number: address of the node, 1..16.
    """

    bus: AsyncBus

    async def motion(
        self, *, counter: int | None = None, outputs: int = 0, segments: list[int] | None = None
    ) -> qlink.MotionResponse:
        """As `AsyncBus.motion`."""
        return await self.bus.motion(self.number, counter=counter, outputs=outputs, segments=segments)

    async def clear_fifo(self) -> qlink.ClearFifoResponse:
        """As `AsyncBus.clear_fifo`."""
        return await self.bus.clear_fifo(self.number)

    async def node_reset(self) -> qlink.NodeResetResponse:
        """As `AsyncBus.node_reset`."""
        return await self.bus.node_reset(self.number)

    async def complete_motor_request(
        self, motor_data: bytes, *, poll_interval: float = 0.01, timeout: float = 5.0
    ) -> qlink.MotorResponsePollResponse:
        """As `AsyncBus.complete_motor_request`."""
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
        """As `AsyncBus.load`."""
        return await self.bus.load(self.number, program, piece=piece, patience=patience, progress=progress)
