"""A frame as parts in wire order, with sizes, coverage of the check value, end and receiver.

All three kinds of frame have the same kind of plan. The end of a delimited frame follows from a length or
from its message. Header and end of a marked frame are single bytes with a marker bit. The request of a packet
protocol is an id and a payload, its response a payload and a check value.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import assert_never

from qlinkgen.model.frame import ATTRIBUTE, DelimitedFrame, Frame, MarkedFrame, PacketFrame, PartBits, Silence
from qlinkgen.model.frame import Part as StatedPart
from qlinkgen.model.integer import Chunk, Integer, byte_chunks
from qlinkgen.model.message import Direction
from qlinkgen.plan.check import Check
from qlinkgen.plan.coding import Insertion, stage
from qlinkgen.plan.payload import Member
from qlinkgen.plan.transparency import (
    Coded,
    FrameStuffing,
    PayloadStuffing,
    Plain,
    SevenBit,
    Transparency,
)

# Parts ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ConstantPart:
    """Constant bytes, among them a terminator."""

    name: str
    data: bytes

    @property
    def size(self) -> int:
        """Bytes before stuffing."""
        return len(self.data)


@dataclass(frozen=True, slots=True)
class LengthPart:
    """The number of payload bytes as sent, plus ``bias``, in steps of ``scale``; ``least`` to ``most``."""

    name: str
    integer: Integer
    bias: int
    least: int
    most: int
    scale: int = 1

    def number(self, payload: int) -> int:
        """The length for a size of the payload."""
        return (payload + self.bias) // self.scale

    def payload(self, number: int) -> int:
        """The size of the payload for a length."""
        return number * self.scale - self.bias

    @property
    def size(self) -> int:
        """Bytes before stuffing."""
        return self.integer.size


@dataclass(frozen=True, slots=True)
class IdPart:
    """The number of the message."""

    name: str
    integer: Integer

    @property
    def size(self) -> int:
        """Bytes before stuffing."""
        return self.integer.size


@dataclass(frozen=True, slots=True)
class AddressPart:
    """The address of the node: the recipient of a request, the sender of a response."""

    name: str
    integer: Integer

    @property
    def size(self) -> int:
        """Bytes before stuffing."""
        return self.integer.size


@dataclass(frozen=True, slots=True)
class MarkPart:
    """A byte with the marker bit, the address and the number of the message.

    Attributes:
        end_id: the message number that marks an end byte, None in a header.
    """

    name: str
    marker: int
    address_name: str
    address: Chunk
    id_name: str
    id: Chunk
    end_id: int | None

    #: Bytes before stuffing.
    size = 1

    def byte(self, number: int, address: int) -> int:
        """The byte for a message number and an address."""
        shown = number if self.end_id is None else self.end_id
        return self.marker | address << self.address.shift | shown << self.id.shift

    def id_of(self, byte: int) -> int:
        """The message number in the byte."""
        return byte >> self.id.shift & self.id.mask

    def address_of(self, byte: int) -> int:
        """The address in the byte."""
        return byte >> self.address.shift & self.address.mask


@dataclass(frozen=True, slots=True)
class PayloadPart:
    """The payload: minimum and maximum size before stuffing, and maximum size as a length counts it.

    Attributes:
        trim: bytes that are sent at least where zeros at the end are not, None if all are sent.
    """

    name: str
    least: int
    most: int
    most_sent: int
    trim: int | None = None

    #: Size of an empty payload.
    size = 0


@dataclass(frozen=True, slots=True)
class CheckPart:
    """The check value."""

    name: str
    check: Check

    @property
    def size(self) -> int:
        """Bytes before stuffing."""
        return self.check.size


@dataclass(frozen=True, slots=True)
class BlocksPart:
    """Check values of the blocks of the payload: one follows every ``every`` bytes of it, one the rest."""

    name: str
    check: Check
    every: int

    #: Bytes for an empty payload.
    size = 0

    def blocks(self, payload: bytes) -> list[bytes]:
        """The blocks of a payload."""
        return [payload[at : at + self.every] for at in range(0, len(payload), self.every)]

    def values(self, payload: bytes) -> bytes:
        """The check values of a payload."""
        return b"".join(self.check.pack(self.check.of(block)) for block in self.blocks(payload))

    def join(self, payload: bytes, values: bytes) -> bytes:
        """A payload and its check values as sent."""
        size = self.check.size
        return b"".join(
            block + values[index * size : (index + 1) * size]
            for index, block in enumerate(self.blocks(payload))
        )

    def added(self, payload: int) -> int:
        """Bytes of the check values of a payload of so many bytes."""
        return -(-payload // self.every) * self.check.size

    def plain(self, sent: int) -> int:
        """Bytes of a payload that takes so many bytes with its check values; a cut one counts."""
        whole = self.every + self.check.size
        return sent // whole * self.every + min(self.every, sent % whole)


@dataclass(frozen=True, slots=True)
class Seed:
    """Bytes that a check value covers but that are not sent: a numeric attribute of the message."""

    attribute: str


@dataclass(frozen=True, slots=True)
class IdSlot:
    """Bits with a piece of the message number, which begins at its bit ``at``."""

    shift: int
    bits: int
    at: int


@dataclass(frozen=True, slots=True)
class AddressSlot:
    """Bits with the address of the node."""

    shift: int
    bits: int

    #: Place in the address.
    at = 0


@dataclass(frozen=True, slots=True)
class ConstantSlot:
    """Bits with one of several legal numbers, the first of which is sent."""

    shift: int
    bits: int
    values: tuple[int, ...]

    def holds(self, number: int) -> bool:
        """Whether the bits of the integer have a legal value."""
        return number >> self.shift & (1 << self.bits) - 1 in self.values


#: Bits of an integer of a frame; a member is a value of every frame.
Slot = IdSlot | AddressSlot | ConstantSlot | Member


@dataclass(frozen=True, slots=True)
class CellPart:
    """An integer whose bits have several roles; bits without one are sent as 0 and ignored when received."""

    name: str
    integer: Integer
    slots: tuple[Slot, ...]

    @property
    def size(self) -> int:
        """Bytes before stuffing."""
        return self.integer.size

    @property
    def constants(self) -> tuple[ConstantSlot, ...]:
        """The constants among its bits."""
        return tuple(slot for slot in self.slots if isinstance(slot, ConstantSlot))

    @property
    def values(self) -> tuple[Member, ...]:
        """The values among its bits."""
        return tuple(slot for slot in self.slots if isinstance(slot, Member))


@dataclass(frozen=True, slots=True)
class EqualPart:
    """An integer derived from an earlier one of the same size: inverted or not, plus ``added``."""

    name: str
    integer: Integer
    of: LengthPart | IdPart | AddressPart | CellPart
    inverted: bool
    added: int

    @property
    def size(self) -> int:
        """Bytes before stuffing."""
        return self.integer.size

    def value(self, number: int) -> int:
        """The integer for a value of the other."""
        return ((~number if self.inverted else number) + self.added) & self.integer.mask


@dataclass(frozen=True, slots=True)
class Bits:
    """Where bits of a message number or an address travel: in a part from bit ``shift`` on.

    Attributes:
        at: their first bit in the number.
    """

    part: IdPart | AddressPart | CellPart
    shift: int
    bits: int
    at: int

    @property
    def whole(self) -> bool:
        """Whether the part holds them alone."""
        return self.bits == self.part.integer.bits

    @property
    def mask(self) -> int:
        """Mask of the bits, before they are shifted into place."""
        return (1 << self.bits) - 1


def gathered(pieces: tuple[Bits, ...], cells: Mapping[str, bytes]) -> int | None:
    """The number or address in the bytes of parts; None if a piece is missing."""
    number = 0
    for bits in pieces:
        data = cells.get(bits.part.name, b"")
        if len(data) < bits.part.size:
            return None
        number |= (bits.part.integer.unpack(data) >> bits.shift & bits.mask) << bits.at
    return number


Numeric = LengthPart | IdPart | AddressPart | CellPart | EqualPart
Part = ConstantPart | Numeric | MarkPart | PayloadPart | CheckPart | BlocksPart


# The end of a frame -----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ByLength:
    """A length gives the number of payload bytes."""

    part: LengthPart


@dataclass(frozen=True, slots=True)
class ByMessage:
    """The size of the payload follows from the message and its counts."""


@dataclass(frozen=True, slots=True)
class ByMark:
    """The next byte with the marker bit ends the payload."""

    header: MarkPart
    end: MarkPart


@dataclass(frozen=True, slots=True)
class ByTerminator:
    """Bytes that do not occur before end the frame; ``after`` bytes of other parts follow them.

    Attributes:
        part: the terminator, one of the parts after the payload.
        shared: it may also begin the next frame.
        paired: the byte that begins it, and pairs of coded bytes; None if one of its bytes cannot occur.
    """

    part: ConstantPart
    after: int
    shared: bool
    paired: int | None = None

    def find(self, wire: bytes, first: int, limit: int) -> int:
        """The offset of the terminator that is wholly between two offsets, -1 if there is none."""
        if self.paired is None:
            return wire.find(self.part.data, first, limit)
        at = wire.find(self.part.data[:1], first, limit - 1)
        while at >= 0 and wire[at : at + 2] != self.part.data:
            at = wire.find(self.part.data[:1], at + 2, limit - 1)
        return at


End = ByLength | ByMessage | ByMark | ByTerminator


# How a receiver finds frames --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Hunt:
    """The preamble occurs nowhere else: each byte is processed once, and only the frame itself is buffered.

    Attributes:
        mark: the byte that the preamble consists of, twice; inside a frame ``insert`` follows it.
    """

    mark: int
    insert: int


@dataclass(frozen=True, slots=True)
class Rescan:
    """An apparent start of a frame may be data: after a failed attempt the search continues at the next byte.

    Attributes:
        bare: frames do not begin with a constant, so only a known message number and an allowed address
            distinguish them from noise.
        verified: frames have a check value, so one with a valid check value is consumed even if its contents
            are wrong.
        seeded: the check value covers a seed, so it cannot be verified if the message is unknown.
    """

    bare: bool
    verified: bool
    seeded: bool = False

    def proves(self, kind: str) -> bool:
        """Whether a frame with a fault of this kind is certain to be one."""
        return self.verified and kind != "crc" and not (self.seeded and kind == "unknown")


@dataclass(frozen=True, slots=True)
class Marks:
    """Header and end have a marker bit that all other bytes lack."""


@dataclass(frozen=True, slots=True)
class InStep:
    """Frames have no delimiter: both sides must stay in step."""


Receiver = Hunt | Rescan | Marks | InStep


# Envelopes --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Envelope:
    """The parts of a frame in wire order, before stuffing."""

    parts: tuple[Part, ...]

    @cached_property
    def payload_at(self) -> int:
        """Index of the payload among the parts."""
        return next(index for index, part in enumerate(self.parts) if isinstance(part, PayloadPart))

    @property
    def payload(self) -> PayloadPart:
        """The payload."""
        part = self.parts[self.payload_at]
        assert isinstance(part, PayloadPart)
        return part

    @property
    def front(self) -> tuple[Part, ...]:
        """Parts before the payload."""
        return self.parts[: self.payload_at]

    @property
    def back(self) -> tuple[Part, ...]:
        """Parts after the payload."""
        return self.parts[self.payload_at + 1 :]

    @cached_property
    def header_size(self) -> int:
        """Bytes before the payload."""
        return sum(part.size for part in self.front)

    @cached_property
    def trailer_size(self) -> int:
        """Bytes after the payload."""
        return sum(part.size for part in self.back)

    @property
    def overhead(self) -> int:
        """Bytes before and after the payload."""
        return self.header_size + self.trailer_size

    @property
    def max_frame(self) -> int:
        """Maximum size of a frame, with the payload as a length counts it."""
        blocks = self.blocks.added(self.payload.most_sent) if self.blocks else 0
        return self.overhead + self.payload.most_sent + blocks

    @property
    def preamble(self) -> bytes:
        """Constant bytes at the start of the frame, b"" if there are none."""
        first = self.parts[0]
        return first.data if isinstance(first, ConstantPart) else b""

    @property
    def length(self) -> LengthPart | None:
        """The length, None if there is none."""
        return next((part for part in self.parts if isinstance(part, LengthPart)), None)

    @cached_property
    def id(self) -> tuple[Bits, ...]:
        """The pieces of the message number in wire order, () if it shares a marked byte or is not sent."""
        return tuple(bits for part in self.parts for bits in _bits_of(part, IdPart, IdSlot))

    @cached_property
    def address(self) -> tuple[Bits, ...]:
        """The bits of the address, () if it shares a marked byte or is not sent."""
        return tuple(bits for part in self.parts for bits in _bits_of(part, AddressPart, AddressSlot))

    @cached_property
    def checks(self) -> tuple[CheckPart, ...]:
        """The check values in wire order."""
        return tuple(part for part in self.parts if isinstance(part, CheckPart))

    @cached_property
    def check(self) -> CheckPart | None:
        """The check value whose algorithm can be replaced: the last over the payload, else the last."""
        over = [part for part in self.checks if self.payload.name in part.check.over]
        return (over or self.checks or (None,))[-1]

    @cached_property
    def blocks(self) -> BlocksPart | None:
        """The check values of the blocks of the payload, None if there are none."""
        return next((part for part in self.parts if isinstance(part, BlocksPart)), None)

    @cached_property
    def header_checks(self) -> tuple[CheckPart, ...]:
        """Check values of the header alone, which a receiver verifies before the payload."""
        front = {part.name for part in self.front}
        return tuple(part for part in self.checks if part in self.front and front.issuperset(part.check.over))

    @cached_property
    def filling(self) -> tuple[CheckPart, ...]:
        """The check values in the order in which they are computed: after those that they cover."""
        left, done = list(self.checks), list[CheckPart]()
        while left:
            names = {part.name for part in left}
            part = next(part for part in left if names.isdisjoint(part.check.over))
            left.remove(part)
            done.append(part)
        return tuple(done)

    @cached_property
    def values(self) -> tuple[tuple[CellPart, Member], ...]:
        """Values of every frame, each with the part that holds it."""
        return tuple(
            (part, member) for part in self.parts if isinstance(part, CellPart) for member in part.values
        )

    def known_at(self, part: Part, pieces: tuple[Bits, ...]) -> bool:
        """Whether a receiver of the header knows all pieces at the end of this part."""
        done = self.front[: self.front.index(part) + 1]
        return all(bits.part in done for bits in pieces)

    def identifies(self, part: Part) -> bool:
        """Whether the part holds bits of the message number or the address."""
        return any(bits.part is part for bits in (*self.id, *self.address))

    def offset(self, wanted: Part) -> int:
        """Offset of a part; the payload counts as empty."""
        return sum(part.size for part in self.parts[: self.parts.index(wanted)])

    def from_end(self, wanted: Part) -> int:
        """Distance of a part after the payload from the end of the frame."""
        return sum(part.size for part in self.parts[self.parts.index(wanted) :])

    def between(self, front: int, back: int) -> tuple[Part, ...]:
        """All parts except those in the first ``front`` and last ``back`` bytes."""
        return tuple(
            part
            for index, part in enumerate(self.parts)
            if (index >= self.payload_at or self.offset(part) >= front)
            and (index <= self.payload_at or self.from_end(part) > back)
        )

    def covered(self, part: Part) -> bool:
        """Whether the main check value covers the part."""
        return self.check is not None and part.name in self.check.check.over

    def coverage(self, check: CheckPart) -> tuple[tuple[Part, ...] | Seed, ...]:
        """What a check value covers, in order: adjacent parts as one run, and seeds."""
        found: list[list[Part] | Seed] = []
        places = {part.name: index for index, part in enumerate(self.parts)}
        last = -2
        for name in check.check.over:
            if name.startswith(ATTRIBUTE):
                found.append(Seed(name.removeprefix(ATTRIBUTE)))
                last = -2
                continue
            if name not in places:  # the id of a packet, which its response does not repeat
                continue
            if places[name] == last + 1 and found and isinstance(found[-1], list):
                found[-1].append(self.parts[places[name]])
            else:
                found.append([self.parts[places[name]]])
            last = places[name]
        return tuple(each if isinstance(each, Seed) else tuple(each) for each in found)

    def seeds(self, check: CheckPart) -> tuple[Seed, ...]:
        """The seeds that a check value covers."""
        return tuple(each for each in self.coverage(check) if isinstance(each, Seed))

    @cached_property
    def seeded(self) -> tuple[CheckPart, ...]:
        """Check values that cover a seed, so that they can be verified only if the message is known."""
        return tuple(part for part in self.checks if self.seeds(part))


def _bits_of(part: Part, whole: type[Part], slot: type[Slot]) -> Iterator[Bits]:
    if isinstance(part, IdPart | AddressPart) and isinstance(part, whole):
        yield Bits(part, 0, part.integer.bits, 0)
    elif isinstance(part, CellPart):
        yield from (
            Bits(part, each.shift, each.bits, each.at)
            for each in part.slots
            if isinstance(each, slot) and not isinstance(each, ConstantSlot | Member)
        )


@dataclass(frozen=True)
class FramePlan:
    """The frame around each message.

    Attributes:
        envelopes: by direction; directions with equal envelopes share one object.
        end: what determines the end of a frame.
        transparency: the stuffing of its bytes.
        receiver: how frames are found in a stream.
        address: name of the address, "" if there is none.
        id_name: name of the message number.
        idle: silence on the line that ends a frame early, None if the document states none.
    """

    envelopes: Mapping[Direction, Envelope]
    end: End
    transparency: Transparency
    receiver: Receiver
    address: str
    id_name: str
    idle: Silence | None = None

    @property
    def envelope(self) -> Envelope:
        """The envelope of responses; in most protocols every direction has the same."""
        return self.envelopes["response"]

    @property
    def check(self) -> Check | None:
        """The main check value, None where there is none."""
        part = self.envelope.check
        return part.check if part else None

    @property
    def needs_request(self) -> bool:
        """Whether a response can be decoded only with its request."""
        return isinstance(self.receiver, InStep)

    @property
    def checks_header(self) -> bool:
        """Whether only message number and address in the header distinguish a frame from noise."""
        envelope = self.envelope
        identifying = (part for part in envelope.front if envelope.identifies(part))
        bare = isinstance(self.receiver, Rescan) and self.receiver.bare
        return bare and any(envelope.known_at(part, envelope.id) for part in identifying)

    @property
    def max_payload(self) -> int:
        """Maximum payload size of the frame."""
        return self.envelope.payload.most

    @property
    def max_wire(self) -> int:
        """Maximum size on the wire of a frame, valid or not."""
        most = self.envelope.max_frame
        stuffing = self.transparency
        return stuffing.most_frame(most) if isinstance(stuffing, FrameStuffing | Coded) else most

    @property
    def longest(self) -> int:
        """Number of bytes after which a receiver reports bytes outside of frames."""
        return self.max_wire if isinstance(self.end, ByTerminator) else self.envelope.max_frame

    @property
    def flag(self) -> bytes:
        """The bytes that both begin and end a frame, b"" if no bytes do."""
        end = self.end.part.data if isinstance(self.end, ByTerminator) else b""
        return end if end == self.envelope.preamble else b""

    @property
    def lines(self) -> bool:
        """Whether a frame begins only after a terminator: nothing else tells a part of a frame from one."""
        end, way = self.end, self.receiver
        alone = isinstance(end, ByTerminator) and not end.after and end.paired is None
        return alone and isinstance(way, Rescan) and way.bare and not way.verified

    @property
    def kept(self) -> int:
        """Number of bytes at the end of a frame that may begin the next one.

        Even if the schema does not share them: the end of a frame may be lost.
        """
        return len(self.flag) if isinstance(self.end, ByTerminator) and not self.end.after else 0

    def with_check(self, direction: Direction, *, checked: bool) -> Envelope:
        """The envelope of a message with (``checked``) or without a check value."""
        envelope = self.envelopes[direction]
        if checked or envelope.check is None:
            return envelope
        return Envelope(tuple(part for part in envelope.parts if not isinstance(part, CheckPart)))


# From the model ---------------------------------------------------------------------------------------------


def frame_plan(frame: Frame) -> FramePlan:
    """Plan the frame of a protocol."""
    match frame:
        case DelimitedFrame():
            return _delimited(frame)
        case MarkedFrame():
            return _marked(frame)
        case PacketFrame():
            return _packet(frame)
        case _:
            assert_never(frame)


def _delimited(frame: DelimitedFrame) -> FramePlan:
    transparency = _transparency(frame)
    envelope = Envelope(_parts(frame, transparency))
    address = frame.address
    end: End = ByLength(envelope.length) if envelope.length else ByMessage()
    if stated := frame.part("terminator"):
        part = next(each for each in envelope.parts if each.name == stated.name)
        assert isinstance(part, ConstantPart)
        end = ByTerminator(part, envelope.from_end(part) - part.size, stated.shared, frame.paired)
    return FramePlan(
        envelopes=dict.fromkeys(("request", "response", "message"), envelope),
        end=end,
        transparency=transparency,
        receiver=_receiver(envelope, transparency),
        address=address.name if address else "",
        id_name=frame.id_bits[-1].name if frame.id_bits else "",
        idle=frame.idle,
    )


def _transparency(frame: DelimitedFrame) -> Transparency:
    stuffing = frame.stuffing
    if frame.part("terminator"):
        return _coded(frame)
    if stuffing is None:
        return Plain()
    rule = Insertion(stuffing.after, stuffing.insert)
    if stuffing.before_checksum:
        return PayloadStuffing(rule)
    names = [part.name for part in frame.parts]
    stuffed = [index for index, name in enumerate(names) if name not in stuffing.exempt]
    front, back = frame.parts[: stuffed[0]], frame.parts[stuffed[-1] + 1 :]
    return FrameStuffing(rule, sum(part.size for part in front), sum(part.size for part in back))


def _coded(frame: DelimitedFrame) -> Coded:
    """The coding of a frame with a terminator; without one, all before that is sent as it is."""
    names = [part.name for part in frame.parts]
    coded = [index for index, name in enumerate(names) if name in frame.coded]
    if not coded:
        roles = [part.role for part in frame.parts]
        coded = [int(roles[0] == "constant"), roles.index("terminator") - 1]
    front, back = frame.parts[: coded[0]], frame.parts[coded[-1] + 1 :]
    stages = tuple(map(stage, frame.coding))
    return Coded(stages, sum(part.size for part in front), sum(part.size for part in back))


def _parts(frame: DelimitedFrame, transparency: Transparency) -> tuple[Part, ...]:
    parts: dict[str, Part] = {}
    for part in frame.parts:
        parts[part.name] = _derived(part, parts) if part.derivation else _part(frame, part, transparency)
    return tuple(parts.values())


def _derived(part: StatedPart, before: Mapping[str, Part]) -> Part:
    assert part.scalar is not None
    assert part.derivation is not None
    source = before[part.derivation.of]
    assert isinstance(source, LengthPart | IdPart | AddressPart | CellPart)
    return EqualPart(part.name, part.scalar.integer, source, part.derivation.inverted, part.derivation.added)


def _part(frame: DelimitedFrame, part: StatedPart, transparency: Transparency) -> Part:
    match part.role:
        case "constant" | "terminator":
            return ConstantPart(part.name, part.constant)
        case "payload":
            most_sent = transparency.most_sent(part.max_size)
            return PayloadPart(part.name, part.min_size, part.max_size, most_sent, part.trim)
        case "checksum":
            assert part.checksum is not None
            check = Check(part.checksum)
            return (
                BlocksPart(part.name, check, check.value.every)
                if check.value.every
                else CheckPart(part.name, check)
            )
        case "length" | "message" | "address" | "bits":
            return _integer_part(frame, part, transparency)
        case "derived":
            raise AssertionError(f"{part.name} follows from another part")
        case _:
            assert_never(part.role)


def _integer_part(frame: DelimitedFrame, part: StatedPart, transparency: Transparency) -> Part:
    assert part.scalar is not None
    integer = part.scalar.integer
    if part.role == "message" and part.bits == frame.id_bits:
        return IdPart(part.name, integer)
    if part.role == "address":
        return AddressPart(part.name, integer)
    if part.bits:
        return CellPart(part.name, integer, tuple(map(_slot, part.bits)))
    bias, payload = frame.length_bias, frame.payload
    most = min(integer.maximum, (bias + transparency.most_sent(payload.max_size)) // part.scale)
    return LengthPart(part.name, integer, bias, -(-(bias + payload.min_size) // part.scale), most, part.scale)


def _slot(bits: PartBits) -> Slot:
    match bits.role:
        case "message" | "direction":
            return IdSlot(bits.shift, bits.bits, bits.at)
        case "address":
            return AddressSlot(bits.shift, bits.bits)
        case "constant":
            return ConstantSlot(bits.shift, bits.bits, bits.constants)
        case "value":
            assert bits.type is not None
            return Member(bits.name, bits.shift, bits.bits, bits.type)
        case _:
            assert_never(bits.role)


def _receiver(envelope: Envelope, transparency: Transparency) -> Receiver:
    """Choose between hunting and rescanning, for all targets."""
    if isinstance(transparency, FrameStuffing) and _unique(envelope, transparency):
        return Hunt(transparency.rule.after[0], transparency.rule.insert)
    return Rescan(
        bare=not envelope.preamble,
        verified=bool(envelope.checks or envelope.blocks),
        seeded=bool(envelope.seeded),
    )


def _unique(envelope: Envelope, stuffing: FrameStuffing) -> bool:
    """Whether the preamble cannot occur in a frame, and the frame can be processed byte by byte.

    The preamble is one byte twice, and alone exempt from stuffing after that byte. A length of one byte
    follows, whose range excludes that byte. The check value is sent whole, comes last and covers everything
    between.
    """
    rule, length, check = stuffing.rule, envelope.length, envelope.check
    if len(rule.after) != 1 or rule.after * 2 != envelope.preamble or rule.insert in rule.after:
        return False
    if (stuffing.front, stuffing.back) != (len(envelope.preamble), 0):
        return False
    if length is None or envelope.parts[1] is not length or length.size != 1 or length.scale > 1:
        return False
    if length.least <= rule.after[0] <= length.most or envelope.checks != envelope.parts[-1:]:
        return False
    assert check is not None
    inner = envelope.parts[1:-1]
    plain = not any(isinstance(part, ConstantPart | CellPart | EqualPart) for part in inner)
    number = [bits.part.size for bits in envelope.id] == [1]
    return plain and number and envelope.coverage(check) == (inner,) and check.check.regular is not None


def _marked(frame: MarkedFrame) -> FramePlan:
    def mark(name: str, end_id: int | None) -> MarkPart:
        return MarkPart(
            name, frame.marker, frame.address_name, frame.address_bits, frame.id_name, frame.id_bits, end_id
        )

    header, end = mark("header", None), mark("end", frame.end_id)
    most = frame.payload_max
    check = (CheckPart("checksum", Check(frame.checksum)),) if frame.checksum else ()
    envelope = Envelope((header, PayloadPart("payload", 0, most, most), *check, end))
    return FramePlan(
        envelopes=dict.fromkeys(("request", "response", "message"), envelope),
        end=ByMark(header, end),
        transparency=SevenBit(frame.marker),
        receiver=Marks(),
        address=frame.address_name,
        id_name=frame.id_name,
    )


def _packet(frame: PacketFrame) -> FramePlan:
    payload = PayloadPart("payload", 0, frame.payload_max, frame.payload_max)
    number = IdPart(frame.id_name, Integer(8, signed=False, chunks=byte_chunks(1, "big")))
    request = Envelope((number, payload))
    check: tuple[Part, ...] = ()
    if frame.checksum is not None:
        value = Check(frame.checksum, frame.word_size, chained=True, rejected=frame.rejected)
        check = (CheckPart(frame.checksum_name, value),)
    return FramePlan(
        envelopes={"request": request, "message": request, "response": Envelope((payload, *check))},
        end=ByMessage(),
        transparency=Plain(),
        receiver=InStep(),
        address="",
        id_name=frame.id_name,
    )
