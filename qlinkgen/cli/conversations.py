"""Decoding of packets, which have no frame: a conversation of requests and responses, or one side of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import ModuleType
from typing import Protocol as TypingProtocol
from typing import cast

from qlinkgen._dataclass import dataclass
from qlinkgen.cli.codec import MessageObject
from qlinkgen.cli.streams import Bad, Event, OneWay
from qlinkgen.link.codec import Message
from qlinkgen.model.message import Direction
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import Plan, plan_of


@dataclass(frozen=True, slots=True)
class OutOfRange:
    """A request with an illegal value: message objects refuse it, but the device answers it."""

    NAME: str
    ID: int
    payload: bytes

    def to_bytes(self) -> bytes:
        """Return the bytes that the check value of the response covers."""
        return self.payload


#: A request as the decoder of its response takes it.
Asked = Message | OutOfRange


class Conversation:
    """Both sides on one line: after a request, a response if its check value fits, else the next request.

    The host need not read the check value, so requests may also follow one another directly.
    """

    def __init__(self, protocol: Protocol, codec: ModuleType) -> None:
        """Begin with a request."""
        self._plan = plan_of(protocol)
        self._codec = codec
        self._requests = OneWay(codec, "request")
        self._names = {message.id: message.name for message in protocol.received("request")}
        self._offset = 0
        self._asked: Asked | None = None
        self._waiting = bytearray()
        self._way: Direction | None = None
        self._answered = 0  # bytes of answers so far, which the decoder of requests does not see

    def hear(self, way: Direction | None) -> None:
        """State the direction of the bytes that follow, None if it is not known."""
        self._way = way

    def feed(self, data: bytes) -> Iterator[Event]:
        """Take bytes."""
        self._waiting += data
        yield from self._settle(last=False)

    def finish(self) -> Iterator[Event]:
        """End the stream: bytes held back as a possible response may be requests."""
        yield from self._settle(last=True)
        yield from map(self._placed, self._requests.finish())

    def _settle(self, *, last: bool) -> Iterator[Event]:
        while self._waiting:
            if self._asked is None and self._way == "response":
                yield self._stray()
                continue
            if self._asked is None:
                yield from self._request(self._take(1))
                continue
            size = answer_size(self._plan, self._asked)
            if len(self._waiting) < size and not last and self._way != "request":
                return
            asked, self._asked = self._asked, None
            if self._way == "request":
                continue  # the request was not answered
            if size and len(self._waiting) >= size:
                found = decode_answer(self._codec, bytes(self._waiting[:size]), asked, self._offset)
                if self._way == "response" or self._is_answer(found, asked):
                    self._take(size)
                    self._answered += size
                    yield found

    def _stray(self) -> Bad:
        """Return the bytes of the device that answer nothing."""
        offset, size = self._offset, len(self._waiting)
        self._answered += size
        return Bad("unknown", offset, self._take(size), "a response without a request")

    def _take(self, size: int) -> bytes:
        taken = bytes(self._waiting[:size])
        del self._waiting[:size]
        self._offset += size
        return taken

    def _request(self, byte: bytes) -> Iterator[Event]:
        for event in map(self._placed, self._requests.feed(byte)):
            self._asked = self._out_of_range(event) if isinstance(event, Bad) else event
            yield event

    def _placed(self, event: Event) -> Event:
        return replace(event, offset=event.offset + self._answered) if isinstance(event, Bad) else event

    def _out_of_range(self, bad: Bad) -> OutOfRange | None:
        if bad.kind != "range" or bad.raw[0] not in self._names:
            return None
        return OutOfRange(self._names[bad.raw[0]], bad.raw[0], bad.raw[1:])

    def _is_answer(self, found: Event, asked: Asked) -> bool:
        """Whether the check value fits, or the bytes can only be a response.

        The latter are refusals of an unknown command, and bytes after a request that the device may have
        refused for its value.
        """
        if not isinstance(found, Bad) or found.kind == "range":
            return True
        return found.raw[0] not in self._names and (found.kind == "illegal" or isinstance(asked, OutOfRange))


class Answers:
    """Consecutive responses to the same request."""

    def __init__(self, protocol: Protocol, codec: ModuleType, asked: Asked) -> None:
        """Take ``asked`` as the request of every response."""
        self._size = answer_size(plan_of(protocol), asked)
        self._codec, self._asked = codec, asked
        self._offset = 0
        self._waiting = bytearray()

    def feed(self, data: bytes) -> Iterator[Event]:
        """Take bytes."""
        self._waiting += data
        while self._size and len(self._waiting) >= self._size:
            raw = bytes(self._waiting[: self._size])
            del self._waiting[: self._size]
            yield decode_answer(self._codec, raw, self._asked, self._offset)
            self._offset += len(raw)

    def finish(self) -> Iterator[Event]:
        """The end of the stream."""
        if self._waiting:
            text = f"{len(self._waiting)} bytes; a response to {self._asked.NAME} has {self._size}"
            yield Bad("truncated", self._offset, bytes(self._waiting), text)


class Answer(TypingProtocol):
    """A response whose check value covers its request."""

    def to_frame(self, request: Asked) -> bytes:
        """Return its bytes on the wire."""


class PacketWire:
    """Tells the bytes of the messages of a conversation: those of an answer depend on its request."""

    def __init__(self, protocol: Protocol, asked: Asked | None = None) -> None:
        """``asked``: the request of the first answers."""
        self._requests = {message.name for message in protocol.received("request")}
        self._asked = asked

    def __call__(self, message: MessageObject) -> bytes:
        """Return the bytes of the next message, without any if its request is not known."""
        if message.NAME in self._requests:
            self._asked = message
            return message.to_frame()
        return b"" if self._asked is None else cast(Answer, message).to_frame(self._asked)


def answer_size(plan: Plan, asked: Asked) -> int:
    """Return the size of the response to a request with its check value; 0 for a request without response."""
    command = plan.protocol.command_of(plan.protocol.by_name[asked.NAME])
    return plan.message(command.response.name).frame_size if command and command.response else 0


def decode_answer(codec: ModuleType, raw: bytes, asked: Asked, offset: int) -> Event:
    """Decode these bytes as a response; return the message or the fault."""
    try:
        answer: MessageObject = codec.decode_response(raw, asked)
    except codec.DecodeError as error:
        return Bad(error.kind, offset, raw, str(error))
    return answer
