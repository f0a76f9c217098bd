"""The blocking client of a Q.link bus."""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Callable, Generator, Iterable, Mapping
from os import PathLike
from typing import TypeVar

from qlinkgen.codecs import qlink
from qlinkgen.codecs.qlink_bus import MasterCalls, NodeCalls
from qlinkgen.link.echo import EchoMode
from qlinkgen.link.events import Event
from qlinkgen.link.health import HealthPolicy
from qlinkgen.link.master import MasterEngine
from qlinkgen.link.procedure import FAILURES
from qlinkgen.link.transaction import Question, Reply
from qlinkgen.protocols.qlink import survey
from qlinkgen.protocols.qlink.bus_state import BusState, make_engine
from qlinkgen.protocols.qlink.facts import BAUD, BROADCAST, NODES, PIECE
from qlinkgen.protocols.qlink.loading import LoadProgress, LoadReport
from qlinkgen.protocols.qlink.motion import MotionProgress, MotionState, move
from qlinkgen.protocols.qlink.pacing import SyncReport, SyncTick
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.opening import open_port
from qlinkgen.transport.port import Port

R = TypeVar("R", bound=qlink.Message)


class Bus(BlockingMaster, MasterCalls):
    """A Q.link bus, asked from any number of threads.

    Every command of the document is a method here with the node as its first argument, and on `node(n)`
    without it. They return the response, and raise LinkError (NoReply, BadReply, Collision), PortLost, or the
    EncodeError of `qlinkgen.codecs.qlink` before a byte is sent.

    Example:
        >>> with Bus.open("/dev/ttyUSB0") as bus:  # doctest: +SKIP
        ...     bus.node(3).motor_position().position
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
        on_event: Callable[[Event], None] | None = None,
    ) -> None:
        """Take over a port; closing the bus closes it.

        Args:
            port: where the bus is.
            attempts: how often a request is sent before it has failed, all tries counted.
            echo: whether the adapter hands back what is sent: `expect`, `none`, or `auto` to find out with
                two bytes of zero before the first request.
            health: when a node that does not answer is left alone; None: never.
            slack: seconds that driver, adapter and operating system may add to a transaction, in place of
                what the port says of itself.
            crc: 16-bit CRC of the catalogue in place of the schema's.
            on_event: called with each event, in the thread that asks.
        """
        engine = make_engine(port, attempts=attempts, echo=echo, health=health, slack=slack, crc=crc)
        super().__init__(engine, port, on_event=on_event)
        self.state = BusState()
        self._moving: defaultdict[int, threading.Lock] = defaultdict(threading.Lock)

    def after_fork(self) -> None:
        """See `BlockingMaster.after_fork`."""
        super().after_fork()
        self._moving = defaultdict(threading.Lock)

    @classmethod
    def open(
        cls,
        name: str,
        *,
        baud: int | None = None,
        attempts: int = 3,
        echo: EchoMode = "auto",
        health: HealthPolicy | None = HealthPolicy(),  # noqa: B008  # immutable
        slack: float | None = None,
        crc: str | None = None,
        on_event: Callable[[Event], None] | None = None,
    ) -> Bus:
        """Open a device name or a URL of pyserial, at 115200 baud unless given; the rest as for the class.

        Raises:
            PortMissing: there is no such port.
            PortBusy: another program uses it, or this user lacks the permission.
        """
        port = open_port(name, baud=baud or BAUD)
        return cls(port, attempts=attempts, echo=echo, health=health, slack=slack, crc=crc, on_event=on_event)

    def transact(self, request: Question, *, attempts: int | None = None, trial: bool = False) -> Reply:
        """As `BlockingMaster.transact`.

        Raises:
            CommandError: the position of a motor is to be preset that runs, as its node has told last.
        """
        self.state.check(request)
        response = None
        try:
            reply = super().transact(request, attempts=attempts, trial=trial)
            response = reply.response
            return reply
        finally:
            self.state.note(request, response)

    def node(self, number: int) -> Node:
        """Return one node, 1..16."""
        return Node(self, number)

    def ask(self, request: qlink.Message, response: type[R]) -> R:  # noqa: ARG002  # for type checkers
        """Send a request and return its answer."""
        answer: R = self.transact(request).response
        return answer

    def tell(self, request: qlink.Message) -> None:
        """Send a request that nobody answers."""
        self.transact(request)

    def motion(
        self, node: int, *, counter: int | None = None, outputs: int = 0, segments: list[int] | None = None
    ) -> qlink.MotionResponse:
        """Hand words and outputs to a node, which takes them exactly once and in order (section 7.10).

        When no answer comes, NoReply is raised and the motion stays pending: it is sent again under its
        number before the next one, unless clear_fifo or node_reset drops it.

        Args:
            node: address of the node, 1..16.
            counter: number of the motion, 0..255. Left out, the bus counts, and repeats are safe.
            outputs: bit 0 is output 1; 0..255.
            segments: words of path data; 0..12 items, each 0..65535. Not more than `fifo_space` of the last
                answer: `stream_motion` sees to that.
        """
        if counter is not None:
            return super().motion(node, counter=counter, outputs=outputs, segments=segments)
        with self._moving[node]:
            request = qlink.MotionRequest(node=node, outputs=outputs, segments=segments)
            state = self.state.motions[node]
            reply = self._quick(state, request) if state.ready else self.run(move(state, request))
            answer: qlink.MotionResponse = reply.response
            return answer

    def _quick(self, state: MotionState, request: qlink.MotionRequest) -> Reply:
        """What `move` does where nothing has to be settled before, at three quarters of its cost."""
        request.counter = state.counter
        fresh = state.begin(request)
        try:
            reply = self.transact(request)
        except FAILURES as error:
            state.failed(error, fresh=fresh)
            raise
        state.settled(request)
        return reply

    def clear_fifo(self, node: int) -> qlink.ClearFifoResponse:
        """Drop all words that wait in a node, and the motion that is pending here (section 7.12)."""
        with self._moving[node]:
            self.state.motions[node].drop()  # also where no answer comes: the node may have done it
            response = super().clear_fifo(node)
            self.state.motions[node].forget()
            return response

    def node_reset(self, node: int) -> qlink.NodeResetResponse:
        """Reset a node; it answers first (section 7.7). A motion that is pending here is dropped."""
        with self._moving[node]:
            self.state.motions[node].drop()  # also where no answer comes: the node may have done it
            response = super().node_reset(node)
            self.state.motions[node].forget()
            return response

    def node_sync(self, *, counter: int | None = None) -> None:
        """Synchronise all nodes (section 7.5); left out, the counter is one up from the last sync."""
        self.tell(qlink.NodeSyncRequest(node=BROADCAST, counter=self.state.next_sync(counter)))

    def stream_motion(
        self,
        words: Mapping[int, Iterable[int]],
        *,
        outputs: int | Mapping[int, int] = 0,
        patience: float = 2.0,
        full_pause: float = 0.002,
    ) -> Generator[MotionProgress, None, dict[int, int]]:
        """Stream path words to one node or several; iterate to go on.

        Each FIFO is kept as full as it gets, and never gets more than it has room for. The words are taken
        from their iterables as they are needed, so these may be endless, or wait for a computation.

        Args:
            words: words for each node, 0..65535.
            outputs: outputs 1-8, for all or by node.
            patience: seconds that a node may be silent while the others go on.
            full_pause: seconds to leave the line alone when every FIFO is full.

        Raises:
            LinkError: a node was silent for longer. What it had taken is queued, the rest is pending.
        """
        return self.iterate(self.state.stream(words, outputs, patience, full_pause))

    def complete_motor_request(
        self, node: int, motor_data: bytes, *, poll_interval: float = 0.01, timeout: float = 5.0
    ) -> qlink.MotorResponsePollResponse:
        """Send a motor request and ask for its result until it is there (sections 7.8, 7.9).

        Raises:
            NoReply: not completed within `timeout` seconds, or the node does not answer. The request itself
                is sent once: repeated, it could be done twice.
        """
        return self.run(self.state.complete(node, motor_data, poll_interval, timeout))

    def sync(
        self,
        interval: float,
        *,
        count: int | None = None,
        stop: Callable[[], bool] | None = None,
        on_tick: Callable[[SyncTick], None] | None = None,
    ) -> SyncReport:
        """Send node_sync every `interval` seconds, `count` times or until `stop()`; says how steadily."""
        return self.run(self.state.sync(interval, count, stop), on_tick)

    def load(
        self,
        node: int,
        program: str | PathLike[str] | bytes,
        *,
        piece: int = PIECE,
        patience: float = 5.0,
        progress: Callable[[LoadProgress], None] | None = None,
    ) -> LoadReport:
        """Load an Intel HEX file into a node (section 7.6); it is checked before a byte is sent.

        Args:
            node: address of the node, 1..16.
            program: path of the file, or a text that has been checked.
            piece: bytes in one request, 1..25.
            patience: seconds for which one piece is tried; no piece is stored twice.
            progress: called after each acknowledged piece.

        Raises:
            HexFileError: the file is not what it should be.
            LoadError: a piece was not acknowledged.
        """
        return self.run(self.state.load(node, program, piece, patience), progress)

    def scan(
        self, nodes: Iterable[int] = NODES, *, progress: Callable[[survey.Found], None] | None = None
    ) -> list[survey.Found]:
        """Find the nodes that answer."""
        return self.run(survey.scan(nodes), progress)

    def status(self, nodes: Iterable[int] = NODES) -> list[survey.NodeStatus]:
        """Ask nodes for position, inputs and last completion."""
        return self.run(survey.status(nodes))


class Node(NodeCalls):
    """One node of a bus: every command of the document without the node argument.

    Attributes:
        bus: the bus.
        number: address of the node, 1..16.
    """

    def __init__(self, bus: Bus, number: int) -> None:
        if number not in NODES:
            raise ValueError(f"node: {number} was given; nodes have the numbers 1..16")
        self.bus = bus
        self.number = number

    def ask(self, request: qlink.Message, response: type[R]) -> R:
        """Send a request and return its answer."""
        return self.bus.ask(request, response)

    def tell(self, request: qlink.Message) -> None:
        """Send a request that nobody answers."""
        self.bus.tell(request)

    def motion(
        self, *, counter: int | None = None, outputs: int = 0, segments: list[int] | None = None
    ) -> qlink.MotionResponse:
        """As `Bus.motion`."""
        return self.bus.motion(self.number, counter=counter, outputs=outputs, segments=segments)

    def clear_fifo(self) -> qlink.ClearFifoResponse:
        """As `Bus.clear_fifo`."""
        return self.bus.clear_fifo(self.number)

    def node_reset(self) -> qlink.NodeResetResponse:
        """As `Bus.node_reset`."""
        return self.bus.node_reset(self.number)

    def complete_motor_request(
        self, motor_data: bytes, *, poll_interval: float = 0.01, timeout: float = 5.0
    ) -> qlink.MotorResponsePollResponse:
        """As `Bus.complete_motor_request`."""
        return self.bus.complete_motor_request(
            self.number, motor_data, poll_interval=poll_interval, timeout=timeout
        )

    def load(
        self,
        program: str | PathLike[str] | bytes,
        *,
        piece: int = PIECE,
        patience: float = 5.0,
        progress: Callable[[LoadProgress], None] | None = None,
    ) -> LoadReport:
        """As `Bus.load`."""
        return self.bus.load(self.number, program, piece=piece, patience=patience, progress=progress)
