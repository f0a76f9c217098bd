"""Several kinds of frame in one protocol: which messages each carries, and a receiver that tries all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from tests.support.whole.reference import document
from tests.support.whole.reference.fields import Fields, bits_of
from tests.support.whole.reference.frames import Frame, NeedMore, Refused, has
from tests.support.whole.reference.layouts import Message
from tests.support.whole.reference.notation import Direction, Doc, part_doc, stuffed
from tests.support.whole.reference.receivers import Event, Receiver, Searcher
from tests.support.whole.reference.values import Raw, Wrong, put


class Kinds:
    """The kinds of frame of a protocol."""

    def __init__(self, data: Doc) -> None:
        """Read each kind as a frame of its own."""
        self._data = data
        self.documents = {name: {**data, "frame": _whole(spec)} for name, spec in data["frames"].items()}
        #: The frames of each direction by the name of their kind.
        self.ways: dict[str, dict[str, Frame]] = {
            way: {
                name: Frame(each, way)
                for name, each in self.documents.items()
                if has(data["frames"][name], way)
            }
            for way in ("request", "response")
        }
        self.frames = {
            name: {**self.ways["request"], **self.ways["response"]}[name] for name in data["frames"]
        }
        named = {name for name in _values_of(data, "frame") if isinstance(name, str)}
        self.shared = tuple(name for name in self.frames if name not in named)
        #: The largest payload of any kind.
        self.most = max(frame.most for frame in self.frames.values())
        sent = list(self._messages())
        for way, frames in self.ways.items():
            carried = {name for each in sent if each.direction in (way, "message") for name in each.frames}
            for name in [name for name, frame in frames.items() if frame.one_way and name not in carried]:
                del frames[name]
        if not all(self.ways.values()):
            self.ways = dict.fromkeys(self.ways, self.ways["request"] or self.ways["response"])
        for way, frames in self.ways.items():
            for name, frame in frames.items():
                if not frame.starts and not frame.turned:
                    ways = (
                        (way,) if frame.one_way or "if" in data["frames"][name] else (*self.ways, "message")
                    )
                    those = [each for each in sent if each.direction in ways and name in each.frames]
                    numbers = {each.number for each in those}
                    if frame.parts[0].spec.get("role") == "address":
                        spans = {span for each in those for span in each.addresses}
                        numbers = {number for first, last in spans for number in range(first, last + 1)}
                    elif "bits" in frame.parts[0].spec:
                        numbers = _bytes_of(frame, numbers)
                    frame.starts = tuple(put(frame.parts[0].pieces, number) for number in numbers)
                    frame.bare = False

    def messages(self) -> Iterator[Message]:
        """All messages, in order."""
        for message in self._messages():
            bounded = replace(message, limit=self._fields(message.frames).most)
            turned = self.frames[message.frames[0]].turned
            yield replace(document.with_separator(bounded, self._document(message.frames)), turned=turned)

    def _messages(self) -> Iterator[Message]:
        data, defaults = self._data, self._data.get("defaults", {})
        usual = defaults.get("frame")
        for name, spec in data.get("commands", {}).items():
            answer = document.answer(spec.get("response"), defaults.get("response"))
            merged = {**defaults, **spec, "response": answer}
            own = spec.get("frame", usual)
            yield from self._of_command(name, merged, own, "request")
            if not isinstance(answer, str):
                yield from self._of_command(name, merged, answer.get("frame", own), "response")
            yield from self._steps(name, merged, own)
        replies = {name: {"direction": "response", **each} for name, each in data.get("replies", {}).items()}
        for name, spec in (replies | data.get("messages", {})).items():
            kinds = self._kinds(spec.get("frame", usual))
            built = document.single(
                name, spec, self._document(kinds), self._fields(kinds), self._addressed(kinds)
            )
            yield replace(built, frames=kinds)

    def _of_command(self, name: str, spec: Doc, kind: str | None, direction: Direction) -> Iterator[Message]:
        kinds = self._kinds(kind)
        made = document.of_command(
            name, spec, self._document(kinds), self._fields(kinds), self._addressed(kinds), (direction,)
        )
        for message in made:
            yield replace(message, frames=kinds)

    def _steps(self, name: str, spec: Doc, usual: str | None) -> Iterator[Message]:
        used: list[tuple[str, ...]] = []

        def place(stated: str | None) -> tuple[Doc, Fields, bool]:
            kinds = self._kinds(stated or usual)
            used.append(kinds)
            return self._document(kinds), self._fields(kinds), self._addressed(kinds)

        for message in document.steps(name, spec, place):
            yield replace(message, frames=used[-1])

    def _kinds(self, stated: str | None) -> tuple[str, ...]:
        return (stated,) if stated is not None else self.shared

    def _document(self, kinds: tuple[str, ...]) -> Doc:
        return self.documents[kinds[0]]

    def _fields(self, kinds: tuple[str, ...]) -> Fields:
        return Fields(self._document(kinds), max(self.frames[each].most for each in kinds))

    def _addressed(self, kinds: tuple[str, ...]) -> bool:
        return address_of(self._document(kinds)) is not None

    def kind_of(self, message: Message, size: int) -> Frame:
        """The kind for a payload of a size: the smallest that holds it, else the largest."""
        way = self.way(message)
        frames = sorted((way[each] for each in message.frames), key=lambda each: each.most)
        return next((each for each in frames if each.least <= size <= each.most), frames[-1])

    def wrap(self, message: Message, payload: bytes, address: int, given: Mapping[str, Raw]) -> bytes:
        """A frame around a payload, which is not checked."""
        return self.kind_of(message, len(payload)).wrap(message.number, payload, address, given)

    def way(self, message: Message) -> dict[str, Frame]:
        """The frames of the direction of a message, by the name of their kind."""
        return self.ways["response" if message.direction == "response" else "request"]

    def searcher(self, known: Mapping[int, Message], direction: str) -> KindSearcher:
        """A receiver of these messages."""
        return KindSearcher(self.ways["response" if direction == "response" else "request"], known)


def _bytes_of(frame: Frame, ids: set[int]) -> set[int]:
    """The numbers that the first part of a frame may have, by its constants and pieces of these ids."""
    first, at, found = frame.parts[0], 0, set[int]()
    pieces: list[tuple[int, int, int]] = []
    for name, shift, bits, _ in reversed(frame.id_bits()):
        pieces += [(shift, bits, at)] if name == first.name else []
        at += bits
    for byte in filter(first.accepts, range(first.mask + 1)):
        for number in ids:
            alike = (byte >> shift ^ number >> place for shift, _, place in pieces)
            if not any(each & (1 << bits) - 1 for each, (_, bits, _) in zip(alike, pieces, strict=True)):
                found.add(byte)
    return found


def address_of(data: Doc) -> str | None:
    """Name of the address of a frame."""
    names = [
        inner or name
        for name, spec in data["frame"]["parts"].items()
        for inner, role, *_ in bits_of(spec)
        if role == "address"
    ]
    return names[0] if names else None


def _whole(spec: Doc) -> Doc:
    """The parts of a kind, with an empty payload before what follows it if it has none."""
    parts, more = dict(spec["parts"]), {key: spec[key] for key in ("coding",) if key in spec}
    roles = [part_doc(each)["role"] for each in parts.values()]
    stuffed(more, parts)
    if "payload" in roles:
        return {"parts": parts, **more}
    name = "payload"
    while name in parts:
        name += "_"
    held = [at for at, role in enumerate(roles) if role not in ("constant", "checksum")]
    at = max(held, default=0) + 1
    found = list(parts.items())
    found.insert(at, (name, {"role": "payload", "size": 0}))
    return {"parts": dict(found), **more}


def _values_of(node: Any, key: str) -> Iterator[Any]:
    """Values of a key anywhere outside of fields and kinds."""
    if isinstance(node, dict):
        for name, each in node.items():
            if name == key and not isinstance(each, dict):
                yield each
            if name not in ("fields", "request", "frames", "types"):
                yield from _values_of(each, key)
    elif isinstance(node, list):
        for each in node:
            yield from _values_of(each, key)


class KindSearcher(Receiver):
    """Tries each kind where a frame may begin; otherwise the search continues at the next byte."""

    def __init__(self, frames: Mapping[str, Frame], known: Mapping[int, Message]) -> None:
        """An empty buffer; ``frames`` are those of a direction."""
        super().__init__(known)
        self.searchers = [
            Searcher(frame, {each.number: each for each in known.values() if name in each.frames})
            for name, frame in frames.items()
        ]
        self.buffer, self.start, self.ended = b"", 0, False
        #: The inserted byte that may follow the last frame.
        self.swallow = b""

    def whole(self, wire: bytes) -> Event:
        """The event of bytes that are exactly one frame. Raises Wrong."""
        for each in self.searchers:
            if any(first.startswith(wire[: len(first)]) for first in each.frame.starts):
                return each.whole(wire)
        raise Wrong("frame")

    def take(self, byte: int) -> Iterator[Event]:
        """The events of the bytes so far."""
        self.buffer += bytes([byte])
        yield from self._scan()

    def finish(self) -> Iterator[Event]:
        """Give up the incomplete frame and search its bytes for others."""
        self.ended = True
        if self.buffer:
            yield Event("truncated", self.at, self.start, self.buffer)
            self._advance(1)
        yield from self._scan()

    def _scan(self) -> Iterator[Event]:
        while self.buffer:
            swallow, self.swallow = self.swallow, b""
            if swallow == self.buffer[:1]:
                self._advance(1)
                continue
            try:
                event, size, self.swallow = self._attempt()
            except NeedMore:
                if not self.ended:
                    return
                self._advance(1)
            except Refused as refused:
                if refused.told:
                    yield Event(refused.kind, self.at, self.start, self.buffer[: refused.size])
                self._advance(1)
            else:
                yield event
                self._advance(size)

    def _attempt(self) -> tuple[Event, int, bytes]:
        for each in self.searchers:
            if any(first.startswith(self.buffer[: len(first)]) for first in each.frame.starts):
                each.buffer, each.start, each.at = self.buffer, self.start, self.at
                event, size, pending = each.attempt()
                stuffing = each.frame.stuffing
                return event, size, bytes([stuffing.insert]) if stuffing and pending else b""
        raise Refused("frame", told=False)

    def _advance(self, size: int) -> None:
        self.buffer, self.start = self.buffer[size:], self.start + size
