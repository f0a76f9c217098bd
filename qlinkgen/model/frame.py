"""Frames: delimited by preamble, length or message; marked by a bit; packets; or several of the first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from fractions import Fraction
from functools import cached_property
from typing import Literal, assert_never, get_args

from qlinkgen._dataclass import dataclass
from qlinkgen.model.checksum import Checksum as Algorithm
from qlinkgen.model.coding import Coding, Escape, Insert
from qlinkgen.model.condition import Condition
from qlinkgen.model.digits import Digits
from qlinkgen.model.fields import Field, Value
from qlinkgen.model.integer import ByteOrder, Chunk, Integer, pack_chunks
from qlinkgen.model.texts import Text
from qlinkgen.model.types import Blob, Characters, Length, Scalar

#: What the names of attributes begin with where a check value covers them.
ATTRIBUTE = "attribute."
#: Bytes of a pair.
_PAIR = 2
#: The side that a frame goes to: "request" to the slave, "response" to the master.
Direction = Literal["request", "response"]
#: The role of a part of a frame.
Role = Literal[
    "constant", "length", "message", "address", "payload", "checksum", "terminator", "bits", "derived"
]


@dataclass(frozen=True, slots=True)
class Checksum:
    """The algorithm and wire layout of the check value."""

    algorithm: Algorithm
    #: The check value's wire bytes; bits in no chunk are neither sent nor compared.
    chunks: tuple[Chunk, ...]
    #: Names of the frame parts covered, in wire order; between them ``attribute.NAME``.
    over: tuple[str, ...]
    confirmed: bool = True
    #: The value where the covered parts are empty, None if the algorithm gives it.
    otherwise: int | None = None
    #: Size of the blocks of the covered part that have a value each, 0 for one value over all parts.
    every: int = 0
    #: It is sent as digits of this base, 0 if it is not. A chunk is a hexadecimal digit of four bits, or the
    #: whole value for each decimal digit.
    base: Literal[0, 10, 16] = 0

    @property
    def modulus(self) -> int:
        """What is sent of decimal digits is the remainder of the value by this; 0 for others."""
        return int(10**self.size) if self.base == 10 else 0

    def sent(self, value: int) -> int:
        """A value as far as it is sent."""
        return value % self.modulus if self.modulus else value & self.mask

    @property
    def mask(self) -> int:
        """The bits that are sent."""
        if self.base == 10:
            return self.algorithm.mask
        return sum(chunk.mask << chunk.shift for chunk in self.chunks)

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        return len(self.chunks)

    @property
    def regular(self) -> ByteOrder | None:
        """Byte order of a check value that is sent whole; None if bits are omitted or regrouped."""
        return None if self.base else Integer(self.algorithm.width, False, self.chunks).byteorder

    def pack(self, value: int) -> bytes:
        """The wire bytes of a check value; bits or digits that are not sent are dropped."""
        if self.base == 10:
            return b"%0*d" % (self.size, self.sent(value))
        data = pack_chunks(value, self.chunks)
        return bytes(b"0123456789ABCDEF"[each] for each in data) if self.base else data

    def normal(self, data: bytes) -> bytes:
        """Received bytes as they are sent: digits in upper case."""
        return data.upper() if self.base == 16 else data


@dataclass(frozen=True, slots=True)
class Counting:
    """What a counter counts: new requests to each node, or frames; and whether answers repeat it.

    ``again``: a slave answers a request with the number of the one before with its last answer.
    """

    per_frame: bool = False
    echo: bool = False
    again: bool = False
    #: Tests of pieces of the message id, which hold for the messages that it counts; () for all.
    when: Condition = ()


#: Whose number a value of every frame is: that of the receiver or the sender of a frame on a link, or that of
#: the master; "" of no party.
Party = Literal["", "destination", "source", "master"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PartBits:
    """Consecutive bits of a part.

    ``shift`` is the lowest of them in the integer of the part, ``at`` the place of a piece of the message
    id in the whole id.
    """

    name: str
    role: Literal["message", "direction", "address", "constant", "value"]
    shift: int
    bits: int
    at: int = 0
    #: Legal values of a constant, the first of which is sent.
    constants: tuple[int, ...] = ()
    #: The value for each direction.
    directions: Mapping[str, int] = field(default_factory=dict)
    #: The number of a value of every frame.
    type: Scalar | None = None
    #: It is a counter, which the runtime fills.
    counting: Counting | None = None
    party: Party = ""
    #: They are characters, and so are ids in files.
    text: bool = False
    #: The direction whose frames have them, None for both; a frame has parts of one direction instead.
    only: Direction | None = None
    #: They are sent as text.
    digits: Digits | None = None
    doc: Text = ""

    @property
    def most(self) -> int:
        """Greatest number that they hold."""
        most = (1 << self.bits) - 1
        return min(most, self.digits.highest) if self.digits else most

    @property
    def is_id(self) -> bool:
        """Whether they are a piece of the message id."""
        return self.role in ("message", "direction")

    @property
    def mask(self) -> int:
        """Mask of the bits, in place."""
        return ((1 << self.bits) - 1) << self.shift


@dataclass(frozen=True, slots=True)
class Derivation:
    """A number that follows from an earlier part: complemented if ``inverted``, plus ``added``."""

    of: str
    inverted: bool = False
    added: int = 0


@dataclass(frozen=True, slots=True)
class Opening:
    """A message id of ``least`` to ``most`` characters, with which payloads begin.

    If it is ``folded``, letters of either case are received.
    """

    name: str
    least: int
    most: int
    folded: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A part of a frame. ``scalar`` is the integer of all parts but constants, payload and checksum.

    ``constant`` holds the bytes of a constant or a terminator, which may begin the next frame if ``shared``.
    """

    name: str
    role: Role
    doc: Text = ""
    section: Text = ""
    confirmed: bool = True
    #: The direction whose frames have it, None for both.
    only: Direction | None = None
    #: Tests of values of the header that decide whether a frame has it, () if each has it.
    when: Condition = ()
    constant: bytes = b""
    shared: bool = False
    scalar: Scalar | None = None
    checksum: Checksum | None = None
    #: What its bits hold: all of a message id or address, those described of a part with role "bits", whose
    #: others are sent as 0 and ignored when received.
    bits: tuple[PartBits, ...] = ()
    #: The numbers of the first part of a kind of frame that it tells, () for others.
    numbers: tuple[int, ...] = ()
    derivation: Derivation | None = None
    #: Names of the parts that a length counts.
    counts: tuple[str, ...] = ()
    #: Number of a length that hands over to a longer one, None if it states every size.
    otherwise: int | None = None
    #: Bytes of one step of a length, and bytes at raw 0.
    scale: int = 1
    offset: int = 0
    #: Payload only: minimum and maximum size.
    min_size: int = 0
    max_size: int = 0
    #: Payload only: bytes that are sent at least where zeros at the end are not, None if all are sent.
    trim: int | None = None
    #: Payload only: the message id that it begins with, None if other parts hold the id.
    opening: Opening | None = None

    @property
    def field(self) -> Field:
        """The part as a field, for its values."""
        assert self.scalar is not None
        return Field(self.name, self.scalar, self.doc, self.section, self.confirmed)

    def among(self, names: frozenset[str]) -> Part:
        """The part where a frame has only parts with these names: it counts and covers no others."""
        checksum = self.checksum
        if checksum:
            over = tuple(each for each in checksum.over if each in names or each.startswith(ATTRIBUTE))
            checksum = replace(checksum, over=over)
        return replace(self, counts=tuple(each for each in self.counts if each in names), checksum=checksum)

    @property
    def size(self) -> int:
        """Size in bytes, 0 for the payload and the check values of its blocks."""
        if self.scalar is not None:
            return self.scalar.size
        if self.checksum:
            return 0 if self.checksum.every else len(self.checksum.chunks)
        return len(self.constant)


@dataclass(frozen=True, slots=True)
class Silence:
    """An idle line that ends a frame: ``byte_times`` on the bus, but at least ``seconds``.

    If ``alone``, nothing else does; otherwise it ends a frame early. If ``broken``, it is a break of the
    line, which begins each frame, and so ends the one before it.
    """

    byte_times: Fraction
    seconds: Fraction
    alone: bool = False
    broken: bool = False


@dataclass(frozen=True)
class DelimitedFrame:
    """Parts in wire order; a terminator, an idle line alone, a length or the message determines the end.

    ``coding`` applies to the parts named in ``coded``, one coding after the other: to those of the finished
    frame; or, if ``checked_after``, to the payload alone, whose coded bytes lengths and check values cover.
    """

    parts: tuple[Part, ...]
    coding: tuple[Coding, ...] = ()
    coded: tuple[str, ...] = ()
    checked_after: bool = False
    idle: Silence | None = None
    doc: Text = ""
    section: Text = ""

    kind = "delimited"

    @property
    def directed(self) -> bool:
        """Whether some parts are only in frames of one direction."""
        return any(part.only for part in self.parts)

    @property
    def conditional(self) -> tuple[Part, ...]:
        """The parts that a frame has only where values of its header meet a condition."""
        return tuple(part for part in self.parts if part.when)

    @property
    def ways(self) -> tuple[Direction, ...]:
        """The directions whose frames differ; one of them where none do."""
        return get_args(Direction) if self.directed else ("response",)

    @property
    def alike(self) -> bool:
        """Whether the frames of both directions have the same parts, whatever these hold."""
        one, other = ([_outline(part) for part in self.towards(each).parts] for each in get_args(Direction))
        return one == other

    def towards(self, direction: str) -> DelimitedFrame:
        """The frame of a direction, without the parts that only the other has."""
        if not self.directed:
            return self
        parts = tuple(part for part in self.parts if part.only in (None, direction))
        names = frozenset(part.name for part in parts)
        return replace(self, parts=tuple(replace(part.among(names), only=None) for part in parts))

    def part(self, role: Role) -> Part | None:
        """The first part with a role."""
        return next((part for part in self.parts if part.role == role), None)

    @property
    def ends_idle(self) -> bool:
        """Whether nothing but an idle line ends a frame."""
        return self.idle is not None and self.idle.alone

    @property
    def tells_end(self) -> bool:
        """Whether something other than the message tells the end of a frame."""
        return self.ends_idle or self.part("length") is not None or self.part("terminator") is not None

    @property
    def stuffing(self) -> Insert | None:
        """The byte inserted into a frame that is read from left to right, None without one."""
        known = self.ends_idle or self.part("terminator") is not None
        first = self.coding[0] if self.coding and not known else None
        return first if isinstance(first, Insert) else None

    @property
    def late_insert(self) -> int | None:
        """The inserted byte that may follow the last one of a frame, None if none may."""
        last = self.stuffing if not self.checked_after and self.parts[-1].name in self.coded else None
        return last.insert if last else None

    @cached_property
    def paired(self) -> int | None:
        """The byte before a second one in coded bytes, if a terminator is another pair with it; else None.

        Then the terminator may occur there, but not where a pair begins.
        """
        end = self.part("terminator")
        if end is None or not self.coding or len(end.constant) != _PAIR:
            return None
        first, (one, other) = self.coding[-1], end.constant
        inner = [part.name for part in self.parts[: self.parts.index(end)]][int(bool(self.preamble)) :]
        match first:
            case Escape():
                seconds = {second for _, second in first.codes} | {first.escape}
                known = first.escape == one and other not in seconds and not first.mask
            case Insert():
                known = first.after == bytes((one,)) and other != first.insert
            case _:
                known = False
        return one if known and list(self.coded) == inner else None

    @cached_property
    def preamble(self) -> bytes:
        """Constant bytes at the start, b"" if there are none."""
        return self.parts[0].constant

    @property
    def is_payload(self) -> bool:
        """Whether a frame is its payload: of several kinds, one that only its turn in a dialogue tells."""
        return len(self.parts) == 1 and self.parts[0].role == "payload"

    @property
    def leading(self) -> Part | None:
        """The first part if the numbers in it tell a kind: a message id, an address, or bits of one byte."""
        first = self.parts[0]
        whole = first.role == "address" or (first.role == "message" and first.bits == self.id_bits)
        told = first.size == 1 and any(each.is_id or each.role == "constant" for each in first.bits)
        return first if first.scalar is not None and (whole or told) else None

    @property
    def starts(self) -> tuple[bytes, ...]:
        """The bytes that frames begin with: a constant, or each number of the first part; () if any may."""
        first = self.parts[0]
        if first.scalar is None:
            return (first.constant,) if first.constant else ()
        return tuple(map(first.scalar.integer.pack, first.numbers))

    @property
    def complemented(self) -> bool:
        """Whether a frame is a byte and its complement."""
        found = [part.derivation for part in self.parts if part.derivation and part.size == 1]
        inverted = any(each.inverted and not each.added for each in found)
        return inverted and sum(part.size for part in self.parts) + self.payload.max_size == _PAIR

    @cached_property
    def length_bias(self) -> int:
        """What a length counts in addition to the payload: other parts, less its offset."""
        length = self.part("length")
        if length is None:
            return 0
        return sum(part.size for part in self.parts if part.name in length.counts) - length.offset

    @cached_property
    def length_scale(self) -> int:
        """Bytes of one step of the length."""
        length = self.part("length")
        return length.scale if length else 1

    @cached_property
    def id_bits(self) -> tuple[PartBits, ...]:
        """The pieces of the message id, the most significant first; a whole part is one piece."""
        found = {bits.name: bits for part in self.parts for bits in part.bits if bits.is_id}
        return tuple(sorted(found.values(), key=lambda each: -each.at))

    @property
    def address(self) -> PartBits | None:
        """The address, None if there is none."""
        found = (bits for part in self.parts for bits in part.bits)
        return next((each for each in found if each.role == "address"), None)

    @property
    def counter(self) -> PartBits | None:
        """The counter among the values, None if there is none."""
        found = (bits for part in self.parts for bits in part.bits)
        return next((each for each in found if each.counting is not None), None)

    def counts(self, number: int) -> bool:
        """Whether the counter counts the message with an id; False without a counter."""
        counting = self.counter.counting if self.counter else None
        pieces = {bits.name: number >> bits.at & (1 << bits.bits) - 1 for bits in self.id_bits}
        return counting is not None and all(test.holds(pieces[test.value]) for test in counting.when)

    @property
    def master(self) -> PartBits | None:
        """The number of the master among the values, None if there is none."""
        found = (bits for part in self.parts for bits in part.bits)
        return next((each for each in found if each.party == "master"), None)

    @property
    def repeated(self) -> tuple[str, ...]:
        """Names of the values that an answer repeats."""
        counter, master = self.counter, self.master
        found = [counter.name] if counter and counter.counting and counter.counting.echo else []
        if master and all(self.towards(each).master for each in get_args(Direction)):
            found.append(master.name)
        return tuple(found)

    @cached_property
    def values(self) -> tuple[Value, ...]:
        """Values of every frame, in wire order."""
        # Where each direction has a part of its own with a value of one name, the first one is taken.
        found: dict[str, Value] = {}
        for part in self.parts:
            for bits in part.bits:
                if bits.type is not None:
                    value = Value(bits.name, _stated(bits.type), bits.doc or part.doc, part.field)
                    found.setdefault(bits.name, value)
        return tuple(found.values())

    @property
    def deciding(self) -> tuple[Value, ...]:
        """Values that fields of a payload may depend on: those that each frame has and callers give."""
        owned = {
            bits.name
            for part in self.parts
            for bits in part.bits
            if not (part.when or bits.counting or bits.party)
        }
        return tuple(value for value in self.values if value.name in owned)

    @property
    def payload(self) -> Part:
        """The payload."""
        return next(part for part in self.parts if part.role == "payload")

    @property
    def attributes(self) -> tuple[str, ...]:
        """Names of the attributes of messages that check values cover."""
        over = [name for part in self.parts if part.checksum for name in part.checksum.over]
        found = (name.removeprefix(ATTRIBUTE) for name in over if name.startswith(ATTRIBUTE))
        return tuple(dict.fromkeys(found))


def _outline(part: Part) -> Part:
    """A part without what it holds."""
    role: Role = part.role if part.role not in ("message", "address", "bits") else "bits"
    kept = replace(part, role=role, bits=(), only=None, doc="", section="", confirmed=True)
    return replace(kept, scalar=part.scalar and replace(part.scalar, default=0, minimum=0, maximum=0))


def _stated(number: Scalar) -> Scalar | Blob:
    """The type of a value of every frame as its users see it: that of a text is like that of a field."""
    kind = number.meaning
    if not isinstance(kind, Characters):
        return number
    default = number.default.to_bytes(kind.number, "big")
    return Blob(True, Length(kind.number, kind.number), default, excluded=kind.excluded)


@dataclass(frozen=True)
class MarkedFrame:
    """Header and end have a marker bit that all other bytes lack.

    header = marker | address << address_bits.shift | message id << id_bits.shift; the end byte has ``end_id``
    in place of the message id.
    """

    marker: int
    address_name: str
    address_bits: Chunk
    id_name: str
    id_bits: Chunk
    end_id: int
    payload_max: int
    checksum: Checksum | None = None
    doc: Text = ""
    section: Text = ""

    kind = "marked"


@dataclass(frozen=True)
class PacketFrame:
    """Packets without a frame: a request is a message id and words, a response words and a check value."""

    id_name: str
    payload_max: int
    #: Sum over the message id and every word of request and response.
    checksum_name: str = "checksum"
    checksum: Checksum | None = None
    #: Size of the big-endian words that are summed.
    word_size: int = 2
    #: Check value with which the slave rejects an unknown command.
    rejected: int | None = None
    doc: Text = ""
    section: Text = ""

    kind = "packet"


@dataclass(frozen=True)
class FrameKind:
    """One of several kinds of frame; those of one ``family`` carry the same messages.

    Attributes:
        name: what messages call it.
        frame: the frame, without parts of one direction.
        only: the direction whose messages it carries, None for both.
        own: a name of its own, if it is one of two that describe a kind with parts of one direction.
    """

    name: str
    frame: DelimitedFrame
    family: int
    only: Direction | None = None
    own: str = ""

    @property
    def title(self) -> str:
        """The name that no other kind has."""
        return self.own or self.name


@dataclass(frozen=True)
class FrameKinds:
    """Several kinds of frame, told apart by the constants that they begin with, and by their direction.

    The id of a message is its number in the frame, and above that the number of its family.
    """

    kinds: tuple[FrameKind, ...]
    #: Most messages of a kind that only their turn tells; they are numbered in their order.
    turned: int = 0

    kind = "kinds"

    @cached_property
    def number_bits(self) -> int:
        """Bits of the longest number of a message in a frame."""
        found = [bits.at + bits.bits for each in self.kinds for bits in each.frame.id_bits]
        return max(*found, 0, max(0, self.turned - 1).bit_length())

    def base(self, family: int) -> int:
        """What is added to the number of a message of a family."""
        return family << self.number_bits

    def carrying(self, number: int) -> tuple[FrameKind, ...]:
        """The kinds that carry the message with an id."""
        return tuple(each for each in self.kinds if each.family == number >> self.number_bits)

    def is_turned(self, number: int) -> bool:
        """Whether only its turn tells the message with an id."""
        return all(each.frame.is_payload for each in self.carrying(number))

    @property
    def address(self) -> PartBits | None:
        """The address, None if no kind has one."""
        return next((each.frame.address for each in self.kinds if each.frame.address), None)

    @property
    def counter(self) -> PartBits | None:
        """The counter among the values, None if no kind has one."""
        return next((each.frame.counter for each in self.kinds if each.frame.counter), None)

    def counts(self, number: int) -> bool:
        """Whether a counter counts the message with an id."""
        own = number & (1 << self.number_bits) - 1
        return any(each.frame.counts(own) for each in self.carrying(number))

    @property
    def repeated(self) -> tuple[str, ...]:
        """Names of the values that an answer repeats."""
        return next((each.frame.repeated for each in self.kinds if each.frame.repeated), ())

    @cached_property
    def values(self) -> tuple[Value, ...]:
        """Values of frames of any kind; those of several kinds have one name and one type."""
        found: dict[str, Value] = {}
        for each in self.kinds:
            found = {**{value.name: value for value in each.frame.values}, **found}
        return tuple(found.values())


OneFrame = DelimitedFrame | MarkedFrame | PacketFrame
Frame = OneFrame | FrameKinds


def id_pieces(frame: Frame) -> tuple[PartBits, ...]:
    """The pieces of the message id that parts hold, of all kinds of frame."""
    match frame:
        case DelimitedFrame():
            return frame.id_bits
        case FrameKinds():
            return tuple(each for kind in frame.kinds for each in kind.frame.id_bits)
        case MarkedFrame() | PacketFrame():
            return ()
        case _:
            assert_never(frame)
