"""Masters of any protocol.

Derived from `aio.py` by `python -m tests.unasync`: change that one, and run it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from logging import Logger
from typing import Any, Generic, Self, TypeVar, Unpack

from qlinkgen.bus.making import check_node, make_master, make_peer, open_line
from qlinkgen.bus.options import BusOptions, LinkOptions, MasterOptions, Parity, PeerOptions, StopBits
from qlinkgen.bus.watching import Watched
from qlinkgen.link.codec import Codec, Framed, Module
from qlinkgen.link.dialogue import Dialogue
from qlinkgen.link.echo import EchoMode
from qlinkgen.link.events import Event, Frame
from qlinkgen.link.master import MasterEngine
from qlinkgen.link.peer import PeerEngine
from qlinkgen.link.poll import Periods, Polled, Poller, Requests
from qlinkgen.link.slave import Node as Handlers
from qlinkgen.link.transaction import Accepts
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.opening import closing_on_error
from qlinkgen.transport.peers import BlockingPeer
from qlinkgen.transport.port import Port

R = TypeVar("R")


class Calls(Watched, BlockingMaster):
    """What the typed methods of a generated bus module send requests with.

    Attributes:
        codec: the generated module of the protocol.
    """

    codec: Module

    def ask(self, request: Framed, response: type[R]) -> R:  # noqa: ARG002  # for type checkers
        """Send a request and return its response."""
        reply = self.transact(request)
        answer: R = reply.response
        return answer

    def ask_any(self, request: Framed, *responses: type[Framed]) -> Any:  # noqa: ARG002
        """Send a request and return its response of one of several classes.

        Its type is `Any`: inferred from the classes it would be their common base, not their union.
        """
        reply = self.transact(request)
        return reply.response

    def ask_each(self, request: Framed, response: type[R]) -> dict[int, R | None]:  # noqa: ARG002
        """Send a request and return the response of each node in a list; None is one that is missing."""
        reply = self.transact(request)
        answers: dict[int, R | None] = reply.response
        return answers

    def ask_many(self, request: Framed, response: type[R]) -> list[R]:  # noqa: ARG002
        """Send a request and return its responses."""
        reply = self.transact(request)
        answers: list[R] = reply.response
        return answers

    def ask_stream(self, request: Framed, response: type[R]) -> Generator[R]:  # noqa: ARG002
        """Return an iterator over the responses, which sends the request first."""
        return self.stream(request)

    def ask_steps(self, request: Framed, further: Sequence[Any]) -> Any:
        """Send a request and the further frames of its dialogue; return all answers."""
        reply = self.transact(Dialogue(request, further))
        return reply.response

    def tell(self, request: Framed) -> None:
        """Send a request without a response."""
        self.transact(request)

    def poll(self, periods: Periods | Poller, *, requests: Requests | None = None) -> Generator[Polled, None]:
        """Ask periodically, and return an iterator over the outcomes: time, node, command, response or error.

        The bus is asked while the iterator is advanced, and is free for others in between. Silent nodes are
        asked less often. Close the iterator to end it.

        Args:
            periods: seconds between two requests by node and command, such as {(3, "get_zones"): 0.5}; by
                command where frames have no address: {"get_zones": 0.5}. Or a `Poller`, which has statistics.
            requests: those of commands that need values, by the same keys.

        Raises:
            ValueError: a period is not above 0, or there is none; a command is unknown, or its node missing.
            TypeError: the request of a command needs values.
        """
        poller = periods if isinstance(periods, Poller) else Poller(self.codec, periods, requests=requests)
        return self.iterate(poller.run())


class Bus(Calls):
    """A bus with one master, for any number of threads.

    Each command is a method, also of `node(n)` where frames have an address. They return the response, and
    raise LinkError (NoReply, BadReply, Refused, Collision), PortLost, or, before anything is sent, the
    EncodeError of the codec.

    Attributes:
        codec: the generated module of the protocol.
        accepts: additional rules whether a response matches a request, by command.
        usual_echo: the mode of the echo, unless an option says another one.
        engine: deadlines, counters, health.
    """

    codec: Codec
    accepts: Mapping[str, Accepts] | None = None
    usual_echo: EchoMode = "none"
    engine: MasterEngine

    def __init__(self, port: Port, **options: Unpack[BusOptions]) -> None:
        """Take ownership of a port; closing the bus closes it. The options are in `qlinkgen.bus.options`."""
        self._begin(port, self.codec, **options)

    def _begin(
        self,
        port: Port,
        codec: Codec,
        *,
        on_event: Callable[[Event], None] | None = None,
        on_frame: Callable[[Frame], None] | None = None,
        logger: Logger | None = None,
        **options: Unpack[MasterOptions],
    ) -> None:
        """Make the engine for a codec, which may have another CRC than that of the class."""
        options.setdefault("echo", self.usual_echo)
        engine = make_master(codec, port, self.accepts, **options)
        BlockingMaster.__init__(self, engine, port, on_event=on_event)
        self.watch(on_frame, logger)

    @classmethod
    def open(
        cls,
        name: str,
        *,
        baud: int | None = None,
        parity: Parity = "none",
        stop_bits: StopBits = 1,
        reopen: bool = False,
        **options: Unpack[BusOptions],
    ) -> Self:
        """Open a device name or a URL of pyserial.

        Args:
            name: such as /dev/ttyUSB0, COM3 or socket://HOST:PORT.
            baud: bits per second; by default as the schema states.
            parity: none, even or odd.
            stop_bits: 1 or 2.
            reopen: after a reported loss, reopen the port at its next use.
            options: see `qlinkgen.bus.options`.

        Raises:
            PortMissing: the port does not exist.
            PortBusy: another program uses it, or this user lacks the permission.
            ValueError: the schema states no speed, or an argument is out of range.
        """
        opened = open_line(cls.codec, name, baud=baud, parity=parity, stop_bits=stop_bits, reopen=reopen)
        with closing_on_error(opened) as port:
            return cls(port, **options)


B = TypeVar("B", bound=Calls)


class Node(Generic[B]):
    """One node of a bus: every command without the node argument.

    Attributes:
        bus: the bus.
        number: address of the node.
    """

    def __init__(self, bus: B, number: int) -> None:
        self.bus = bus
        self.number = check_node(bus.codec, number)

    def ask(self, request: Framed, response: type[R]) -> R:
        """As `ask` of the bus."""
        return self.bus.ask(request, response)

    def ask_any(self, request: Framed, *responses: type[Framed]) -> Any:
        """As `ask_any` of the bus."""
        return self.bus.ask_any(request, *responses)

    def ask_each(self, request: Framed, response: type[R]) -> dict[int, R | None]:
        """As `ask_each` of the bus."""
        return self.bus.ask_each(request, response)

    def ask_many(self, request: Framed, response: type[R]) -> list[R]:
        """As `ask_many` of the bus."""
        return self.bus.ask_many(request, response)

    def ask_stream(self, request: Framed, response: type[R]) -> Generator[R]:
        """As `ask_stream` of the bus."""
        return self.bus.ask_stream(request, response)

    def ask_steps(self, request: Framed, further: Sequence[Any]) -> Any:
        """As `ask_steps` of the bus."""
        return self.bus.ask_steps(request, further)

    def tell(self, request: Framed) -> None:
        """As `tell` of the bus."""
        self.bus.tell(request)


class Link(Calls, BlockingPeer):
    """One side of a link whose sides both ask, for any number of threads.

    It answers the requests of the other side while it asks, and between that while `serve` runs.

    Attributes:
        codec: the generated module of the protocol.
        engine: both halves.
    """

    codec: Codec
    engine: PeerEngine

    def __init__(
        self,
        port: Port,
        handlers: Handlers,
        *,
        on_event: Callable[[Event], None] | None = None,
        on_frame: Callable[[Frame], None] | None = None,
        logger: Logger | None = None,
        **options: Unpack[PeerOptions],
    ) -> None:
        """Take ownership of a port; closing the link closes it.

        Args:
            port: the port.
            handlers: what answers the requests of the other side.
            on_event: see `qlinkgen.bus.options`, as for the others.
            on_frame: see there.
            logger: see there.
            options: see there.
        """
        engine = make_peer(self.codec, port, handlers, **options)
        BlockingMaster.__init__(self, engine, port, on_event=on_event)
        self.watch(on_frame, logger)

    @classmethod
    def open(
        cls,
        name: str,
        handlers: Handlers,
        *,
        baud: int | None = None,
        parity: Parity = "none",
        stop_bits: StopBits = 1,
        reopen: bool = False,
        **options: Unpack[LinkOptions],
    ) -> Self:
        """Open a device name or a URL of pyserial; `handlers` answer, the rest is as for `Bus.open`."""
        opened = open_line(cls.codec, name, baud=baud, parity=parity, stop_bits=stop_bits, reopen=reopen)
        with closing_on_error(opened) as port:
            return cls(port, handlers, **options)
