"""The engine of a slave: one node of a bus."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, Protocol

from qlinkgen.link.codec import Codec, Framed, Message, address_of, is_message, wrong_size
from qlinkgen.link.echo import EchoCanceller
from qlinkgen.link.numbering import numbering_of


class Node(Protocol):
    """The behaviour of a node; `SlaveHandlers` of a generated bus module has a method for each command."""

    #: Address of the node. A request may change it.
    number: int

    # Any: a node handles only messages of its own protocol.
    def handle(self, request: Any, now: float) -> Message | Sequence[Message] | None:
        """Execute a request; return its answer, a list of several, or None to send nothing."""
        ...


class Refusal(Exception):  # the outcome of a request, not an error of the program
    """Raised by a handler to answer with another reply than the response.

    Attributes:
        reply: message of a reply of the command, as the schema describes it.
    """

    def __init__(self, reply: Message) -> None:
        super().__init__(reply)
        self.reply = reply


class SlaveCounters:
    """Counts of a slave.

    Attributes:
        requests: requests to this node.
        broadcasts: requests to all nodes.
        answers: responses handed to the port.
        replaced: responses discarded because another frame arrived before they were sent.
        foreign: frames to and from other nodes.
        damaged: damaged frames, by kind. The answers of other nodes are decoded as requests and often count
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
    """Decodes the requests to a node, and encodes its answers.

    A handler returns the answer: the response, or another reply of the schema, which it may raise in a
    `Refusal` instead. An answer that takes longer is given to `answer` later; until then the handler returns
    None, or a reply that means pending.

    Attributes:
        node: the behaviour of the node.
        counters: counts of frames.
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

        A request is complete before the byte that may be inserted after its checksum arrives; the answer
        waits for that byte, too.

        Args:
            codec: the generated module of the protocol.
            node: the behaviour of the node.
            turnaround: seconds from the request to its answer, so that the master can release the line.
            baud: speed of the line, by default that of the schema.
            echo: whether the adapter echoes sent bytes. An answer can be the same bytes as its request, so
                with an unexpected echo the node would answer itself endlessly.
        """
        if echo not in ("expect", "none"):
            raise ValueError(
                f"echo must be 'expect' or 'none' for a slave, which sends no probe, not {echo!r}"
            )
        if not 0 <= turnaround < float("inf"):
            raise ValueError(f"turnaround must be 0 s or more and finite, not {turnaround}")
        self.node = node
        self.counters = SlaveCounters()
        self._encode = codec.encode
        self._numbering = numbering_of(codec)
        self._broadcast = codec.BUS.broadcast
        self._answering = {
            command.request: command.addressing == "answered_broadcast" for command in codec.COMMANDS.values()
        }
        self._sized = {command.request: command for command in codec.COMMANDS.values() if command.sizes}
        self._decoder = codec.StreamDecoder("request")
        self._turnaround = turnaround
        speed = baud or codec.BUS.baud
        self._byte_time = codec.BUS.bits_per_byte / speed if speed else 0.0
        self._echo = EchoCanceller(echo)
        self._last = b""
        self._answer = b""
        self._further: list[bytes] = []  #: answers that follow it
        self._due = 0.0
        self._request: Framed | None = None  #: the last one for this node

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes received from the line."""
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
        if self._answer:  # the master no longer waits for it, as it sends again
            self.counters.replaced += 1
            self._answer = b""
            self._further = []
        address = address_of(request)
        if address is not None and address == self._broadcast:
            self.counters.broadcasts += 1
            response = self._handled(request, now)
            if not self._answering[type(request)]:
                return
        elif address is None or address == self.node.number:
            self.counters.requests += 1
            response = self._handled(request, now)
        else:
            self.counters.foreign += 1
            return
        self._request = request
        if response is not None:
            self._queue(request, response)
            inserted = self._encode(request)[-1:] != self._last
            self._due = now + self._turnaround + (self._byte_time if inserted else 0.0)

    def _queue(self, request: Framed, response: Message | Sequence[Message]) -> None:
        """Encode one answer or several; the further ones follow the first."""
        several: Sequence[Message] = response if isinstance(response, list | tuple) else (response,)
        for each in several:
            self._check(request, each)
        self._further = [self._encoded(request, each) for each in several]
        self._answer = self._further.pop(0) if several else b""

    def _encoded(self, request: Framed, response: Message) -> bytes:
        if self._numbering is not None:
            self._numbering.answer(request, response)
        return self._encode(response)

    def _check(self, request: Framed, response: Message) -> None:
        """Refuse a response of another size than the request asks for, which a master would not accept."""
        command = self._sized.get(type(request))
        if command is None or type(response) is not command.response:
            return
        if name := wrong_size(command, request, response, received=False):
            asked = next(number for field, number, _ in command.sizes if field == name)
            raise ValueError(
                f"{response.NAME}: {name} has {len(getattr(response, name))} items; "
                f"{asked} of the request asks for {getattr(request, asked)}"
            )

    def _handled(self, request: Framed, now: float) -> Message | Sequence[Message] | None:
        try:
            return self.node.handle(request, now)
        except Refusal as refusal:
            return refusal.reply

    def answer(self, request: Framed, response: Message | Sequence[Message], now: float) -> None:
        """Send the answer to a request that its handler did not answer; too late after another request."""
        if request is self._request:
            self._queue(request, response)
            self._due = max(self._due, now)
        else:
            self.counters.replaced += 1

    def bytes_to_send(self, now: float) -> bytes:
        """Return the answer if it is due."""
        answer = self._answer
        if not answer or now < self._due:
            return b""
        self._answer = self._further.pop(0) if self._further else b""
        self._due = now + len(answer) * self._byte_time + self._turnaround
        self.counters.answers += 1
        if self._echo.mode == "expect":
            self._echo.sent(answer)
        return answer

    def next_timer(self) -> float | None:
        """Return when an answer is due, None without an answer."""
        return self._due if self._answer else None
