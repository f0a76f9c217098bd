"""Slaves of any protocol on a port."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import Literal, Protocol, Self, Unpack

from qlinkgen.bus.making import open_line
from qlinkgen.bus.options import Parity, SlaveOptions, StopBits
from qlinkgen.bus.watching import Tracing, tell_frames, trace
from qlinkgen.link.codec import Codec
from qlinkgen.link.events import Frame
from qlinkgen.link.gaps import idle_of
from qlinkgen.link.slave import Node, SlaveEngine
from qlinkgen.transport.conversation import host_slack
from qlinkgen.transport.opening import closing_on_error
from qlinkgen.transport.port import Ability, Port
from qlinkgen.transport.serving import Answering, serving


class Answerer(Answering, Tracing, Protocol):
    """An engine that answers, and can tell of each frame."""


class Serving:
    """What answers on a port: slaves of a bus, or the device of a host.

    Attributes:
        port: the port.
        on_frame: called with each frame; None, unless somebody is told of them.
    """

    engines: Sequence[Answerer]

    def _begin(self, port: Port, on_frame: Callable[[Frame], None] | None) -> None:
        """Take ownership of a port, and tell of what the engines hear there."""
        self.port, self.on_frame = port, on_frame
        first, *others = self.engines
        trace(first, on_frame)  # all hear the same
        for engine in others:
            engine.frames = first.frames

    def run(self, stop: Callable[[], bool] = lambda: False) -> None:
        """Answer until `stop()` is true.

        Raises:
            PortLost: the port was lost.
        """
        steps = serving(self.port, *self.engines)
        timeout = next(steps)
        while not stop():
            timeout = steps.send(self.port.read(timeout))
            tell_frames(self.engines[0], self.on_frame)

    async def run_async(self, stop: Callable[[], bool] = lambda: False) -> None:
        """Answer in an event loop until `stop()` is true, or the task is cancelled.

        Raises:
            PortLost: the port was lost.
        """
        from qlinkgen.transport import aio  # noqa: PLC0415  # importing asyncio takes 50 ms

        steps = serving(self.port, *self.engines)
        timeout = next(steps)
        while not stop():
            timeout = steps.send(await aio.read(self.port, timeout))
            tell_frames(self.engines[0], self.on_frame)

    @contextmanager
    def running(self) -> Iterator[Self]:
        """Answer in a thread during a block.

        Raises:
            PortLost: the port was lost meanwhile. Errors of handlers are raised here, too.
        """
        from concurrent.futures import ThreadPoolExecutor  # noqa: PLC0415  # which other slaves do not need

        stopped = threading.Event()
        with ThreadPoolExecutor(1, "slave") as thread:
            running = thread.submit(self.run, stopped.is_set)
            try:
                yield self
            finally:
                stopped.set()
                running.result()

    def close(self) -> None:
        """Close the port."""
        self.port.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace_: TracebackType | None
    ) -> None:
        self.close()


class Slave(Serving):
    """One slave or several on a port, each of which is an object with a method for each command.

    Example:
        >>> Slave.serve("/dev/ttyUSB0", Oven(3))  # doctest: +SKIP

    Attributes:
        codec: the generated module of the protocol.
        engines: the engine of each slave, with its counters.
    """

    codec: Codec
    engines: list[SlaveEngine]

    def __init__(
        self,
        port: Port,
        *handlers: Node,
        turnaround: float | None = None,
        echo: Literal["expect", "none"] = "none",
        slack: float | None = None,
        on_frame: Callable[[Frame], None] | None = None,
    ) -> None:
        """Take ownership of a port; closing the slave closes it. The options are in `qlinkgen.bus.options`.

        Raises:
            ValueError: handlers are missing, or an option is out of range.
        """
        if not handlers:
            raise ValueError("no handlers: pass an object of a subclass of SlaveHandlers for each slave")
        late = host_slack(port) if slack is None else slack
        if turnaround is None:
            paced = port.capabilities.paced is Ability.YES
            turnaround = idle_of(self.codec, self.codec.BUS.bits_per_byte / port.baud) if paced else 0.0
        self.engines = [
            SlaveEngine(self.codec, each, turnaround=turnaround, baud=port.baud, echo=echo, host_slack=late)
            for each in handlers
        ]
        self._begin(port, on_frame)

    @classmethod
    def open(
        cls,
        name: str,
        *handlers: Node,
        baud: int | None = None,
        parity: Parity = "none",
        stop_bits: StopBits = 1,
        **options: Unpack[SlaveOptions],
    ) -> Self:
        """Open a device name or a URL of pyserial; the arguments are those of `Bus.open`."""
        opened = open_line(cls.codec, name, baud=baud, parity=parity, stop_bits=stop_bits, reopen=False)
        with closing_on_error(opened) as port:
            return cls(port, *handlers, **options)

    @classmethod
    def serve(
        cls,
        name: str,
        *handlers: Node,
        stop: Callable[[], bool] = lambda: False,
        baud: int | None = None,
        parity: Parity = "none",
        stop_bits: StopBits = 1,
        **options: Unpack[SlaveOptions],
    ) -> None:
        """Open a port and answer there until `stop()` is true, by default as long as the port exists.

        Raises:
            PortLost: the port was lost.
        """
        with cls.open(name, *handlers, baud=baud, parity=parity, stop_bits=stop_bits, **options) as slave:
            slave.run(stop)
