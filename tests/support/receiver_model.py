"""What a receiver delivers for a stream of bytes: the reference for Python and C, simple and slow.

Every byte is fed alone. An event says what it is, at which byte it came (`at`), where its frame began
(`offset`) and which wire bytes it stands for (`raw`). Four kinds of frame, four machines:

* `Unique`: stuffing keeps the preamble from appearing inside a frame;
* `Rescan`: any other delimited frame; what is no frame is dropped byte by byte;
* `Marked`: header and end carry a marker bit;
* `Packets`: no frame at all, requests alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from qlinkgen.model.frame import Checksum, DelimitedFrame, MarkedFrame, PacketFrame, Part
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Array, Blob, Scalar
from tests.support.payload_model import Wrong, payload_fault, raw_of


@dataclass(frozen=True, slots=True)
class Event:
    """A frame (`kind` is "message") or a fault."""

    kind: str
    at: int
    offset: int
    raw: bytes
    name: str = ""
    address: int | None = None
    payload: bytes = b""


def receiver(protocol: Protocol, direction: Direction) -> Machine:
    """The machine for a protocol's frames."""
    frame = protocol.frame
    if isinstance(frame, MarkedFrame):
        return Marked(protocol, direction)
    if isinstance(frame, PacketFrame):
        return Packets(protocol, direction)
    return Unique(protocol, direction) if frame.unique_preamble else Rescan(protocol, direction)


class Machine:
    """What the four have in common."""

    def __init__(self, protocol: Protocol, direction: Direction) -> None:
        """Note the messages that can come."""
        self.protocol = protocol
        self.known: dict[int, Message] = {m.id: m for m in protocol.received(direction)}
        self.at = -1

    @property
    def now(self) -> int:
        """Bytes taken so far; `at` points behind the last one once the stream has ended."""
        return self.at if getattr(self, "ending", False) else self.at + 1

    def run(self, stream: bytes) -> list[Event]:
        """The events of a whole stream, what `finish` brings included."""
        return [event for byte in stream for event in self.feed(byte)] + list(self.finish())

    def feed(self, byte: int) -> Iterator[Event]:
        """Take one byte."""
        self.at += 1
        yield from self.take(byte)

    def take(self, byte: int) -> Iterator[Event]:
        """Take one byte; `at` is its number."""
        raise NotImplementedError

    def finish(self) -> Iterator[Event]:
        """Nothing more follows."""
        raise NotImplementedError

    def event(self, kind: str, offset: int, raw: bytes, **more: object) -> Event:
        """An event at the byte taken last."""
        return Event(kind, self.at, offset, bytes(raw), **more)  # type: ignore[arg-type]

    def delivered(self, number: int, address: int | None, payload: bytes, offset: int, raw: bytes) -> Event:
        """An intact frame: the message, or what is wrong with what it carries."""
        message = self.known.get(number)
        if message is None:
            return self.event("unknown", offset, raw)
        fault = payload_fault(message, payload)
        if fault is None and message.addresses and not _allowed(message, address):
            fault = "range"
        if fault:
            return self.event(fault, offset, raw)
        return self.event("message", offset, raw, name=message.name, address=address, payload=bytes(payload))


def _allowed(message: Message, address: int | None) -> bool:
    return any(first <= (address or 0) <= last for first, last in message.addresses)


def _wrong_check(checksum: Checksum, covered: bytes, sent: bytes) -> bool:
    value = checksum.algorithm.compute(covered)
    return any(
        byte != value >> chunk.shift & chunk.mask for byte, chunk in zip(sent, checksum.chunks, strict=True)
    )


class Delimited(Machine):
    """Parts of a delimited frame, cut out of its unstuffed bytes."""

    def __init__(self, protocol: Protocol, direction: Direction) -> None:
        """Note the frame."""
        super().__init__(protocol, direction)
        assert isinstance(protocol.frame, DelimitedFrame)
        self.frame = protocol.frame

    def parts(self, data: bytes, payload: int) -> dict[str, bytes]:
        """The bytes of each part of a whole frame."""
        cut: dict[str, bytes] = {}
        at = 0
        for part in self.frame.parts:
            size = payload if part.role == "payload" else part.size
            cut[part.name] = data[at : at + size]
            at += size
        return cut

    def number(self, cut: dict[str, bytes], role: str) -> int | None:
        """The integer of a part."""
        part = self.frame.part(role)  # type: ignore[arg-type]
        return raw_of(part.scalar, cut[part.name]) if part and part.scalar else None

    def check_fails(self, cut: dict[str, bytes]) -> bool:
        """The check value is wrong."""
        part = self.frame.part("checksum")
        if part is None or part.checksum is None:
            return False
        covered = b"".join(cut[name] for name in part.checksum.over)
        return _wrong_check(part.checksum, covered, cut[part.name])

    def bad_constant(self, cut: dict[str, bytes]) -> bool:
        """A constant is not what it must be."""
        return any(cut[part.name] != part.constant for part in self.frame.parts if part.role == "constant")


class Unique(Delimited):
    """The preamble is found nowhere else: each byte is looked at once."""

    def __init__(self, protocol: Protocol, direction: Direction) -> None:
        """Hunt."""
        super().__init__(protocol, direction)
        assert self.frame.stuffing
        self.mark, self.insert = self.frame.stuffing.after[0], self.frame.stuffing.insert
        self.run_of_marks, self.body, self.raw = 0, b"", b""
        self.state = "hunt"

    def take(self, byte: int) -> Iterator[Event]:
        """One step of the machine."""
        if self.state == "hunt":
            yield from self._hunt(byte)
        elif self.state == "escape":
            yield from self._behind_mark(byte)
        else:
            self.state = "escape" if byte == self.mark else "body"
            yield from self._body(byte)

    def _hunt(self, byte: int) -> Iterator[Event]:
        if byte == self.mark:
            self.run_of_marks += 1
            return
        marks, self.run_of_marks = self.run_of_marks, 0
        if marks >= 2:
            payload, frame = byte - self.frame.length_bias, self.frame.payload
            self.raw, self.body, self.state = self.frame.preamble, b"", "body"
            if frame.min_size <= payload <= frame.max_size:
                yield from self._body(byte)
            else:
                yield self._fault("length", byte)

    def _fault(self, kind: str, *bytes_: int) -> Event:
        self.state, self.run_of_marks = "hunt", 0
        raw = self.raw + bytes(bytes_)
        return self.event(kind, self.at + 1 - len(raw), raw)

    def _behind_mark(self, byte: int) -> Iterator[Event]:
        if byte == self.insert:
            self.raw += bytes([byte])
            self.state = "body"
        elif byte == self.mark:
            raw = self.raw[:-1]
            yield self.event("truncated", self.at - 1 - len(raw), raw)
            self.state, self.run_of_marks = "hunt", 2
        else:
            yield self._fault("stuffing", byte)

    def _body(self, byte: int) -> Iterator[Event]:
        self.raw += bytes([byte])
        self.body += bytes([byte])
        payload = self.body[0] - self.frame.length_bias
        if len(self.body) + len(self.frame.preamble) < self.frame.overhead + payload:
            return
        offset, raw, data = self.at + 1 - len(self.raw), self.raw, self.frame.preamble + self.body
        self.state, self.run_of_marks = "hunt", int(byte == self.mark)
        cut = self.parts(data, payload)
        if self.bad_constant(cut):
            yield self.event("frame", offset, raw)
        elif self.check_fails(cut):
            yield self.event("crc", offset, raw)
        else:
            number, address = self.number(cut, "message"), self.number(cut, "address")
            yield self.delivered(number or 0, address, cut[self.frame.payload.name], offset, raw)

    def finish(self) -> Iterator[Event]:
        """An unfinished frame is truncated."""
        if self.state != "hunt" or self.run_of_marks >= 2:
            raw = self.raw if self.state != "hunt" else self.frame.preamble
            yield self.event("truncated", self.at + 1 - len(raw), raw)
        self.state, self.run_of_marks = "hunt", 0


class NeedMore(Exception):
    """The bytes that there are may still become a frame."""


class Refused(Exception):
    """No frame begins here: the kind of fault, "" where none is reported, and the bytes it is about."""

    def __init__(self, kind: str, size: int = 1) -> None:
        """Note what a fault tells."""
        super().__init__(kind)
        self.kind, self.size = kind, size


class Rescan(Delimited):
    """Bytes are kept until a frame has proven right; else the search goes on from the next byte."""

    def __init__(self, protocol: Protocol, direction: Direction) -> None:
        """An empty buffer."""
        super().__init__(protocol, direction)
        self.buffer, self.skipped = b"", b""
        self.bare = self.frame.parts[0].role != "constant"
        self.ending = False

    @property
    def most_sent(self) -> int:
        """Most payload bytes that a length may announce, inserted ones included where it counts them."""
        most, stuffing = self.frame.payload.max_size, self.frame.stuffing
        return most + most // len(stuffing.after) if stuffing and stuffing.before_checksum else most

    def take(self, byte: int) -> Iterator[Event]:
        """Everything that the buffer now holds."""
        self.buffer += bytes([byte])
        yield from self._scan()

    def _scan(self) -> Iterator[Event]:
        while self.buffer:
            start = self.now - len(self.buffer)
            try:
                event, used = self._attempt(start)
            except NeedMore:
                if not self.ending:
                    return
                yield from self._drop(Refused(""), start)
            except Refused as refused:
                yield from self._drop(refused, start)
            else:
                yield from self._report(start)
                yield event
                self.buffer = self.buffer[used:]

    def _drop(self, refused: Refused, start: int) -> Iterator[Event]:
        if refused.kind and not self.bare:
            yield self.event(refused.kind, start, self.buffer[: refused.size])
        if self.bare:
            self.skipped += self.buffer[:1]
            if len(self.skipped) == self.frame.overhead + self.most_sent:
                yield from self._report(start + 1)
        self.buffer = self.buffer[1:]

    def _report(self, end: int) -> Iterator[Event]:
        """The bytes skipped in a row, as one fault."""
        if self.skipped:
            yield self.event("frame", end - len(self.skipped), self.skipped)
        self.skipped = b""

    def _attempt(self, start: int) -> tuple[Event, int]:
        """The event of the frame at the front of the buffer, and the bytes it takes."""
        self._header()
        payload = self._payload_size()
        total = self.frame.overhead + payload
        if len(self.buffer) < total:
            raise NeedMore
        cut = self.parts(self.buffer[:total], payload)
        if self.bad_constant(cut):
            raise Refused("")
        content = self._unstuffed(cut[self.frame.payload.name], total)
        if self.check_fails(cut):
            raise Refused("crc", total)
        number, address = self.number(cut, "message"), self.number(cut, "address")
        return self.delivered(number or 0, address, content, start, self.buffer[:total]), total

    def _header(self) -> None:
        at, length_end = 0, 0
        for part in self.frame.parts[: [part.role for part in self.frame.parts].index("payload")]:
            have = self.buffer[at : at + part.size]
            if part.role == "constant" and have != part.constant[: len(have)]:
                raise Refused("")
            at += part.size
            if part.role == "length":
                length_end = at
        if length_end and len(self.buffer) >= length_end:
            self._announced(length_end)
        if len(self.buffer) < self.frame.header_size:
            raise NeedMore
        if self.bare:
            self._admit()

    def _announced(self, length_end: int) -> int:
        number = self.number(self.parts(self.buffer, 0), "length") or 0
        announced = number - self.frame.length_bias
        if not self.frame.payload.min_size <= announced <= self.most_sent:
            raise Refused("length", length_end)
        return announced

    def _admit(self) -> None:
        cut = self.parts(self.buffer, 0)
        number, address = self.number(cut, "message"), self.number(cut, "address")
        message = self.known.get(number or 0)
        if message is None or (message.addresses and not _allowed(message, address)):
            raise Refused("")

    def _payload_size(self) -> int:
        if self.frame.part("length"):
            return self._announced(0)
        message = self.known.get(self.number(self.parts(self.buffer, 0), "message") or 0)
        if message is None:
            raise Refused("unknown", self.frame.header_size)
        return self._extent(message)

    def _extent(self, message: Message) -> int:
        """The payload's size, from its own count."""
        payload, at, extra = self.buffer[self.frame.header_size :], 0, 0
        for field in message.fields:
            kind = field.type
            if isinstance(kind, Scalar) and kind.counts:
                counted = next(other for other in message.fields if other.name == kind.counts).type
                assert isinstance(counted, Array | Blob)
                if counted.length.counted_by == field.name:
                    if len(payload) < at + extra + kind.size:
                        raise NeedMore
                    extra += self._extra(kind, counted, payload[at + extra : at + extra + kind.size])
            at += field.min_size
        return message.min_size + extra

    @staticmethod
    def _extra(count: Scalar, counted: Array | Blob, data: bytes) -> int:
        raw = raw_of(count, data)
        unit = counted.item_size if count.counts_unit == "bytes" else 1
        least, most = counted.length.minimum * unit, counted.length.maximum * unit
        if raw % unit or not least <= raw <= most:
            raise Refused("length")
        return (raw - least) * (counted.item_size // unit)

    def _unstuffed(self, sent: bytes, total: int) -> bytes:
        """The payload without what stuffing added."""
        stuffing = self.frame.stuffing
        if stuffing is None:
            return sent
        content, since, at = b"", 0, 0
        while at < len(sent):
            content += sent[at : at + 1]
            at, since = at + 1, since + 1
            if since >= len(stuffing.after) and content.endswith(stuffing.after):
                if at == len(sent) or sent[at] != stuffing.insert:
                    raise Refused("stuffing", total)
                at, since = at + 1, 0
        return content

    def finish(self) -> Iterator[Event]:
        """The frame that is not complete is given up, and others are looked for in its bytes."""
        self.at += 1
        self.ending = True
        if self.buffer and not self.bare:
            yield self.event("truncated", self.at - len(self.buffer), self.buffer)
            self.buffer = self.buffer[1:]
        yield from self._scan()
        yield from self._report(self.at)
        self.ending = False


class Marked(Machine):
    """Header and end carry a bit that nothing between them has."""

    def __init__(self, protocol: Protocol, direction: Direction) -> None:
        """Idle."""
        super().__init__(protocol, direction)
        assert isinstance(protocol.frame, MarkedFrame)
        self.frame = protocol.frame
        self.most = self.frame.payload_max + (len(self.frame.checksum.chunks) if self.frame.checksum else 0)
        self.state, self.raw = "idle", b""

    def take(self, byte: int) -> Iterator[Event]:
        """One step of the machine."""
        end = byte & self.frame.marker and self._id(byte) == self.frame.end_id
        if byte & self.frame.marker and not end:
            if self.state == "inside":
                yield self.event("frame", self.at - len(self.raw), self.raw)
            self.state, self.raw = "inside", bytes([byte])
        elif self.state == "idle":
            self.state = "hunt"
            yield self.event("frame", self.at, bytes([byte]))
        elif self.state == "inside":
            self.raw += bytes([byte])
            if end:
                yield self._ended()
            elif len(self.raw) - 1 > self.most:
                self.state = "hunt"
                yield self.event("frame", self.at + 1 - len(self.raw), self.raw)

    def _id(self, byte: int) -> int:
        return byte >> self.frame.id_bits.shift & self.frame.id_bits.mask

    def _address(self, byte: int) -> int:
        return byte >> self.frame.address_bits.shift & self.frame.address_bits.mask

    def _ended(self) -> Event:
        raw, offset = self.raw, self.at + 1 - len(self.raw)
        self.state, self.raw = "idle", b""
        message, address = self.known.get(self._id(raw[0])), self._address(raw[0])
        if message is None or address == 0 or self._address(raw[-1]) != address:
            return self.event("frame", offset, raw)
        payload, sent, checksum = raw[1:-1], b"", self.frame.checksum
        if checksum and message.checksum:
            cut = len(payload) - len(checksum.chunks)
            payload, sent = payload[: max(0, cut)], payload[max(0, cut) :]
            if cut < 0:
                return self.event("frame", offset, raw)
        size = len(payload)
        if not message.min_size <= size <= message.max_size and (size or not message.empty_is_default):
            return self.event("frame", offset, raw)
        if checksum and message.checksum and _wrong_check(checksum, payload, sent):
            return self.event("crc", offset, raw)
        return self.delivered(message.id, address, payload, offset, raw)

    def finish(self) -> Iterator[Event]:
        """An unfinished message is truncated."""
        if self.state == "inside":
            yield self.event("truncated", self.at + 1 - len(self.raw), self.raw)
        self.state, self.raw = "idle", b""


class Packets(Machine):
    """A command byte tells how many bytes follow."""

    def __init__(self, protocol: Protocol, direction: Direction) -> None:
        """Between packets."""
        super().__init__(protocol, direction)
        self.raw = b""

    def take(self, byte: int) -> Iterator[Event]:
        """One step of the machine."""
        self.raw += bytes([byte])
        message = self.known.get(self.raw[0])
        if message is None:
            raw, self.raw = self.raw, b""
            yield self.event("unknown", self.at, raw)
        elif len(self.raw) == 1 + message.max_size:
            raw, self.raw = self.raw, b""
            yield self.delivered(raw[0], None, raw[1:], self.at + 1 - len(raw), raw)

    def finish(self) -> Iterator[Event]:
        """An unfinished packet is truncated."""
        if self.raw:
            yield self.event("truncated", self.at + 1 - len(self.raw), self.raw)
        self.raw = b""


__all__ = ["Event", "Machine", "Part", "Wrong", "receiver"]
