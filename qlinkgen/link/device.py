"""The engine of a device that takes packets without a frame; its host is in `qlinkgen.link.host`.

The words to read and the check value are sent as soon as a packet is complete, whether or not the host reads
them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Literal, Protocol

from qlinkgen.link.codec import Command, Fault, Framed, Message, is_message
from qlinkgen.link.events import Frame
from qlinkgen.link.host_rules import HostCodec


class Requests(Protocol):
    """A receiver of packets: requests of its own module, and faults."""

    def feed(self, data: bytes, /) -> Sequence[Any]:
        """Return what the bytes complete."""
        ...

    def finish(self) -> Sequence[Any]:
        """Return the fault of an incomplete packet, and forget it."""
        ...


class DeviceCodec(HostCodec, Protocol):
    """A generated module of a protocol of the host kind, for its device."""

    @property
    def StreamDecoder(self) -> Callable[[Literal["request", "response"]], Requests]:  # noqa: N802
        """Receiver of one direction."""
        ...


class Handlers(Protocol):
    """The behaviour of a device; `SlaveHandlers` of a generated bus module has a method for each command."""

    def handle(self, request: Any, now: float) -> object:  # Any: a request of its own module
        """Execute a request; return its response, None if the device does not know the command."""
        ...


class DeviceCounters:
    """Counts of packets.

    Attributes:
        packets: executed packets.
        illegal: invalid command bytes, and commands that the device does not know.
        out_of_range: packets with an invalid value, which have no effect.
        forgotten: incomplete packets discarded after a silence.
    """

    __slots__ = ("forgotten", "illegal", "out_of_range", "packets")

    def __init__(self) -> None:
        self.packets = 0
        self.illegal = 0
        self.out_of_range = 0
        self.forgotten = 0

    def __repr__(self) -> str:
        return f"DeviceCounters({', '.join(f'{name}={getattr(self, name)!r}' for name in self.__slots__)})"


class DeviceEngine:
    """Decodes packets, and sends answers with check values; used like `SlaveEngine`.

    A command for which the handler returns None is unknown to the device: it is rejected, if the schema has a
    check value for that.

    Attributes:
        node: the behaviour of the device.
        counters: counts of packets.
        frames: each packet and answer, oldest first, which the driver removes; None, unless somebody is told.
        delays: seconds by class of request that its answers take longer than the turnaround.
    """

    delays: Mapping[type[Framed], float] = MappingProxyType({})

    def __init__(
        self, codec: DeviceCodec, node: Handlers, *, forgets: float = 0.0, turnaround: float = 0.0
    ) -> None:
        """Make the device's end of a link.

        Args:
            codec: the generated module of the protocol, which says how a host comes back in step.
            node: the behaviour of the device.
            forgets: seconds of silence within a packet after which it is discarded; 0: never.
            turnaround: seconds from the end of a packet to its answer.

        Raises:
            ValueError: a time is below 0 or not finite.
        """
        for name, seconds in (("forgets", forgets), ("turnaround", turnaround)):
            if not 0 <= seconds < float("inf"):
                raise ValueError(f"{name} must be 0 s or more and finite, not {seconds}")
        self.node = node
        self.counters = DeviceCounters()
        self.frames: deque[Frame] | None = None
        self._commands: dict[type[Framed], Command] = {each.request: each for each in codec.COMMANDS.values()}
        self._sizes = {
            each.request.ID: each.response.MAX_SIZE for each in codec.COMMANDS.values() if each.response
        }
        self._rejected = codec.RESYNC.rejected
        self._decoder = codec.StreamDecoder("request")
        self._forgets = forgets
        self._turnaround = turnaround
        self._last = 0.0
        self._answers: list[tuple[bytes, Message | None]] = []
        self._due = 0.0

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes of the host."""
        if self._forgets and now - self._last > self._forgets:
            self.counters.forgotten += len(self._decoder.finish())
        self._last = now
        for event in self._decoder.feed(data):
            if is_message(event):
                if self.frames is not None:
                    self.frames.append(Frame(now, False, event.to_frame(), event))
                self._carry_out(event, now)
            else:
                if self.frames is not None:
                    self.frames.append(Frame(now, False, event.raw, None, event))
                self._refuse(event, now)

    def _carry_out(self, request: Framed, now: float) -> None:
        command = self._commands[type(request)]
        answer = self.node.handle(request, now)
        if answer is None and command.response is not None:
            self._reject(request.to_frame(), now)
            return
        self.counters.packets += 1
        if command.response is None:
            return
        if not isinstance(answer, command.response):
            raise TypeError(
                f"{request.NAME} returned {answer!r}, which is not its response; return "
                f"{command.response.__name__}"
            )
        made: Any = answer  # whose `to_frame` takes the request
        self._answer(made.to_frame(request), answer, now + self.delays.get(type(request), 0.0))

    def _refuse(self, fault: Fault, now: float) -> None:
        """Handle bytes that are not a packet."""
        if fault.kind == "unknown":
            self._reject(fault.raw, now)
        else:
            self.counters.out_of_range += 1
            self._answer(self._unfit(fault.raw), None, now)

    def _reject(self, packet: bytes, now: float) -> None:
        """Answer a packet whose command the device does not know."""
        self.counters.illegal += 1
        if self._rejected:
            self._answer(bytes(self._sizes.get(packet[0], 0)) + self._rejected, None, now)

    def _unfit(self, packet: bytes) -> bytes:
        """The answer to a packet with an invalid value."""
        return bytes(self._sizes.get(packet[0], 0)) + self._rejected if self._rejected else b""

    def _answer(self, data: bytes, message: Message | None, at: float) -> None:
        if data:
            if not self._answers:
                self._due = at + self._turnaround
            self._answers.append((data, message))

    def bytes_to_send(self, now: float) -> bytes:
        """Return the answers that are due."""
        if not self._answers or now < self._due:
            return b""
        answers, self._answers = self._answers, []
        if self.frames is not None:
            self.frames.extend(Frame(now, True, data, message) for data, message in answers)
        return b"".join(data for data, _ in answers)

    def next_timer(self) -> float | None:
        """Return when an answer is due, None without one."""
        return self._due if self._answers else None
