"""Decodes a byte stream of any protocol into messages and faults, with or without a known direction.

Most frames do not state whether they are requests or responses. Without a direction both are tried:

* a frame that is valid in one direction has that direction;
* a frame that is valid in both is the response if it directly follows a request of the same command and
  address, else the request.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from types import ModuleType
from typing import Protocol, assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.cli.codec import MessageObject
from qlinkgen.link.codec import Fault, Framed, Message, address_of, is_message, unproven
from qlinkgen.model.message import Direction
from qlinkgen.model.protocol import Protocol as Described
from qlinkgen.plan.ends import ByKind, ByLength, ByMark, ByMessage, BySilence, ByTerminator, ByTurn
from qlinkgen.plan.framing import FramePlan, frame_plan

#: Kinds of faults in the order of the checks: of two faults, the later one is reported.
PROGRESS = ("unknown", "length", "frame", "stuffing", "truncated", "crc", "illegal", "range")


@dataclass(frozen=True, slots=True)
class Bad:
    """Bytes that are not a message: the generated module's Fault with its offset in the whole stream."""

    kind: str
    offset: int
    raw: bytes
    message: str


#: A generated message object, or a fault.
Event = MessageObject | Bad


class Stream(Protocol):
    """Decodes bytes into events."""

    def feed(self, data: bytes) -> Iterable[Event]:
        """Decode bytes; return the events that they complete, in order."""

    def finish(self) -> Iterable[Event]:
        """End the stream; return the remaining events."""


class OneWay:
    """Frames of one known direction (or of a protocol that has none)."""

    def __init__(self, codec: ModuleType, direction: Direction, base: int = 0) -> None:
        """Decode one direction; ``base`` is the offset of the first byte in the whole stream."""
        self._decoder = codec.StreamDecoder() if direction == "message" else codec.StreamDecoder(direction)
        self._base = base

    def feed(self, data: bytes) -> list[Event]:
        """Take bytes."""
        return [self._placed(event) for event in self._decoder.feed(data)]

    def finish(self) -> list[Event]:
        """The end of the stream."""
        return [self._placed(event) for event in self._decoder.finish()]

    def _placed(self, event: Framed | Fault) -> Event:
        return event if is_message(event) else _bad(event, self._base)


class Alone:
    """The bytes of one message that only its turn in a dialogue tells."""

    def __init__(self, codec: ModuleType, name: str, request: MessageObject | None = None) -> None:
        """Decode the message with this name; ``request`` is what it answers, None if that is not known."""
        self._codec, self._name, self._data = codec, name, b""
        self._request = request

    def feed(self, data: bytes) -> list[Event]:
        """Take bytes."""
        self._data += data
        return []

    def finish(self) -> Iterator[Event]:
        """The end of the stream."""
        data, self._data = self._data, b""
        if data:
            try:
                found = self._codec.MESSAGES[self._name].from_bytes(data)
            except self._codec.DecodeError as error:
                yield Bad(error.kind, 0, data, str(error))
                return
            fault = self._unproven(found)
            yield Bad("crc", 0, data, fault) if fault else found

    def _unproven(self, found: Framed) -> str:
        """What is wrong with the check value of a response that covers its request."""
        if self._request is None:
            return ""
        commands = {each.request: each for each in self._codec.COMMANDS.values()}
        return unproven(commands[type(self._request)], self._request, found)


class InStep:
    """Both directions of frames whose boundaries do not depend on the direction.

    Each direction has an event for each frame and for each fault, so the n-th event of one belongs to the
    n-th of the other, for chunks of any size.
    """

    def __init__(self, codec: ModuleType) -> None:
        """Decode in both directions."""
        self._requests, self._responses = codec.StreamDecoder("request"), codec.StreamDecoder("response")
        self._asked: tuple[str, int | None] | None = None

    def feed(self, data: bytes) -> Iterator[Event]:
        """Take bytes."""
        return self._merged(self._requests.feed(data), self._responses.feed(data))

    def finish(self) -> Iterator[Event]:
        """The end of the stream."""
        return self._merged(self._requests.finish(), self._responses.finish())

    def _merged(
        self, requests: Iterable[Framed | Fault], responses: Iterable[Framed | Fault]
    ) -> Iterator[Event]:
        # Most frames are valid in one direction only: the fault of the other is discarded unread.
        for request, response in zip(requests, responses, strict=True):
            asked, self._asked = self._asked, None
            if not is_message(request):
                yield response if is_message(response) else _further(_bad(request), _bad(response))
            elif asked and is_message(response) and asked == _transaction(response):
                yield response
            else:
                self._asked = _transaction(request)
                yield request


class EitherWay:
    """Both directions of frames whose size depends on the message, and so on the direction."""

    def __init__(self, codec: ModuleType) -> None:
        """Decode in both directions."""
        self._codec = codec
        self._ways: dict[Direction, OneWay] = {way: OneWay(codec, way) for way in ("request", "response")}
        self._held: dict[Direction, list[Event]] = {"request": [], "response": []}
        self._offset = 0
        self._asked: tuple[str, int | None] | None = None

    def feed(self, data: bytes) -> Iterator[Event]:
        """Take bytes, one at a time, so that both directions decode the same frame."""
        for byte in data:
            self._offset += 1
            yield from self._settle({way: each.feed(bytes((byte,))) for way, each in self._ways.items()})

    def finish(self) -> Iterator[Event]:
        """End the stream: return the remaining events of the direction that decoded more."""
        for way, each in self._ways.items():
            self._held[way] += each.finish()
        best = min(self._held.values(), key=len)
        other = max(self._held.values(), key=len)
        yield from best or other
        self._held = {"request": [], "response": []}

    def _settle(self, new: dict[Direction, list[Event]]) -> Iterator[Event]:
        for way, events in new.items():
            self._held[way] += events
        delivered = [way for way, events in new.items() if _last_message(events)]
        if delivered:
            chosen = delivered[0] if len(delivered) == 1 else self._choose(new)
            yield from self._deliver(chosen, new)
        elif len(self._held["request"]) == len(self._held["response"]):
            pairs = zip(self._held["request"], self._held["response"], strict=True)
            yield from [_further(*pair) for pair in pairs]
            self._held = {"request": [], "response": []}
            self._asked = self._asked if not any(new.values()) else None

    def _choose(self, new: dict[Direction, list[Event]]) -> Direction:
        """Of two messages that end together, one may be data at the end of the other."""
        asking, telling = (_last_message(new[way]) for way in ("request", "response"))
        if asking is not None and telling is not None:
            request, response = asking.to_frame(), telling.to_frame()
            if request != response and request.endswith(response):
                return "request"
            if request != response and response.endswith(request):
                return "response"
        return "response" if self._asked == _transaction(_last_message(new["response"])) else "request"

    def _deliver(self, way: Direction, new: dict[Direction, list[Event]]) -> list[Event]:
        """Return the events of the direction that has a message, including its earlier ones."""
        events = self._held[way]
        other: Direction = "request" if way == "response" else "response"
        if not new[other]:
            # The other direction is inside a longer candidate, which must not consume the next frame.
            self._ways[other] = OneWay(self._codec, other, self._offset)
        self._held = {"request": [], "response": []}
        self._asked = _transaction(_last_message(events)) if way == "request" else None
        return events


class Telling:
    """Gives answers that only their request tells apart the message that it asked for."""

    def __init__(self, codec: ModuleType, request: MessageObject | None = None) -> None:
        """``request`` is the first one, if it is not among the events."""
        self._codec = codec
        self._request = request

    def told(self, event: Event) -> Event:
        """Return an event, or the message that it has by the request before it."""
        if isinstance(event, Bad):
            return event
        if any(type(event) is command.request for command in self._codec.COMMANDS.values()):
            self._request = event
        elif self._request is not None and self._answers(self._request, event):
            try:
                found: MessageObject = self._codec.answer_to(self._request, event)
            except self._codec.DecodeError:
                return event
            return found
        return event

    def _answers(self, request: MessageObject, event: MessageObject) -> bool:
        """Whether the node that a request asks sends an answer."""
        asked = address_of(request)
        return asked in (address_of(event), self._codec.BUS.broadcast)


class Told:
    """A stream whose answers that only their request tells apart have the message that it asked for."""

    def __init__(self, stream: Stream, telling: Telling) -> None:
        """Take the events of a stream."""
        self._stream, self._telling = stream, telling

    def feed(self, data: bytes) -> Iterator[Event]:
        """Take bytes."""
        return map(self._telling.told, self._stream.feed(data))

    def finish(self) -> Iterator[Event]:
        """The end of the stream."""
        return map(self._telling.told, self._stream.finish())


def _bad(fault: Fault, base: int = 0) -> Bad:
    return Bad(fault.kind, fault.offset + base, bytes(fault.raw), fault.message)


def _last_message(events: list[Event]) -> MessageObject | None:
    return next((event for event in reversed(events) if not isinstance(event, Bad)), None)


def _further(request: Event, response: Event) -> Bad:
    assert isinstance(request, Bad)  # messages are delivered at once
    assert isinstance(response, Bad)
    return max(request, response, key=lambda bad: PROGRESS.index(bad.kind))


def _transaction(message: Message | None) -> tuple[str, int | None] | None:
    """Return command and address, which a response has in common with its request."""
    return None if message is None else (message.NAME.rpartition(".")[0], address_of(message))


def open_stream(
    protocol: Described, codec: ModuleType, direction: Direction | None, request: MessageObject | None = None
) -> Stream:
    """Return a stream for a protocol with frames; ``request`` is what the first answers answer."""
    stream = open_untold(protocol, codec, direction)
    return stream if protocol.carrier is None else Told(stream, Telling(codec, request))


def open_untold(protocol: Described, codec: ModuleType, direction: Direction | None) -> Stream:
    """Return a stream whose answers have the message that their bytes alone tell."""
    if protocol.directions == ("message",):
        return OneWay(codec, "message")
    if direction:
        return OneWay(codec, direction)
    return InStep(codec) if _ends_alike(frame_plan(protocol.frame)) else EitherWay(codec)


def _ends_alike(frame: FramePlan) -> bool:
    """Whether the boundaries of frames are independent of the direction."""
    match frame.end:
        case ByKind():
            return not any(each.only for each in frame.kinds) and all(map(_ends_alike, frame.kinds))
        case ByLength() | ByTerminator():
            return bool(frame.envelope.starts)
        case ByMark() | BySilence() | ByTurn():
            return True
        case ByMessage():
            return False
        case _:
            assert_never(frame.end)
