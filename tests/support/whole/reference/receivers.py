"""The four state machines of docs/receiver.md."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from tests.support.whole.reference import values
from tests.support.whole.reference.frames import Cut, Frame, NeedMore, Refused, Splitter
from tests.support.whole.reference.layouts import Message
from tests.support.whole.reference.special import Marked, Packets
from tests.support.whole.reference.values import Raw, Wrong


@dataclass(frozen=True, slots=True)
class Event:
    """A frame (`kind` is "message") or a fault; `at` is the offset of the byte that completed it."""

    kind: str
    at: int
    offset: int
    raw: bytes
    name: str = ""
    address: int | None = None
    values: Mapping[str, Raw] = field(default_factory=dict)


class Receiver:
    """Base class of the machines."""

    def __init__(self, known: Mapping[int, Message]) -> None:
        """`known` are the messages that can come, by their number."""
        self.known = known
        self.at = -1

    def run(self, stream: bytes) -> list[Event]:
        """The events of a whole stream; `at` of those at its end is the size of the stream."""
        events: list[Event] = []
        for byte in stream:
            self.at += 1
            events += self.take(byte)
        self.at += 1
        return [*events, *self.finish()]

    def take(self, byte: int) -> Iterator[Event]:
        """Take one byte."""
        raise NotImplementedError

    def finish(self) -> Iterator[Event]:
        """End the stream."""
        raise NotImplementedError

    def carried(
        self,
        message: Message | None,
        address: int | None,
        payload: Callable[[], bytes],
        offset: int,
        raw: bytes,
        *,
        beside: Callable[[Collection[str] | None], Mapping[str, Raw]] = lambda _: {},
    ) -> Event:
        """The message of an intact frame, or the fault in its contents."""
        if message is None:
            return Event("unknown", self.at, offset, raw)
        try:
            found = values.decode(message, payload(), beside(message.decided_by))
            if address is not None and not message.allows(address):
                raise Wrong("range")
            around = beside(None)
            for name, kind in message.beside:
                if name in around:
                    values.check(kind, int(str(around[name])))
            found = {**around, **found}
        except Wrong as wrong:
            return Event(wrong.kind, self.at, offset, raw)
        return Event("message", self.at, offset, raw, message.name, address, found)


class Hunter(Receiver):
    """The preamble occurs nowhere else: each byte is processed once."""

    def __init__(self, frame: Frame, known: Mapping[int, Message]) -> None:
        """Hunt."""
        super().__init__(known)
        assert frame.stuffing
        self.frame = frame
        self.mark, self.insert = frame.stuffing.after[0], frame.stuffing.insert
        self.preamble = frame.parts[0].constant
        self.marks, self.raw, self.body, self.escaped = 0, b"", b"", False

    def take(self, byte: int) -> Iterator[Event]:
        """One step."""
        if not self.raw:
            yield from self._hunt(byte)
        elif self.escaped:
            yield from self._behind_mark(byte)
        else:
            yield from self._inside(byte)

    def _hunt(self, byte: int) -> Iterator[Event]:
        if byte == self.mark:
            self.marks += 1
            return
        begun, self.marks = self.marks >= 2, 0
        if begun:
            self.raw, self.body = self.preamble, b""
            if self.frame.least <= byte - self.frame.bias <= self.frame.most:
                yield from self._inside(byte)
            else:
                yield self._fault("length", byte)

    def _fault(self, kind: str, byte: int) -> Event:
        raw, self.raw, self.escaped = self.raw + bytes([byte]), b"", False
        return Event(kind, self.at, self.at + 1 - len(raw), raw)

    def _behind_mark(self, byte: int) -> Iterator[Event]:
        if byte == self.insert:
            self.raw += bytes([byte])
            self.escaped = False
        elif byte == self.mark:
            raw, self.raw, self.escaped, self.marks = self.raw[:-1], b"", False, 2
            yield Event("truncated", self.at, self.at - 1 - len(raw), raw)
        else:
            yield self._fault("stuffing", byte)

    def _inside(self, byte: int) -> Iterator[Event]:
        self.raw += bytes([byte])
        self.body += bytes([byte])
        self.escaped = byte == self.mark
        payload = self.body[0] - self.frame.bias
        if len(self.preamble) + len(self.body) < self.frame.overhead + payload:
            return
        raw, offset = self.raw, self.at + 1 - len(self.raw)
        self.raw, self.escaped, self.marks = b"", False, int(byte == self.mark)
        yield self._complete(self._parts(payload), offset, raw)

    def _parts(self, payload: int) -> Mapping[str, bytes]:
        data, cut = self.preamble + self.body, dict[str, bytes]()
        for part in self.frame.parts:
            size = payload if part.role == "payload" else part.size
            cut[part.name], data = data[:size], data[size:]
        return cut

    def _complete(self, cut: Mapping[str, bytes], offset: int, raw: bytes) -> Event:
        if self.frame.check_fails(cut):
            return Event("crc", self.at, offset, raw)
        payload = cut[self.frame.by_role["payload"].name]
        message = self.known.get(self.frame.number("message", cut) or 0)
        return self.carried(message, self.frame.number("address", cut), lambda: payload, offset, raw)

    def finish(self) -> Iterator[Event]:
        """An unfinished frame is truncated."""
        raw = self.raw or (self.preamble if self.marks >= 2 else b"")
        if raw:
            yield Event("truncated", self.at, self.at - len(raw), raw)


class Searcher(Receiver):
    """Buffers bytes until a frame is valid; otherwise the search continues at the next byte."""

    def __init__(self, frame: Frame, known: Mapping[int, Message]) -> None:
        """An empty buffer."""
        super().__init__(known)
        self.frame, self.splitter = frame, Splitter(frame, known)
        self.buffer, self.start, self.skipped = b"", 0, b""
        self.swallow, self.ended = False, False
        self.lost = False
        self.needed = 0

    def whole(self, wire: bytes) -> Event:
        """The event of bytes that are exactly one frame. Raises Wrong."""
        self.buffer = wire
        try:
            cut = self.splitter.split(wire)
            payload = self._plain(cut)
            rest = wire[cut.size :]
            inserted = bytes([self.frame.stuffing.insert]) if self.frame.stuffing and cut.pending else b""
            if rest not in (b"", inserted):
                raise Wrong("length", "bytes follow the frame")
            return self._event(cut, payload)
        except NeedMore:
            raise Wrong("truncated") from None
        except Refused as refused:
            raise Wrong("length" if refused.kind == "empty" else refused.kind) from None

    def take(self, byte: int) -> Iterator[Event]:
        """The events of the bytes so far."""
        self.buffer += bytes([byte])
        if len(self.buffer) >= self.needed:
            yield from self._scan()

    def finish(self) -> Iterator[Event]:
        """Give up the incomplete frame and search its bytes for others."""
        self.ended = True
        if self.buffer and not self.frame.bare and self.buffer != self._flag():
            yield Event("truncated", self.at, self.start, self.buffer)
            self._advance(1)
        yield from self._scan()
        yield from self._report()

    def _scan(self) -> Iterator[Event]:
        while self.buffer:
            if self.swallow:
                self.swallow = False
                if self.frame.stuffing and self.buffer[0] == self.frame.stuffing.insert:
                    self._advance(1)
                    continue
            try:
                event, size, self.swallow = self.attempt()
            except NeedMore as more:
                if not self.ended:
                    self.needed = more.size
                    return
                yield from self._drop(Refused("truncated", told=False))
            except Refused as refused:
                if refused.kind == "empty" and self.frame.bare:
                    yield from self._report()
                    self._advance(refused.size)
                    self.lost = False
                else:
                    yield from self._drop(refused)
            else:
                yield from self._report()
                yield event
                self._advance(size)

    def _line_end(self) -> bytes:
        """The terminator, if a frame can begin only after it."""
        end, frame = self.frame.terminator, self.frame
        if end is None or not frame.bare or frame.checks or frame.parts[-1] is not end:
            return b""
        paired = len(end.constant) > 1 and frame.begins_pair(end.constant[0])
        return b"" if paired else end.constant

    def _flag(self) -> bytes:
        """The bytes that end a frame, if they also begin one."""
        end = self.frame.terminator.constant if self.frame.terminator else b""
        return end if self.frame.parts[0].constant == end else b""

    def _advance(self, size: int) -> None:
        self.buffer, self.start, self.needed = self.buffer[size:], self.start + size, 0

    def _drop(self, refused: Refused) -> Iterator[Event]:
        if self.frame.bare:
            self.skipped += self.buffer[:1]
        elif refused.told:
            yield Event(refused.kind, self.at, self.start, self.buffer[: refused.size])
        self._advance(1)
        self.lost = bool(self._line_end())
        if len(self.skipped) == self.frame.longest:
            yield from self._report()

    def _report(self) -> Iterator[Event]:
        """Consecutive skipped bytes as one fault."""
        if self.skipped:
            yield Event("frame", self.at, self.start - len(self.skipped), self.skipped)
        self.skipped = b""

    def attempt(self) -> tuple[Event, int, bool]:
        """The frame at the beginning: its event, its size, and whether an inserted byte may follow."""
        if self.lost and not self.buffer.startswith(self._line_end()):
            if self._line_end().startswith(self.buffer):
                raise NeedMore
            raise Refused("unknown")
        cut = self.splitter.split(self.buffer)
        event = self._event(cut, self._plain(cut))
        always = [each for each in self.frame.checks if each.name not in self.frame.tests]
        unproven = not (always or self.frame.blocks) or (self.frame.seeded and event.kind == "unknown")
        if self._damaged(cut) or (event.kind != "message" and unproven):
            # It may not be a frame at all, so another one may begin after its first byte.
            raise Refused(event.kind, cut.size)
        return event, cut.size - cut.kept, cut.pending

    def _plain(self, cut: Cut) -> bytes:
        """Decode the payload. Raises Refused."""
        payload, stuffing = cut.parts[self.frame.by_role["payload"].name], self.frame.stuffing
        payload = bytes((byte - self.frame.plus) % 256 for byte in payload)
        if stuffing is None or not stuffing.payload_alone:
            return payload
        try:
            plain = stuffing.unstuff(payload)
        except Wrong:
            raise Refused("stuffing", cut.size) from None
        if len(plain) > self.frame.most:
            raise Refused("length", cut.size)
        return plain

    def _damaged(self, cut: Cut) -> bool:
        """Whether a check value of the frame is wrong."""
        message = self.known.get(self.frame.number("message", cut.parts) or 0)
        return self.frame.check_fails(cut.parts, self.frame.seeds.get(message.number, {}) if message else {})

    def _event(self, cut: Cut, payload: bytes) -> Event:
        raw = self.buffer[: cut.size]
        number, address = (self.frame.number(role, cut.parts) for role in ("message", "address"))
        message = self.known.get(number or 0)
        if self._damaged(cut):
            return Event("crc", self.at, self.start, raw)
        beside = partial(self.frame.values, cut.parts)
        return self.carried(message, address, lambda: payload, self.start, raw, beside=beside)


class Listener(Receiver):
    """What lies between two silences is a frame or one fault."""

    def __init__(self, frame: Frame, known: Mapping[int, Message]) -> None:
        """Hear nothing."""
        super().__init__(known)
        self.frame, self.raw, self.lost = frame, b"", False

    def take(self, byte: int) -> Iterator[Event]:
        """One step."""
        self.raw += b"" if self.lost else bytes([byte])
        if len(self.raw) > self.frame.longest:
            yield Event("length", self.at, self.at + 1 - len(self.raw), self.raw)
            self.raw, self.lost = b"", True

    def finish(self) -> Iterator[Event]:
        """A silence."""
        if not self.raw:
            return
        offset = self.at - len(self.raw)
        whole = Searcher(self.frame, self.known)
        whole.at, whole.start = self.at, offset
        try:
            yield whole.whole(self.raw)
        except Wrong as wrong:
            yield Event(wrong.kind, self.at, offset, self.raw)


class MarkedReceiver(Receiver):
    """Header and end have a marker bit that the bytes between them lack."""

    def __init__(self, frame: Marked, known: Mapping[int, Message]) -> None:
        """Idle."""
        super().__init__(known)
        self.frame = frame
        self.raw, self.lost = b"", False

    def take(self, byte: int) -> Iterator[Event]:
        """One step."""
        marked = bool(byte & self.frame.marker)
        if marked and not self.frame.is_end(byte):
            if self.raw:
                yield Event("frame", self.at, self.at - len(self.raw), self.raw)
            self.raw, self.lost = bytes([byte]), False
        elif self.raw:
            yield from self._inside(byte, ended=marked)
        elif not self.lost:
            self.lost = True
            yield Event("frame", self.at, self.at, bytes([byte]))

    def _inside(self, byte: int, *, ended: bool) -> Iterator[Event]:
        raw = self.raw + bytes([byte])
        self.raw = b"" if ended else raw
        if not ended and len(raw) - 1 <= self.frame.most + self.frame.check_size:
            return
        if not ended:
            self.raw, self.lost = b"", True
            yield Event("frame", self.at, self.at + 1 - len(raw), raw)
            return
        yield self.ended(raw)

    def ended(self, raw: bytes) -> Event:
        """The event of the bytes from a header to an end."""
        offset = self.at + 1 - len(raw)
        try:
            message, address, payload = self.frame.opened(raw, self.known)
        except Wrong as wrong:
            return Event(wrong.kind, self.at, offset, raw)
        return self.carried(message, address, lambda: payload, offset, raw)

    def finish(self) -> Iterator[Event]:
        """An unfinished message is truncated."""
        if self.raw:
            yield Event("truncated", self.at, self.at - len(self.raw), self.raw)


class PacketReceiver(Receiver):
    """The first byte of a request determines its size, the request that of its response."""

    def __init__(
        self, frame: Packets, known: Mapping[int, Message], asked: Sequence[bytes], *, answers: bool
    ) -> None:
        """Start between packets; `asked` are the requests whose responses follow in order."""
        super().__init__(known)
        self.frame, self.answers = frame, answers
        self.asked = [request for request in asked if request[0] in known]
        self.raw = b""

    def take(self, byte: int) -> Iterator[Event]:
        """One step."""
        self.raw += bytes([byte])
        request = b""
        if self.answers and not self.asked:
            yield Event("frame", self.at, self.at, self.raw)
            self.raw = b""
            return
        if self.answers:
            request = self.asked[0]
        message = self.known.get((request or self.raw)[0])
        if message is None or len(self.raw) == self.frame.size(message):
            raw, self.raw, self.asked = self.raw, b"", self.asked[1:]
            yield self.carried(message, None, lambda: self._opened(raw, request), self.at + 1 - len(raw), raw)

    def _opened(self, raw: bytes, request: bytes) -> bytes:
        return self.frame.opened(self.known[(request or raw)[0]], raw, request)

    def finish(self) -> Iterator[Event]:
        """An unfinished packet is truncated."""
        if self.raw:
            yield Event("truncated", self.at, self.at - len(self.raw), self.raw)
