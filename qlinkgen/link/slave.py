"""The answering side: one node of a bus."""

from __future__ import annotations

from typing import Any, Literal, Protocol

from qlinkgen.link.codec import Codec, Framed, Message, address_of, is_message
from qlinkgen.link.echo import EchoCanceller


class Node(Protocol):
    """What a node does; `SlaveHandlers` of a generated bus module has a method for each command."""

    #: Address that the node answers to. A request may change it.
    number: int

    # Any: a node handles messages of its own protocol alone.
    def handle(self, request: Any, now: float) -> Message | None:
        """Do what a request says; return the response, None where there is none."""
        ...


class SlaveCounters:
    """What a slave has seen.

    Attributes:
        requests: requests to this node.
        broadcasts: requests to all nodes.
        answers: responses handed to the port.
        replaced: responses that were not sent before somebody else spoke: nobody waits for them any more.
        foreign: frames to and from other nodes.
        damaged: damaged frames, by kind. The answers of other nodes are read as requests and often count
            here.
    """

    __slots__ = ("answers", "broadcasts", "damaged", "foreign", "replaced", "requests")

    def __init__(self) -> None:
        self.requests = 0
        self.broadcasts = 0
        self.answers = 0
        self.replaced = 0
        self.foreign = 0
        self.damaged: dict[str, int] = {}

    def __repr__(self) -> str:
        return f"SlaveCounters({', '.join(f'{name}={getattr(self, name)!r}' for name in self.__slots__)})"


class SlaveEngine:
    """Finds the requests to a node in what is on the line, and hands out its answers.

    Attributes:
        node: what the node does.
        counters: what it has seen.
    """

    def __init__(
        self,
        codec: Codec,
        node: Node,
        *,
        turnaround: float = 0.0,
        baud: int | None = None,
        echo: Literal["expect", "none"] = "none",
    ) -> None:
        """Make the engine of one node.

        A request is complete before the byte that may be inserted behind its checksum has come; the answer
        waits for that one, too.

        Args:
            codec: the generated module of the protocol.
            node: what the node does.
            turnaround: seconds from the request to its answer, so that the asker can stop sending.
            baud: speed of the line, that of the schema unless given.
            echo: whether the adapter hands back what is sent. An answer can be the same bytes as its request:
                with an echo that is not expected, the node would answer itself without end.
        """
        if echo not in ("expect", "none"):
            raise ValueError(
                f'echo: {echo!r} was given; a slave is told "expect" or "none", it sends no probe'
            )
        if not 0 <= turnaround < float("inf"):
            raise ValueError(
                f"turnaround: {turnaround} s was given; an answer cannot come before its request"
            )
        self.node = node
        self.counters = SlaveCounters()
        self._encode = codec.encode
        self._broadcast = codec.BUS.broadcast
        self._answering = {
            command.request: command.addressing == "answered_broadcast" for command in codec.COMMANDS.values()
        }
        self._decoder = codec.StreamDecoder("request")
        self._turnaround = turnaround
        speed = baud or codec.BUS.baud
        self._byte_time = codec.BUS.bits_per_byte / speed if speed else 0.0
        self._echo = EchoCanceller(echo)
        self._last = b""
        self._answer = b""
        self._due = 0.0

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that are on the line."""
        if self._echo.active:
            data = self._echo.cancel(data)
        self._last = data[-1:]
        for event in self._decoder.feed(data):
            if is_message(event):
                self._heard(event, now)
            else:
                damaged = self.counters.damaged
                damaged[event.kind] = damaged.get(event.kind, 0) + 1

    def _heard(self, request: Framed, now: float) -> None:
        if self._echo.active and self._echo.is_own(self._encode(request)):
            return
        if self._answer:  # the asker has given up on it, or there would be silence
            self.counters.replaced += 1
            self._answer = b""
        address = address_of(request)
        if address is not None and address == self._broadcast:
            self.counters.broadcasts += 1
            response = self.node.handle(request, now)
            if not self._answering[type(request)]:
                return
        elif address is None or address == self.node.number:
            self.counters.requests += 1
            response = self.node.handle(request, now)
        else:
            self.counters.foreign += 1
            return
        if response is not None:
            self._answer = self._encode(response)
            inserted = self._encode(request)[-1:] != self._last
            self._due = now + self._turnaround + (self._byte_time if inserted else 0.0)

    def bytes_to_send(self, now: float) -> bytes:
        """Return the answer that is due."""
        answer = self._answer
        if not answer or now < self._due:
            return b""
        self._answer = b""
        self.counters.answers += 1
        if self._echo.mode == "expect":
            self._echo.sent(answer)
        return answer

    def next_timer(self) -> float | None:
        """Return when an answer is due, None where none waits."""
        return self._due if self._answer else None
