"""Frames: parses wire bytes to a Container of message, address and fields, and builds them.

The address has its name in the protocol. A frame is a list of parts. The end of a DelimitedFrame follows from
its length or its message, that of a MarkedFrame from a byte with a marker bit; a Packet has no delimiter.
Frames compute and check lengths, inserted bytes and check values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import BinaryIO, NamedTuple

from construct import (
    Construct,
    ConstructError,
    Container,
    RangeError,
    ValidationError,
    stream_read_entire,
    stream_write,
)

from ._fields import BitFields, Message, Values, bits_of


class FrameError(ConstructError):
    """Bytes are not a valid frame.

    Attributes:
        kind: crc, stuffing, length, range, unknown, truncated, frame, or illegal for a refused command.
    """

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(f"{kind}: {message}")
        self.kind = kind


class NeedsRequest(FrameError):
    """A response without the request that it answers."""

    def __init__(self) -> None:
        text = "a response needs its request: pass request=packet to build and parse"
        super().__init__("unknown", text)


class CRC(NamedTuple):
    """A CRC with the parameters of the catalogue, computed bit by bit according to their definition."""

    width: int
    poly: int
    init: int
    refin: bool
    refout: bool
    xorout: int

    def compute(self, data: Iterable[int]) -> int:
        """The check value of bytes."""
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
    """The sum of bytes or words modulo 2**width; "inverted", or what makes it "zero"."""

    width: int
    form: str = "plain"
    init: int = 0
    #: Every carry is added again.
    carry: bool = False

    def compute(self, data: Iterable[int]) -> int:
        """The check value of bytes or words."""
        total = self.init + sum(data)
        if self.carry:
            total = (total - 1) % 0xFF + 1 if total else 0
        if self.form != "plain":
            total = ~total if self.form == "inverted" else -total
        return total & (1 << self.width) - 1


class Xor(NamedTuple):
    """The exclusive or of bytes, or of pairs of them."""

    init: int = 0
    width: int = 8

    def compute(self, data: Iterable[int]) -> int:
        """The check value of bytes."""
        total = self.init
        for byte in data:
            turned = (total << 8 | total >> 8) & 0xFFFF if self.width == 16 else total
            total = turned ^ byte
        return total


class Fletcher(NamedTuple):
    """The sum of bytes, and above it the sum of the intermediate sums."""

    half: int
    modulus: int
    init: int = 0

    def compute(self, data: Iterable[int]) -> int:
        """The check value of bytes."""
        high, low = divmod(self.init, 1 << self.half)
        for byte in data:
            low = (low + byte) % self.modulus
            high = (high + low) % self.modulus
        return high << self.half | low


# Parts


class Constant(NamedTuple):
    """Constant bytes."""

    name: str
    data: bytes


class Length(NamedTuple):
    """The size of the payload as sent, plus ``bias``, in steps of ``scale`` bytes.

    It is from ``least`` to ``most``, or ``otherwise`` where another length gives a size above that.
    """

    name: str
    integer: Construct
    bias: int
    least: int
    most: int
    scale: int = 1
    otherwise: int | None = None

    def number(self, payload: int) -> int:
        """The length for a size of the payload."""
        number = (payload + self.bias) // self.scale
        if self.otherwise is None or number <= self.most:
            return number
        return self.otherwise

    def holds(self, number: int) -> bool:
        """Whether a frame may have the number."""
        return self.least <= number <= self.most or number == self.otherwise


class Id(NamedTuple):
    """The message id."""

    name: str
    integer: Construct


class Address(NamedTuple):
    """The address."""

    name: str
    integer: Construct


class IdBits(NamedTuple):
    """Bits of an integer with a piece of the message id, from its bit ``at`` on."""

    shift: int
    bits: int
    at: int

    def value(self, number: int, address: int) -> int:
        """The bits of a frame."""
        return number >> self.at & (1 << self.bits) - 1


class AddressBits(NamedTuple):
    """Bits of an integer with the address."""

    shift: int
    bits: int

    def value(self, number: int, address: int) -> int:
        """The bits of a frame."""
        return address


class ConstantBits(NamedTuple):
    """Bits of an integer with one of several values, the first of which is sent."""

    shift: int
    bits: int
    values: Sequence[int]

    def value(self, number: int, address: int) -> int:
        """The bits of a frame."""
        return self.values[0]


class Cell(NamedTuple):
    """An integer whose bits have several roles; ``values`` are those of every frame in them."""

    name: str
    integer: Construct
    slots: Sequence[IdBits | AddressBits | ConstantBits]
    values: BitFields | None = None

    def number(self, number: int, address: int, beside: Values) -> int:
        """The integer for a message id, an address and values of the frame."""
        whole = 0
        if self.values:
            whole = int(self.integer.parse(self.values.build(beside)))
        for slot in self.slots:
            whole |= slot.value(number, address) << slot.shift
        return whole


class Equal(NamedTuple):
    """An integer derived from an earlier part: complemented if ``inverted``, plus ``added``."""

    name: str
    integer: Construct
    of: str
    bits: int
    inverted: bool = False
    added: int = 0

    def number(self, other: int) -> int:
        """The integer for a value of the other."""
        number = ~other if self.inverted else other
        return (number + self.added) & (1 << self.bits) - 1


class Mark(NamedTuple):
    """A byte with the marker bit, the address and the message id, or ``end`` in its place.

    ``address`` and ``id`` are (first bit, number of bits).
    """

    name: str
    marker: int
    address: tuple[int, int]
    id: tuple[int, int]
    end: int | None = None

    def byte(self, number: int, address: int) -> bytes:
        """The byte for a message id and an address."""
        shown = number if self.end is None else self.end
        return bytes([self.marker | address << self.address[0] | shown << self.id[0]])

    def split(self, byte: int) -> tuple[int, int]:
        """The message id and the address in the byte."""
        number, address = (
            byte >> first & (1 << bits) - 1 for first, bits in (self.id, self.address)
        )
        return number, address


class Payload(NamedTuple):
    """The payload, at most ``most`` bytes."""

    name: str
    most: int


class Blocks(NamedTuple):
    """Check values of the blocks of the payload: one after every ``every`` bytes, one after the rest."""

    name: str
    algorithm: CRC | Sum | Xor | Fletcher
    integer: Construct
    mask: int
    every: int

    def values(self, payload: bytes) -> Sequence[bytes]:
        """The wire bytes of the check value of each block."""
        blocks = [
            payload[at : at + self.every] for at in range(0, len(payload), self.every)
        ]
        return [
            bytes(self.integer.build(self.algorithm.compute(block) & self.mask))
            for block in blocks
        ]

    def join(self, payload: bytes) -> bytes:
        """The payload with its check values."""
        values = self.values(payload)
        return b"".join(
            payload[index * self.every : (index + 1) * self.every] + value
            for index, value in enumerate(values)
        )


class Check(NamedTuple):
    """A check value over other parts; bits outside of ``mask`` are neither sent nor compared.

    With ``word`` it is a sum that includes the request: its id, then the words of this size of both packets.
    ``rejected`` is the value that rejects a command, ``otherwise`` the value over no bytes.
    """

    name: str
    algorithm: CRC | Sum | Xor | Fletcher
    integer: Construct
    mask: int
    over: Sequence[str]
    word: int = 0
    rejected: int | None = None
    otherwise: int | None = None
    #: It is sent as hexadecimal digits; those received may be in lower case.
    digits: bool = False
    #: It is sent as decimal digits of the remainder by this, 0 if it is not.
    modulus: int = 0

    def differs(self, cells: Mapping[str, bytes], expected: bytes) -> bool:
        """Whether the received value is another one."""
        sent = cells[self.name]
        return (sent.upper() if self.digits else sent) != expected

    def packed(self, value: int) -> bytes:
        """The wire bytes of a check value."""
        sent = value % self.modulus if self.modulus else value & self.mask
        return bytes(self.integer.build(sent))

    def value(self, cells: Mapping[str, bytes], request: bytes) -> bytes:
        """The wire bytes of the check value of a frame in cells."""
        runs = [cells[name] for name in self.over]
        if self.otherwise is not None and not any(runs):
            return self.packed(self.otherwise)
        if not self.word:
            return self.packed(self.algorithm.compute(b"".join(runs)))
        if not request:
            raise NeedsRequest
        words = [
            run[at : at + self.word]
            for run in (request[1:], *runs)
            for at in range(0, len(run), self.word)
        ]
        return self.packed(
            self.algorithm.compute(
                [request[0], *(int.from_bytes(word, "big") for word in words)]
            )
        )


Part = Constant | Length | Id | Address | Cell | Equal | Mark | Payload | Check | Blocks


def _size(part: Part) -> int:
    """Size before stuffing, 0 for the payload."""
    match part:
        case Constant():
            return len(part.data)
        case Mark():
            return 1
        case Payload() | Blocks():
            return 0
        case Length() | Id() | Address() | Cell() | Equal() | Check():
            return int(part.integer.sizeof())


def _pieces(
    part: Part, whole: type, bits: type
) -> Iterator[tuple[Id | Address | Cell, int, int, int]]:
    """The pieces of a message id or an address in a part: the part, first bit, number of bits, place."""
    match part:
        case Id() | Address() if isinstance(part, whole):
            yield part, 0, 8 * _size(part), 0
        case Cell():
            for slot in part.slots:
                if isinstance(slot, bits):
                    at = slot.at if isinstance(slot, IdBits) else 0
                    yield part, slot.shift, slot.bits, at
        case _:
            pass


class Stuffing(NamedTuple):
    """Inserts a byte after each occurrence of a pattern, in the parts ``over``.

    Without ``over`` the payload is stuffed before length and check value are computed.
    """

    after: bytes
    insert: bytes
    over: Sequence[str] = ()

    def add(self, data: bytes) -> bytes:
        """Add inserted bytes."""
        return data.replace(self.after, self.after + self.insert)

    def remove(self, data: bytes) -> bytes:
        """Remove and check inserted bytes."""
        plain = data.replace(self.after + self.insert, self.after)
        if self.add(plain) != data:
            raise FrameError(
                "stuffing",
                f"{self.insert.hex()} does not follow each {self.after.hex()}",
            )
        return plain


# Frames


class Sending(NamedTuple):
    """What a frame is built from; ``number`` replaces the message id, ``beside`` has values of the frame."""

    message: Message
    payload: bytes
    address: int
    request: bytes
    number: int | None
    beside: Values


class Frame(Construct):
    """One frame with one of its messages; it takes all bytes."""

    def __init__(
        self,
        parts: Sequence[Part],
        messages: Iterable[Message],
        *,
        address: str = "",
        stuffing: Stuffing | None = None,
        hunt: bool = False,
        bare: bool = False,
    ) -> None:
        super().__init__()
        self.parts = parts
        self.by_name = {message.name: message for message in messages}
        self.by_id = {message.id: message for message in self.by_name.values()}
        known = self.by_id.values()
        self.texts = {each.text: each.id for each in known if each.text is not None}
        self.address = address
        self.stuffing = stuffing
        self.hunt = hunt
        self.bare = bare
        self.payload = next(part for part in parts if isinstance(part, Payload))
        self.checks = [part for part in parts if isinstance(part, Check)]

    def overhead(self, message: Message) -> int:
        """Size of the frame of a message without its payload."""
        return sum(
            _size(part)
            for part in self.parts
            if message.checksum or not isinstance(part, Check)
        )

    def wrap(
        self,
        message: Message,
        payload: bytes,
        address: int = 0,
        request: bytes = b"",
        number: int | None = None,
        *,
        beside: Values | None = None,
    ) -> bytes:
        """A frame around a payload, which is not checked; see Sending."""
        sending = Sending(message, payload, address, request, number, beside or {})
        return self._wrap(sending)

    def _wrap(self, sending: Sending) -> bytes:
        message, payload, address, request, number, given = sending
        beside: Values = {**message.settled, **given}
        stuffing = self.stuffing
        shown = self._number(message) if number is None else number
        sent = stuffing.add(payload) if stuffing and not stuffing.over else payload
        cells: dict[str, bytes] = {}
        for part in self.parts:
            if isinstance(part, Cell):
                whole = part.number(shown, address, beside)
                cells[part.name] = bytes(part.integer.build(whole))
                if message.settled and part.values:
                    seen = part.values.parse(cells[part.name])
                    if name := _unsettled(message, seen):
                        number = message.settled[name]
                        text = f"{name} of {message.name} is always {number}"
                        raise ValidationError(text)
            else:
                cells[part.name] = self._cell(part, shown, sent, address, cells)
        cells = self._settled(cells) | message.seeds
        left = self._due(cells) if message.checksum else []
        while left:  # a check value may cover others
            names = {part.name for part in left}
            part = next(part for part in left if names.isdisjoint(part.over))
            cells[part.name] = part.value(cells, request)
            left = [each for each in left if each is not part]
        for blocks in self.parts:
            if isinstance(blocks, Blocks):
                cells[self.payload.name] = blocks.join(cells[self.payload.name])
        inner = [
            part.name for part in self.parts if stuffing and part.name in stuffing.over
        ]
        if stuffing and inner:
            data = b"".join(cells[name] for name in inner)
            cells |= dict.fromkeys(inner, b"") | {inner[0]: stuffing.add(data)}
        return b"".join(cells[part.name] for part in self.parts)

    def _number(self, message: Message) -> int:
        """The number of a message in a frame."""
        return message.id

    def _due(self, cells: Mapping[str, bytes]) -> Sequence[Check]:
        """The check values that a frame has."""
        return self.checks

    def _settled(self, cells: dict[str, bytes]) -> dict[str, bytes]:
        """The parts as sent."""
        return cells

    def _cell(
        self,
        part: Part,
        number: int,
        payload: bytes,
        address: int,
        before: Mapping[str, bytes],
    ) -> bytes:
        match part:
            case Constant():
                return part.data
            case Length():
                return bytes(part.integer.build(part.number(len(payload))))
            case Id():
                return bytes(part.integer.build(number))
            case Address():
                return bytes(part.integer.build(address))
            case Equal():
                return self._equal(part, before)
            case Mark():
                return part.byte(number, address)
            case Payload():
                return payload
            case Cell() | Check() | Blocks():
                return b""

    def _equal(self, part: Equal, cells: Mapping[str, bytes]) -> bytes:
        """The bytes of a derived part."""
        source = next(each for each in self.parts if each.name == part.of)
        assert isinstance(source, Length | Id | Address | Cell)
        other = source.integer.parse(cells[part.of])
        return bytes(part.integer.build(part.number(other)))

    def _build(
        self, obj: Values, stream: BinaryIO, context: Container, path: str
    ) -> Values:
        message = self._named(obj, path)
        address = obj[self.address] if self.address else 0
        if not _allowed(message, address):
            raise ValidationError(
                f"{message.name} cannot have {self.address} {address!r}",
                path=path,
            )
        decided = self.decided(message, obj)
        payload = message.build(obj.get("fields") or {}, decided=decided)
        request = context._params.get("request", b"")
        wire = self.wrap(message, payload, address, request, beside=obj)
        stream_write(stream, wire, len(wire), path)
        return obj

    def decided(self, message: Message, beside: Values) -> dict[str, int]:
        """The raw numbers of values of a frame that decide which fields its payload has."""
        return self._deciding(message, lambda values: bytes(values.build(beside)))

    def _deciding(
        self, message: Message, cell: Callable[[BitFields], bytes]
    ) -> dict[str, int]:
        """These numbers in the bytes of the parts with them."""
        found: dict[str, int] = {}
        for part in self.parts:
            values = part.values if isinstance(part, Cell) else None
            for field in values.fields if values else ():
                if values and field.name in message.decided_by:
                    whole = int(values.integer.parse(cell(values)))
                    field.parse(b"", bits=whole)  # the value is legal
                    found[field.name] = bits_of(field, whole)
        return found

    def _named(self, obj: Values, path: str) -> Message:
        """The message that values are of."""
        message = self.by_name.get(obj["message"])
        if message is None:
            raise ValidationError(
                f"unknown message {obj['message']!r} in this direction", path=path
            )
        return message

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> Container:
        wire = stream_read_entire(stream, path)
        if not wire:
            raise FrameError("truncated", "no data")
        return self._frame(wire, context._params.get("request", b""))

    def _frame(self, wire: bytes, request: bytes) -> Container:
        raise NotImplementedError

    def _compare(
        self, check: Check, cells: Mapping[str, bytes], request: bytes
    ) -> None:
        sent, expected = cells[check.name], check.value(cells, request)
        if check.differs(cells, expected):
            rejected = check.rejected
            refused = rejected is not None and sent == check.packed(rejected)
            kind = "illegal" if refused else "crc"
            raise FrameError(kind, f"received {sent.hex()}, expected {expected.hex()}")

    def _identify(self, cells: Mapping[str, bytes], found: dict[type, int]) -> None:
        """Set message id and address if all of their parts are known."""
        for kind, bits in ((Id, IdBits), (Address, AddressBits)):
            pieces = [each for part in self.parts for each in _pieces(part, kind, bits)]
            known = all(part.name in cells for part, *_ in pieces)
            if known and (pieces or kind is Id):
                found[kind] = 0
            for part, shift, size, at in pieces if known else ():
                number = int(part.integer.parse(cells[part.name])) >> shift
                found[kind] |= (number & (1 << size) - 1) << at

    def _refuse(self, part: Part, cells: Mapping[str, bytes]) -> None:
        """Check a constant, a derived number, or the digits of an address."""
        seen, wrong = cells[part.name], False
        match part:
            case Constant():
                wrong = seen != part.data
            case Cell():
                number = part.integer.parse(seen)
                wrong = any(
                    number >> slot.shift & (1 << slot.bits) - 1 not in slot.values
                    for slot in part.slots
                    if isinstance(slot, ConstantBits)
                )
            case Equal():
                wrong = seen != self._equal(part, cells)
            case Address():
                try:
                    part.integer.parse(seen)
                except ValidationError:
                    wrong = True
            case _:
                pass
        if wrong:
            raise FrameError("frame", f"{part.name} is {seen.hex()}")

    def _known(self, number: int) -> Message:
        if number not in self.by_id:
            raise FrameError("unknown", f"unknown message id {number:#04x}")
        return self.by_id[number]

    def _judged(
        self,
        cells: Mapping[str, bytes],
        number: int,
        payload: bytes,
        address: int = 0,
        request: bytes = b"",
    ) -> Container:
        """Check a frame in cells: check value, message, sizes, values, address. Returns its message."""
        if self.texts:
            number = self._begun(payload)
        found = self.by_id.get(number)
        seeds = found.seeds if found else {}
        unseeded = [check for check in self._due(cells) if not _seeds(check)]
        for check in unseeded if found is None or found.checksum else ():
            self._compare(check, cells, request)
        self._compare_blocks(cells, payload)
        message = self._known(number)
        for check in self.checks:
            if _seeds(check):
                self._compare(check, {**cells, **seeds}, request)
        fields = _parsed(message, payload, self._received(message, cells))
        if not _allowed(message, address):
            raise FrameError(
                "range", f"{message.name} cannot have {self.address} {address}"
            )
        place = {self.address: address} if self.address else {}
        for part in self.parts:
            if isinstance(part, Cell) and part.values:
                try:
                    place |= part.values.parse(cells[part.name])
                except ConstructError as error:
                    raise FrameError("range", f"{part.name}; {error}") from None
        if name := _unsettled(message, place):
            text = f"{name} of {message.name} is not {message.settled[name]}"
            raise FrameError("range", text)
        return Container(message=message.name, **place, fields=fields)

    def _received(self, message: Message, cells: Mapping[str, bytes]) -> dict[str, int]:
        """The numbers in a received frame that decide which fields its payload has."""
        held = {
            id(part.values): cells[part.name]
            for part in self.parts
            if isinstance(part, Cell) and part.values and part.name in cells
        }
        try:
            return self._deciding(message, lambda values: held[id(values)])
        except ConstructError as error:
            raise FrameError("range", f"{message.name}; {error}") from None

    def _begun(self, payload: bytes) -> int:
        """The number of the longest id that a payload begins with, -1 if it has none."""
        texts = self.texts
        if any(each.folded for each in self.by_id.values()):
            payload = payload.upper()
            texts = {text.upper(): number for text, number in texts.items()}
        begun = [text for text in texts if payload.startswith(text)]
        return texts[max(begun, key=len)] if begun else -1

    def _compare_blocks(self, cells: Mapping[str, bytes], payload: bytes) -> None:
        for blocks in self.parts:
            if isinstance(blocks, Blocks):
                values = b"".join(blocks.values(payload))
                if cells[blocks.name] != values:
                    raise FrameError("crc", f"{blocks.name} are not {values.hex()}")


def _unsettled(message: Message, values: Values) -> str:
    """The first value of a frame that is not as the message settles it."""
    wrong = (
        name
        for name, number in message.settled.items()
        if name in values and int(values[name]) != number
    )
    return next(wrong, "")


def _parsed(message: Message, payload: bytes, decided: Mapping[str, int]) -> Container:
    """The fields of a payload; ``decided`` are values of its frame."""
    try:
        return message.parse(payload, decided=decided)
    except RangeError as error:
        text = f"invalid payload of {len(payload)} bytes; {error}"
        raise FrameError("length", text) from None
    except FrameError:
        raise
    except ConstructError as error:
        raise FrameError("range", f"{message.name}; {error}") from None


def _seeds(check: Check) -> list[str]:
    return [name for name in check.over if name.startswith("attribute.")]


def messages_of(*frames: Frame) -> dict[str, Message]:
    """The messages of all frames by their full names."""
    return {
        name: message for frame in frames for name, message in frame.by_name.items()
    }


def _allowed(message: Message, address: object) -> bool:
    if not message.addresses:
        return True
    return isinstance(address, int) and any(
        first <= address <= last for first, last in message.addresses
    )


class _Wire:
    """Reads the bytes of parts, without inserted ones."""

    def __init__(self, data: bytes, stuffing: Stuffing | None, *, hunt: bool) -> None:
        self.data = data
        self.stuffing = stuffing if stuffing and stuffing.over else None
        self.hunt = hunt
        self.at = 0
        self.due = False
        self.recent = b""

    def take(self, part: Part, size: int) -> bytes:
        """The next bytes, as those of a part."""
        taken = b""
        while len(taken) < size:
            if self.due and self.stuffing:
                self._inserted(self.stuffing)
            taken += self._byte()
            if self.stuffing and part.name in self.stuffing.over:
                self.recent = (self.recent + taken[-1:])[-len(self.stuffing.after) :]
                self.due = self.recent == self.stuffing.after
            else:
                self.recent = b""
        return taken

    def _byte(self) -> bytes:
        if self.at == len(self.data):
            raise FrameError("truncated", f"incomplete frame of {self.at} bytes")
        self.at += 1
        return self.data[self.at - 1 : self.at]

    def _inserted(self, stuffing: Stuffing) -> None:
        byte = self._byte()
        if byte != stuffing.insert:
            kind = "truncated" if self.hunt and byte == stuffing.after else "stuffing"
            raise FrameError(
                kind,
                f"{byte.hex()} follows {stuffing.after.hex()}, not {stuffing.insert.hex()}",
            )
        self.due, self.recent = False, b""

    def end(self) -> None:
        """Check that at most an inserted byte follows."""
        due = self.stuffing.insert if self.stuffing and self.due else b""
        if self.data[self.at :] not in (b"", due):
            raise FrameError(
                "length", f"{len(self.data) - self.at} bytes follow the frame"
            )


class DelimitedFrame(Frame):
    """A frame whose end follows from its length, or from its message.

    With ``hunt`` its first bytes occur nowhere else; with ``bare`` it does not begin with a constant, so an
    unknown id or an illegal address is detected first.
    """

    def _wire(self, data: bytes) -> _Wire:
        """The bytes of its parts."""
        return _Wire(data, self.stuffing, hunt=self.hunt)

    def _frame(self, wire: bytes, request: bytes) -> Container:
        source = self._wire(wire)
        cells: dict[str, bytes] = {}
        numbers: dict[type, int] = {}
        self._identify(cells, numbers)
        for part in self.parts:
            if isinstance(part, Payload):
                self._verify(cells)
                cells[part.name] = self._sent(source, part, numbers)
                self._split(source, part, cells, numbers)
            elif isinstance(part, Blocks):
                pass  # taken with the payload
            elif isinstance(part, Constant) and Payload not in numbers:
                cells[part.name] = self._constant(source, part)
            else:
                cells[part.name] = self._taken(source, part, cells)
                if Payload not in numbers:
                    self._header(part, cells, numbers)
        payload = self._plain(cells)
        self._identify(cells, numbers)
        source.end()
        return self._judged(cells, numbers[Id], payload, numbers.get(Address, 0))

    def _taken(self, source: _Wire, part: Part, cells: Mapping[str, bytes]) -> bytes:
        return source.take(part, _size(part))

    def _verify(self, cells: Mapping[str, bytes]) -> None:
        """Verify check values of the header alone."""
        for check in self.checks:
            if {check.name, *check.over} <= cells.keys():
                expected = check.value(cells, b"")
                if check.differs(cells, expected):
                    raise FrameError("crc", f"{check.name} is not {expected.hex()}")

    def _constant(self, source: _Wire, part: Constant) -> bytes:
        for index in range(len(part.data)):
            if source.take(part, 1) != part.data[index : index + 1]:
                raise FrameError("frame", f"{part.name} is not {part.data.hex()}")
        return part.data

    def _header(
        self, part: Part, cells: Mapping[str, bytes], numbers: dict[type, int]
    ) -> None:
        """Check a part of the header."""
        if isinstance(part, Length):
            number = part.integer.parse(cells[part.name])
            if not part.holds(number):
                raise FrameError(
                    "length", f"{part.name} is {number}, not {part.least}..{part.most}"
                )
            numbers[Length] = number * part.scale - part.bias
        self._refuse(part, cells)
        known = len(numbers)
        self._identify(cells, numbers)
        if self.bare and not self.texts and len(numbers) > known and Id in numbers:
            message = self._known(numbers[Id])
            if Address in numbers and not _allowed(message, numbers[Address]):
                raise FrameError(
                    "range", f"{message.name} cannot have address {numbers[Address]}"
                )

    def _sent(self, source: _Wire, part: Payload, numbers: dict[type, int]) -> bytes:
        numbers[Payload] = 0
        if Length in numbers:
            blocks = next(
                (each for each in self.parts if isinstance(each, Blocks)), None
            )
            return source.take(part, 0 if blocks else numbers[Length])
        try:
            return self._known(numbers[Id]).measured(
                lambda size: source.take(part, size)
            )
        except RangeError as error:
            raise FrameError("length", str(error)) from None

    def _split(
        self,
        source: _Wire,
        part: Payload,
        cells: dict[str, bytes],
        numbers: dict[type, int],
    ) -> None:
        """Take a payload with the check values of its blocks."""
        for blocks in self.parts:
            if isinstance(blocks, Blocks):
                cells[blocks.name] = b""
                for at in range(0, numbers[Length], blocks.every):
                    size = min(blocks.every, numbers[Length] - at)
                    cells[part.name] += source.take(part, size)
                    value = source.take(part, int(blocks.integer.sizeof()))
                    cells[blocks.name] += value

    def _plain(self, cells: Mapping[str, bytes]) -> bytes:
        for part in self.parts:
            self._refuse(part, cells)
        payload = cells[self.payload.name]
        if self.stuffing and not self.stuffing.over:
            payload = self.stuffing.remove(payload)
        if len(payload) > self.payload.most:
            raise FrameError(
                "length",
                f"payload of {len(payload)} bytes, expected at most {self.payload.most}",
            )
        return payload


class MarkedFrame(Frame):
    """A frame between a header and an end byte, which have a marker bit that other bytes lack."""

    def _frame(self, wire: bytes, request: bytes) -> Container:
        header, end = self.parts[0], self.parts[-1]
        assert isinstance(header, Mark)
        assert isinstance(end, Mark)
        number, address = header.split(wire[0])
        marks = [at for at, byte in enumerate(wire) if byte & header.marker]
        if marks == [0] and number != end.end:
            raise FrameError("truncated", f"{wire[-1]:#04x} is not an end byte")
        if (
            marks != [0, len(wire) - 1]
            or end.end == number
            or wire[-1:] != end.byte(0, address)
        ):
            raise FrameError(
                "frame",
                f"{wire[0]:#04x} to {wire[-1]:#04x} are not header, payload and end",
            )
        message = self.by_id.get(number)
        if (
            message is None
            or address == 0
            or not message.fits(len(wire) - self.overhead(message))
        ):
            raise FrameError(
                "frame",
                f"no message with id {number}, {self.address} {address}, {len(wire)} bytes",
            )
        size = len(wire) - self.overhead(message)
        cells = {self.payload.name: wire[1 : 1 + size]}
        if self.checks:
            cells[self.checks[0].name] = wire[1 + size : -1]
        return self._judged(cells, number, wire[1 : 1 + size], address)


class Packet(Frame):
    """A message id and a payload, or a payload and a check value over both packets.

    Without an id it is a response: parse and build need ``request``, the packet that it answers.
    """

    def _frame(self, wire: bytes, request: bytes) -> Container:
        has_id = isinstance(self.parts[0], Id)
        if not has_id and not request:
            raise NeedsRequest
        first = (wire if has_id else request)[0]
        message = self._known(first)
        beside = self.overhead(message)
        least = 0 if message.empty_is_default else message.least
        if len(wire) < least + beside:
            raise FrameError(
                "truncated",
                f"{len(wire)} bytes, {message.name} has at least {least + beside}",
            )
        if len(wire) > message.most + beside:
            raise FrameError(
                "length",
                f"{len(wire)} bytes, {message.name} has at most {message.most + beside}",
            )
        cells, at = {}, 0
        for part in self.parts:
            size = len(wire) - beside if isinstance(part, Payload) else _size(part)
            cells[part.name] = wire[at : at + size]
            at += size
        return self._judged(cells, first, cells[self.payload.name], request=request)
