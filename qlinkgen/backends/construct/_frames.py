"""Frames: from the bytes on the wire to a Container of message, address and fields, and back.

The address stands under the name that the protocol gives it. A DelimitedFrame has a Layout of Parts, a
MarkedFrame a marker bit; RequestPacket and ResponsePacket have nothing around the message at all. Nobody but
this code fills in or checks a length, an inserted byte or a check value.
"""

# ruff: noqa: ARG002, SLF001  # construct gives every method the same arguments, and calls its parts by _name

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from construct import (
    Construct,
    ConstructError,
    Container,
    RangeError,
    StreamError,
    TerminatedError,
    ValidationError,
    stream_read_entire,
    stream_write,
)

from ._fields import Message


class FrameError(ConstructError):
    """Bytes that are no frame.

    Attributes:
        kind: crc, stuffing, length, range, unknown, truncated, frame, or illegal for a refused command.
    """

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(f"{kind}: {message}")
        self.kind = kind


class CRC(NamedTuple):
    """A cyclic redundancy check by its catalogue parameters, computed bit by bit as they are defined."""

    width: int
    poly: int
    init: int
    refin: bool
    refout: bool
    xorout: int

    def compute(self, data: Iterable[int]) -> int:
        """The check value of some bytes."""
        register = self.init
        for byte in data:
            for bit in range(8) if self.refin else reversed(range(8)):
                feedback = register >> self.width - 1 ^ byte >> bit & 1
                register = register << 1 & (1 << self.width) - 1
                if feedback:
                    register ^= self.poly
        if self.refout:
            register = int(f"{register:0{self.width}b}"[::-1], 2)
        return register ^ self.xorout


class Sum(NamedTuple):
    """The sum of bytes or words, cut to a number of bits, inverted at last if it is a complement."""

    width: int
    complement: bool = False

    def compute(self, data: Iterable[int]) -> int:
        """The check value of some bytes or words."""
        total = sum(data)
        return (~total if self.complement else total) & (1 << self.width) - 1


class Check(NamedTuple):
    """How a check value is computed and sent; bits outside of ``mask`` are neither sent nor compared."""

    algorithm: CRC | Sum
    integer: Any
    mask: int

    def value(self, data: Iterable[int]) -> bytes:
        """The check value as it is sent."""
        return bytes(self.integer.build(self.algorithm.compute(data) & self.mask))

    def sizeof(self) -> int:
        """Bytes on the wire."""
        return int(self.integer.sizeof())


# Frames


class Frame(Construct):
    """Takes all bytes that it is given as one frame of one of its messages."""

    address_name = ""

    def __init__(self, messages: Iterable[Message]) -> None:
        super().__init__()
        self.by_name = {message.name: message for message in messages}
        self.by_id = {message.id: message for message in self.by_name.values()}

    def seal(self, number: int, payload: bytes, address: int = 0, request: bytes = b"") -> bytes:
        """The frame of a message id and a payload, whatever they are."""
        raise NotImplementedError

    def _build(self, obj: Any, stream: Any, context: Any, path: Any) -> Any:
        message = self.by_name.get(obj["message"])
        if message is None:
            raise ValidationError(f"there is no message {obj['message']!r} in this direction", path=path)
        address = obj[self.address_name] if self.address_name else 0
        if not _allowed(message, address):
            raise ValidationError(
                f"{message.name} cannot be sent to {self.address_name} {address!r}", path=path
            )
        payload = message.build(obj.get("fields") or {})
        wire = self.seal(message.id, payload, address, context._params.get("request", b""))
        stream_write(stream, wire, len(wire), path)
        return obj

    def _known(self, number: int) -> Message:
        if number not in self.by_id:
            raise FrameError("unknown", f"no message has the id {number:#04x}")
        return self.by_id[number]

    def _result(self, message: Message, payload: bytes, address: int = 0) -> Any:
        """The last step of parsing: what remains are the values."""
        if not _allowed(message, address):
            raise FrameError("range", f"{message.name} is never sent to {self.address_name} {address}")
        try:
            fields = message.parse(payload)
        except (RangeError, StreamError, TerminatedError) as error:
            raise FrameError("length", f"{len(payload)} bytes are no payload; {error}") from None
        except ConstructError as error:
            raise FrameError("range", f"{message.name}; {error}") from None
        place = {self.address_name: address} if self.address_name else {}
        return Container(message=message.name, **place, fields=fields)


def messages_of(*frames: Frame) -> dict[str, Message]:
    """The messages of all frames by their full names."""
    return {name: message for frame in frames for name, message in frame.by_name.items()}


def _allowed(message: Message, address: Any) -> bool:
    if not message.addresses:
        return True
    return isinstance(address, int) and any(first <= address <= last for first, last in message.addresses)


class Part(NamedTuple):
    """A run of bytes of a frame: of one of the roles constant, length, id, address, payload and check.

    The content is a constant's bytes, an integer, the payload's (fewest, most) bytes, or a Check;
    ``over`` names the parts that a length counts or a check value covers.
    """

    name: str
    role: str
    content: Any
    over: Sequence[str] = ()

    @property
    def size(self) -> int:
        """Bytes before stuffing, 0 for the payload."""
        if self.role == "payload":
            return 0
        return len(self.content) if self.role == "constant" else int(self.content.sizeof())


class Stuffing(NamedTuple):
    """A byte inserted after each occurrence of others.

    ``exempt`` parts, at the frame's front or end, are not stuffed. With ``payload_only`` only the payload is,
    before length and check value are computed.
    """

    after: bytes
    insert: bytes
    exempt: Sequence[str] = ()
    payload_only: bool = False

    def add(self, data: bytes) -> bytes:
        """With the inserted bytes."""
        return data.replace(self.after, self.after + self.insert)

    def remove(self, data: bytes) -> bytes:
        """Without them. The last may be missing: it says nothing that the frame's size does not say."""
        runs, at = [], 0
        while (found := data.find(self.after, at)) >= 0:
            end = found + len(self.after)
            if data[end : end + 1] not in (self.insert, b""):
                raise FrameError(
                    "stuffing", f"{data[end]:#04x} follows {self.after.hex()}, not {self.insert.hex()}"
                )
            runs.append(data[at:end])
            at = end + 1
        return b"".join([*runs, data[at:]])


class Layout:
    """Parts of a frame in wire order, and its stuffing."""

    def __init__(self, *parts: Part, stuffing: Stuffing | None = None) -> None:
        self.parts = parts
        self.stuffing = stuffing
        self.roles = {part.role: part for part in parts}
        self.bounds: tuple[int, int] = self.roles["payload"].content
        self.overhead = sum(part.size for part in parts)

    def counted(self) -> int:
        """What the length says of an empty payload."""
        return sum(part.size for part in self.parts if part.name in self.roles["length"].over)

    def assemble(self, payload: bytes, **integers: int) -> bytes:
        """The frame of a payload as it is on the wire; ``integers`` are the id and the address."""
        if self.stuffing and self.stuffing.payload_only:
            payload = self.stuffing.add(payload)
        if "length" in self.roles:
            integers["length"] = self.counted() + len(payload)
        pieces: dict[str, bytes] = {}
        for part in self.parts:
            if part.role in integers:
                pieces[part.name] = part.content.build(integers[part.role])
            else:
                pieces[part.name] = {"constant": part.content, "payload": payload}.get(part.role, b"")
        if "check" in self.roles:
            pieces[self.roles["check"].name] = self.check(pieces)
        return self.stuffed(pieces)

    def check(self, pieces: Mapping[str, bytes]) -> bytes:
        """The check value of a frame in pieces."""
        part = self.roles["check"]
        return bytes(part.content.value(b"".join(data for name, data in pieces.items() if name in part.over)))

    def stuffed(self, pieces: Mapping[str, bytes]) -> bytes:
        """A frame in pieces as it is on the wire."""
        data = b"".join(pieces.values())
        if self.stuffing is None or self.stuffing.payload_only:
            return data
        front, back = self.exempt()
        return data[:front] + self.stuffing.add(data[front : len(data) - back]) + data[len(data) - back :]

    def unstuffed(self, wire: bytes) -> bytes:
        """Bytes on the wire without the inserted ones, unless only the payload is stuffed."""
        if self.stuffing is None or self.stuffing.payload_only:
            return wire
        front, back = self.exempt()
        end = max(len(wire) - back, front)
        return wire[:front] + self.stuffing.remove(wire[front:end]) + wire[end:]

    def exempt(self) -> tuple[int, int]:
        """Bytes at the front and at the end that are never stuffed."""
        names = self.stuffing.exempt if self.stuffing else ()
        stuffed = [index for index, part in enumerate(self.parts) if part.name not in names]
        front = sum(part.size for part in self.parts[: stuffed[0]])
        return front, sum(part.size for part in self.parts[stuffed[-1] + 1 :])

    def split(self, data: bytes) -> dict[str, bytes]:
        """An unstuffed frame in pieces."""
        pieces, at = {}, 0
        for part in self.parts:
            size = len(data) - self.overhead if part.role == "payload" else part.size
            pieces[part.name] = data[at : at + size]
            at += size
        return pieces


class DelimitedFrame(Frame):
    """A frame whose end follows from its length, or from what is inside."""

    def __init__(self, layout: Layout, messages: Iterable[Message]) -> None:
        super().__init__(messages)
        self.layout = layout
        self.address_name = layout.roles["address"].name if "address" in layout.roles else ""

    def seal(self, number: int, payload: bytes, address: int = 0, request: bytes = b"") -> bytes:
        """The frame of a message id and a payload, whatever they are."""
        return self.layout.assemble(payload, id=number, address=address)

    def _parse(self, stream: Any, context: Any, path: Any) -> Any:
        layout, wire = self.layout, stream_read_entire(stream, path)
        if layout.stuffing is None or layout.exempt()[0]:
            self._check_front(wire)
        data = layout.unstuffed(wire)
        self._check_front(data)  # what is stuffed itself can be told only now
        if len(data) < layout.overhead:
            raise FrameError("truncated", f"{len(data)} bytes, and a frame has {layout.overhead} at least")
        self._check_length(data)
        pieces = layout.split(data)
        self._check_pieces(pieces)
        payload = pieces[layout.roles["payload"].name]
        if layout.stuffing and layout.stuffing.payload_only:
            payload = layout.stuffing.remove(payload)
        integers = {
            role: part.content.parse(pieces[part.name])
            for role, part in layout.roles.items()
            if role in ("id", "address")
        }
        return self._result(self._known(integers["id"]), payload, integers.get("address", 0))

    def _check_front(self, wire: bytes) -> None:
        """What stands there before anything else tells whether this is a frame at all."""
        first = self.layout.parts[0]
        if first.role == "constant" and not wire.startswith(first.content):
            kind = "truncated" if first.content.startswith(wire) else "frame"
            raise FrameError(kind, f"does not begin with {first.content.hex()}")

    def _check_length(self, data: bytes) -> None:
        layout = self.layout
        if "length" not in layout.roles:
            return
        part = layout.roles["length"]
        at = sum(each.size for each in layout.parts[: layout.parts.index(part)])
        claimed = part.content.parse(data[at : at + part.size]) - layout.counted()
        found, (fewest, most) = len(data) - layout.overhead, layout.bounds
        if not fewest <= claimed <= most or claimed < found:
            raise FrameError(
                "length", f"claims {claimed} payload bytes of {fewest}..{most}, {found} are here"
            )
        if claimed > found:
            raise FrameError("truncated", f"claims {claimed} payload bytes, {found} are here")

    def _check_pieces(self, pieces: Mapping[str, bytes]) -> None:
        for part in self.layout.parts:
            if part.role == "constant" and pieces[part.name] != part.content:
                raise FrameError(
                    "frame", f"{part.name} is {pieces[part.name].hex()}, not {part.content.hex()}"
                )
        if "check" in self.layout.roles:
            sent, expected = pieces[self.layout.roles["check"].name], self.layout.check(pieces)
            if sent != expected:
                raise FrameError("crc", f"{sent.hex()} was sent, {expected.hex()} expected")


class MarkedFrame(Frame):
    """A frame between a header and an end byte that carry a marker bit, which no other byte has.

    ``address_bits`` and ``id_bits`` are (first bit, number of bits) in both bytes, ``end`` is the end's id.
    """

    def __init__(
        self,
        messages: Iterable[Message],
        *,
        marker: int,
        address_bits: tuple[int, int],
        id_bits: tuple[int, int],
        end: int,
        address_name: str,
        check: Check | None = None,
    ) -> None:
        super().__init__(messages)
        self.marker = marker
        self.address_bits, self.id_bits = address_bits, id_bits
        self.end = end
        self.address_name = address_name
        self.check = check

    def _edge(self, address: int, number: int) -> bytes:
        return bytes([self.marker | address << self.address_bits[0] | number << self.id_bits[0]])

    def seal(self, number: int, payload: bytes, address: int = 0, request: bytes = b"") -> bytes:
        """The frame of a message id and a payload, whatever they are."""
        message = self.by_id.get(number)
        check = self.check.value(payload) if self.check and message and message.checksum else b""
        return self._edge(address, number) + payload + check + self._edge(address, self.end)

    def _parse(self, stream: Any, context: Any, path: Any) -> Any:
        data = stream_read_entire(stream, path)
        if len(data) < 2:
            raise FrameError("truncated", f"{len(data)} bytes, and a frame has 2 at least")
        address, id_ = (
            data[0] >> first & (1 << bits) - 1 for first, bits in (self.address_bits, self.id_bits)
        )
        marked = [index for index, byte in enumerate(data) if byte & self.marker]
        if marked == [0]:
            raise FrameError("truncated", f"{data[-1]:#04x} is no end")
        if marked != [0, len(data) - 1] or data[-1:] != self._edge(address, self.end):
            raise FrameError("frame", f"{data[0]:#04x} to {data[-1]:#04x} are no header, payload and end")
        if id_ not in self.by_id or not _allowed(self.by_id[id_], address):
            raise FrameError("frame", f"no message has the id {id_} and the {self.address_name} {address}")
        return self._checked(self.by_id[id_], data[1:-1], address)

    def _checked(self, message: Message, body: bytes, address: int) -> Any:
        """A size that the message cannot have shows first: then the marks are wrong, not the bytes."""
        size = self.check.sizeof() if self.check and message.checksum else 0
        payload, sent = body[: len(body) - size], body[len(body) - size :]
        expected = self.check.value(payload) if self.check and size else b""
        try:
            result = self._result(message, payload, address)
        except FrameError as error:
            if error.kind == "range" and sent == expected:
                raise
            kind = "frame" if error.kind == "length" else "crc"
            raise FrameError(kind, f"{sent.hex()} was sent, {expected.hex()} expected; {error}") from None
        if sent != expected:
            raise FrameError("crc", f"{sent.hex()} was sent, {expected.hex()} expected")
        return result


class RequestPacket(Frame):
    """A message id and a payload, and nothing around them."""

    def seal(self, number: int, payload: bytes, address: int = 0, request: bytes = b"") -> bytes:
        """The packet of a message id and a payload, whatever they are."""
        return bytes([number]) + payload

    def _parse(self, stream: Any, context: Any, path: Any) -> Any:
        data = stream_read_entire(stream, path)
        if not data:
            raise FrameError("truncated", "there are no bytes")
        return self._result(self._known(data[0]), data[1:])


class ResponsePacket(Frame):
    """A payload and a check value over both packets; parse and build are given ``request``, its bytes.

    The check value ``rejected`` says that the command is not known, unless it is the one expected.
    """

    def __init__(
        self,
        messages: Iterable[Message],
        *,
        check: Check | None = None,
        word: int = 2,
        rejected: int | None = None,
    ) -> None:
        super().__init__(messages)
        self.check = check
        self.word = word
        self.rejected = rejected

    def seal(self, number: int, payload: bytes, address: int = 0, request: bytes = b"") -> bytes:
        """The packet of a payload, whatever it is; the id is in the request."""
        return payload + self._sum(request, payload)

    def _sum(self, request: bytes, payload: bytes) -> bytes:
        if self.check is None:
            return b""
        words = request[1:] + payload
        units = (words[at : at + self.word] for at in range(0, len(words), self.word))
        return self.check.value([request[0], *(int.from_bytes(unit, "big") for unit in units)])

    def _parse(self, stream: Any, context: Any, path: Any) -> Any:
        data, request = stream_read_entire(stream, path), context._params.get("request")
        if not request:
            raise FrameError(
                "frame", "an answer means nothing without its request; call parse(data, request=packet)"
            )
        message = self._known(request[0])
        size = self.check.sizeof() if self.check else 0
        payload, sent = data[: len(data) - size], data[len(data) - size :]
        if len(sent) < size:
            raise FrameError("truncated", f"{len(data)} bytes hold no check value of {size}")
        expected = self._sum(request, payload)
        if sent != expected:
            refused = self.rejected is not None and int.from_bytes(sent, "big") == self.rejected
            raise FrameError(
                "illegal" if refused else "crc", f"{sent.hex()} was sent, {expected.hex()} expected"
            )
        return self._result(message, payload)
