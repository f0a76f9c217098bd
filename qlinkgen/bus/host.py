"""Hosts of one device.

Derived from `aio.py` by `python -m tests.unasync`: change that one, and run it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from logging import Logger
from typing import Generic, Self, TypeVar, Unpack

from qlinkgen.bus.blocking import Calls
from qlinkgen.bus.making import make_host, open_line
from qlinkgen.bus.options import HostEngineOptions, HostOptions, Parity, StopBits
from qlinkgen.link.codec import Framed
from qlinkgen.link.device import DeviceCodec
from qlinkgen.link.events import Event, Frame
from qlinkgen.link.host import HostEngine
from qlinkgen.link.poll import Periods, Polled, Poller, Requests
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.opening import closing_on_error
from qlinkgen.transport.port import Port

R = TypeVar("R")


class Host(Calls):
    """The device at a host's port, for any number of threads.

    Each command is a method. Those that act on what is selected, such as an axis, take its number; the host
    selects it where it may not be in force. Methods return the response, and raise LinkError (NoReply,
    BadReply, IllegalCommand), PortLost, or, before anything is sent, the EncodeError of the codec.

    Attributes:
        codec: the generated module of the protocol.
        engine: deadlines, counters, and whether host and device are in step.
    """

    codec: DeviceCodec
    engine: HostEngine

    def __init__(
        self,
        port: Port,
        *,
        on_event: Callable[[Event], None] | None = None,
        on_frame: Callable[[Frame], None] | None = None,
        logger: Logger | None = None,
        **options: Unpack[HostEngineOptions],
    ) -> None:
        """Take ownership of a port; closing the host closes it.

        Args:
            port: the port.
            on_event: see `qlinkgen.bus.options`, as for the others.
            on_frame: see there.
            logger: see there.
            options: see there.
        """
        BlockingMaster.__init__(self, make_host(self.codec, port, **options), port, on_event=on_event)
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
        **options: Unpack[HostOptions],
    ) -> Self:
        """Open a device name or a URL of pyserial; the arguments are those of `Bus.open`."""
        opened = open_line(cls.codec, name, baud=baud, parity=parity, stop_bits=stop_bits, reopen=reopen)
        with closing_on_error(opened) as port:
            return cls(port, **options)

    def ask(self, request: Framed, response: type[R], selected: int | None = None) -> R:  # noqa: ARG002
        """Send a request, for what is selected if a number is given, and return its response."""
        reply = self.transact(self.engine.rules.packet(request, selected))
        answer: R = reply.response
        return answer

    def tell(self, request: Framed, selected: int | None = None) -> None:
        """Send a request without a response, for what is selected if a number is given."""
        self.transact(self.engine.rules.packet(request, selected))

    def poll(self, periods: Periods | Poller, *, requests: Requests | None = None) -> Generator[Polled, None]:
        """As `poll` of a bus; the number of a key is that of what is selected: {(2, "get_pos"): 0.5}."""
        if not isinstance(periods, Poller):
            periods = Poller(self.codec, periods, requests=requests, rules=self.engine.rules)
        return super().poll(periods)


H = TypeVar("H", bound=Host)


class Selected(Generic[H]):
    """What commands of a device act on, such as an axis: every such command without its number.

    Attributes:
        host: the device.
        number: its number.
    """

    def __init__(self, host: H, number: int) -> None:
        """Check the number, and send nothing."""
        self.host = host
        host.engine.rules.packet(host.engine.rules.proof, number)
        self.number = number

    def ask(self, request: Framed, response: type[R]) -> R:
        """As `ask` of the device."""
        return self.host.ask(request, response, self.number)

    def tell(self, request: Framed) -> None:
        """As `tell` of the device."""
        self.host.tell(request, self.number)
