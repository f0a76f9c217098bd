"""The reference of one schema: encodes, decodes, and receives streams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from tests.support.whole.reference import document, text_ids, values
from tests.support.whole.reference.asked import CARRIER, Asked, asked
from tests.support.whole.reference.fields import Fields, bits_of
from tests.support.whole.reference.forms import with_forms
from tests.support.whole.reference.frames import Frame
from tests.support.whole.reference.kinds import Kinds, address_of
from tests.support.whole.reference.layouts import Message, Test
from tests.support.whole.reference.notation import Direction, Doc, load, part_doc, whole_span
from tests.support.whole.reference.parties import asks, has_parties
from tests.support.whole.reference.receivers import (
    Event,
    Hunter,
    Listener,
    MarkedReceiver,
    PacketReceiver,
    Receiver,
    Searcher,
)
from tests.support.whole.reference.special import Marked, Packets
from tests.support.whole.reference.values import Raw, Wrong


@dataclass(frozen=True, slots=True)
class Seen:
    """A decoded frame."""

    name: str
    address: int | None
    values: Mapping[str, Raw]


class Reference:
    """Encodes and decodes the messages of a schema."""

    def __init__(self, text: str) -> None:
        """Read the text of a schema."""
        data = with_forms(load(text))
        self.frame: Frame | Marked | Packets | Kinds
        self.requests: Frame | Marked | Packets | Kinds
        self.messages: tuple[Message, ...]
        self.asked: Asked | None = None
        if "frames" in data:
            self._read_kinds(data, Kinds(data))
        else:
            self._read(data)
        self.by_name = {message.name: message for message in self.messages}
        used = {message.direction for message in self.messages}
        self.directions: tuple[Direction, ...] = (
            ("message",) if used == {"message"} else ("request", "response")
        )

    def _read_kinds(self, data: Doc, kinds: Kinds) -> None:
        self.frame = self.requests = kinds
        names = [name for each in kinds.documents.values() if (name := address_of(each))]
        self.address_name = names[0] if names else None
        self.messages = tuple(kinds.messages())
        for direction, way in kinds.ways.items():
            for name, frame in way.items():
                carried = [each for each in self.messages if name in each.frames]
                carried = [each for each in carried if each.direction in (direction, "message")]
                frame.seeds = {each.number: document.seeds(data, each.name) for each in carried}
        found = [(each, kinds.way(each)[each.frames[0]]) for each in self.messages]
        self.messages = tuple(
            replace(each, beside=frame.beside, depending=_depending(frame)) for each, frame in found
        )

    def _read(self, data: Doc) -> None:
        self.data = data
        text_ids.opened(data)
        shape = data["frame"]
        if "parts" in shape:
            self.frame, self.requests = Frame(data, "response"), Frame(data, "request")
        else:
            self.frame = self.requests = Marked(data) if "marked" in shape else Packets(data)
        parts = {**shape.get("parts", {}), **shape.get("packet", {})}
        sizes = [spec["size"] for spec in map(part_doc, parts.values()) if spec["role"] == "payload"]
        most = whole_span(sizes[0] if sizes else shape["marked"]["payload"])[1]
        most = shape.get("stated", most)
        addressed = [
            inner or name
            for name, spec in parts.items()
            for inner, role, *_ in bits_of(spec)
            if role == "address"
        ]
        self.address_name = addressed[0] if addressed else "address" if "marked" in shape else None
        if has_parties(data) and not addressed and asks(data):
            self.address_name = "node"
        ways = [each for each in (self.requests, self.frame) if isinstance(each, Frame)]
        fields = Fields(data, most, {name: kind for each in ways for name, kind in each.beside})
        self.messages = document.messages(data, fields, self.address_name is not None)
        for frame in (self.frame, self.requests):
            if isinstance(frame, Frame):
                frame.seeds = {each.number: document.seeds(data, each.name) for each in self.messages}
        self.messages = tuple(map(self._with_values, self.messages))
        trim = next((spec["trim"] for spec in map(part_doc, parts.values()) if "trim" in spec), None)
        if trim is not None:
            keep = 0 if trim == "zeros" else trim.get("keep", 0)
            self.messages = tuple(replace(each, trim=keep) for each in self.messages)
        self.asked = asked(data, Fields(data, most), self.messages)
        if self.asked is not None:
            self.messages = (*self.messages, self._with_values(self.asked.carrier))
        if isinstance(self.frame, Frame) and isinstance(self.requests, Frame):
            self.requests.texts |= text_ids.texts_of(data, self.known("request").values())
            self.frame.texts |= text_ids.texts_of(data, self.known("response").values())

    def frame_of(self, direction: Direction) -> Frame | Marked | Packets | Kinds:
        """The frame of a direction; only frames of parts can differ."""
        return self.frame if direction == "response" else self.requests

    def _with_values(self, message: Message) -> Message:
        """A message with the values of its frame."""
        frame = self.frame_of(message.direction)
        if not isinstance(frame, Frame):
            return message
        stated = document.settled(self.data, message)
        beside = tuple(
            (name, replace(kind, low=stated[name], high=stated[name], default=stated[name]))
            if name in stated
            else (name, kind)
            for name, kind in frame.beside
        )
        return replace(message, beside=beside, depending=_depending(frame))

    def known(self, direction: Direction) -> dict[int, Message]:
        """The messages of a direction by their number, of several kinds of frame by any."""
        hidden = self.asked.names if self.asked is not None else ()
        sent = [each for each in self.messages if each.direction in (direction, "message")]
        if isinstance(self.frame, Kinds):
            return dict(enumerate(each for each in sent if not each.turned))
        return {each.number: each for each in sent if each.name not in hidden}

    def asking(self, message: Message) -> Mapping[str, Sequence[Message]]:
        """The requests that tell a message from others, and the answers to each in the order of trial."""
        found = self.asked.answers if self.asked is not None else {}
        return {name: each for name, each in found.items() if message.name in {one.name for one in each}}

    def direction_of(self, message: Message) -> Direction:
        """A direction of a message."""
        return message.direction if message.direction in self.directions else "request"

    def encode(
        self, name: str, given: Mapping[str, Raw], address: int = 0, request: bytes = b""
    ) -> tuple[bytes, bytes]:
        """Payload and wire bytes. Raises Wrong."""
        message = self.by_name[name]
        if not message.allows(address):
            raise Wrong("range", "address")
        payload = values.encode(message, given)
        for each, kind in message.beside:
            raw = given[each]
            assert isinstance(raw, int)
            values.check(kind, raw)
        return payload, self.wrap(name, payload, address, request, given)

    def wrap(
        self,
        name: str,
        payload: bytes,
        address: int = 0,
        request: bytes = b"",
        given: Mapping[str, Raw] | None = None,
    ) -> bytes:
        """A frame around a payload, which is not checked; `given` are values of the frame."""
        message = self.by_name[name]
        frame = self.frame_of(message.direction)
        if isinstance(frame, Kinds):
            return frame.wrap(message, payload, address, given or {})
        if isinstance(frame, Frame):
            return frame.wrap(message.number, payload, address, given or {})
        if isinstance(frame, Marked):
            return frame.wrap(message, payload, address)
        return frame.wrap(message, payload, request)

    def decode_as(self, message: Message, wire: bytes, request: bytes = b"") -> Seen:
        """Decode the frame of a message, which may be told by its turn alone. Raises Wrong."""
        if message.turned:
            return Seen(message.name, None, values.decode(message, wire))
        return self.decode(self.direction_of(message), wire, request)

    def decode(self, direction: Direction, wire: bytes, request: bytes = b"") -> Seen:
        """Decode exactly one frame. Raises Wrong."""
        if not wire:
            raise Wrong("truncated")
        known, frame = self.known(direction), self.frame_of(direction)
        if isinstance(frame, Packets):
            message = known.get((request or wire)[0])
            if message is None:
                raise Wrong("unknown")
            payload = frame.opened(message, wire, request)
            return Seen(message.name, None, values.decode(message, payload))
        if isinstance(frame, Kinds):
            event = frame.searcher(known, direction).whole(wire)
        elif isinstance(frame, Frame):
            event = Searcher(frame, known).whole(wire)
        else:
            frame.check_ends(wire)
            event = MarkedReceiver(frame, known).ended(wire)
        if event.kind != "message":
            raise Wrong(event.kind)
        seen = Seen(event.name, event.address, event.values)
        return self._told(seen, request) if request and event.name == CARRIER else seen

    def _told(self, carried: Seen, request: bytes) -> Seen:
        """The first answer to a request that has the payload. Raises Wrong, as for the first answer."""
        assert self.asked is not None
        beside = {name: carried.values[name] for name, _ in self.by_name[CARRIER].beside}
        faults = []
        for answer in self.asked.answers.get(self.decode("request", request).name, ()):
            try:
                found = values.decode(answer, self.asked.payload(carried.values), beside)
            except Wrong as wrong:
                faults.append(wrong)
            else:
                return Seen(answer.name, carried.address, {**beside, **found})
        if faults:
            raise faults[0]
        return carried

    def receiver(self, direction: Direction, asked: Sequence[bytes] = ()) -> Receiver:
        """A new receiver; `asked` are the requests that are answered."""
        known, frame = self.known(direction), self.frame_of(direction)
        if isinstance(frame, Kinds):
            return frame.searcher(known, direction)
        if isinstance(frame, Marked):
            return MarkedReceiver(frame, known)
        if isinstance(frame, Packets):
            return PacketReceiver(frame, known, asked, answers=direction == "response")
        if frame.silent:
            return Listener(frame, known)
        return Hunter(frame, known) if frame.unique else Searcher(frame, known)

    def events(self, direction: Direction, stream: bytes, asked: Sequence[bytes] = ()) -> list[Event]:
        """The events of a receiver, including those at the end of the stream."""
        return self.receiver(direction, asked).run(stream)


def _depending(frame: Frame) -> tuple[tuple[str, tuple[Test, ...]], ...]:
    """The values that only some frames have, with the tests for their parts."""
    parts = (part for part in frame.parts if part.name in frame.tests and part.values)
    return tuple((name, frame.tests[part.name]) for part in parts for name, *_ in part.values)
