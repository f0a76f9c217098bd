"""Interprets a plan: encodes and decodes messages as the reference for every target.

Every target checks a whole frame in this order:

1. data that is empty or shorter than the frame: ``truncated``;
2. in wire order, up to the end of the header: a wrong constant or derived number is ``frame``, a wrong
   inserted byte ``stuffing``, a length out of range ``length``; in a frame without a length an unknown
   message number is ``unknown``, and a count out of range ``length``;
3. a wrong check value over parts of the header alone, before the payload: ``crc``;
4. a wrong constant or derived number after the payload: ``frame``; where only the payload is stuffed, a wrong
   inserted byte is ``stuffing`` and a payload that is too long ``length``;
5. bytes after the end: ``length``;
6. a wrong check value: ``crc``, or ``illegal`` if it signals a refused request;
7. a message number that the direction does not have: ``unknown``; then a wrong check value that covers an
   attribute of the message: ``crc``;
8. values of the frame that decide which fields the payload has: ``range``; the payload: wrong sizes are
   ``length``, then illegal values ``range``, and wrong check values among the fields ``crc``; last the
   address and the other values of the frame, ``range``. A payload in which fields may be absent is walked
   instead, in wire order: for each field its size, ``length``, then its value, ``range`` (see `walk`).

A frame that a terminator ends is decoded as a whole. Step 2 is: a wrong first constant is ``frame``; no
terminator within the longest frame, or nothing before it, is ``length``; a wrong coding is ``stuffing``; a
payload that is too short or too long is ``length``; then, in wire order, a wrong constant is ``frame`` and a
wrong length ``length``.

A marked frame has no length: a payload size that its message cannot have is ``frame``, as are a wrong header
or end, and bytes after the end. In a frame without leading constants an unknown number or an illegal address
is found in step 2.

An answer that only its request tells from others is checked as the message that carries all of them. Then it
is the first answer to the request whose payload is valid; if none is, the fault is that of the first.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.model.message import Direction
from qlinkgen.plan import content
from qlinkgen.plan.conditional import Conditional
from qlinkgen.plan.content import BadContent, Raw, Unsendable
from qlinkgen.plan.ended import frame_reader
from qlinkgen.plan.ends import Gaps, Hunt, InStep, Marks, Rescan
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.parts import (
    AddressPart,
    AddressSlot,
    BlocksPart,
    CellPart,
    CheckPart,
    ConstantPart,
    ConstantSlot,
    EqualPart,
    IdPart,
    IdSlot,
    LengthPart,
    MarkPart,
    Numeric,
    PayloadPart,
    Slot,
)
from qlinkgen.plan.payload import Member
from qlinkgen.plan.reading import BadFrame, Incomplete, NoFrame, Taken, read_marked
from qlinkgen.plan.transparency import Coded, FrameStuffing, PayloadStuffing, Plain, SevenBit
from qlinkgen.plan.tree import MessagePlan, Plan

#: Parts of constant size whose bytes do not depend on other parts.
Sized = ConstantPart | Numeric | MarkPart


@dataclass(frozen=True, slots=True)
class Decoded:
    """A received message.

    Attributes:
        message: its plan.
        address: the address in its frame, None if the frame has none.
        values: raw values by field name.
        beside: raw values of the frame by name.
        payload: the unstuffed payload.
    """

    message: MessagePlan
    address: int | None
    values: Mapping[str, Raw]
    payload: bytes
    beside: Mapping[str, int]


_NONE: Mapping[str, Raw] = {}


@dataclass(frozen=True, slots=True)
class Given:
    """What parts depend on: size of the payload as sent, message number, address, values of the frame."""

    size: int
    number: int
    address: int
    beside: Mapping[str, Raw]


def sent(frame: FramePlan, payload: bytes) -> bytes:
    """A payload as the length of its frame counts it: with inserted bytes if only the payload is stuffed."""
    way = frame.transparency
    return way.rule.encode(payload) if isinstance(way, PayloadStuffing) else payload


class Codec:
    """Encodes and decodes the messages of a plan."""

    def __init__(self, plan: Plan) -> None:
        """Interpret ``plan``."""
        self.plan = plan

    # To the wire

    def encode(
        self, name: str, values: Mapping[str, Raw], address: int | None = None, request: bytes = b""
    ) -> bytes:
        """The frame of a message; ``request`` is the packet that it answers. Raises Unsendable.

        ``values`` include those of the frame.
        """
        message = self.plan.message(name)
        if address is None:
            address = message.message.default_address
        if message.allowed is not None and not message.allowed.holds(address):
            raise Unsendable(self.plan.frame.address, address)
        return self.wrap(name, content.pack(message.payload, values), address, request, values)

    def wrap(
        self,
        name: str,
        payload: bytes,
        address: int = 0,
        request: bytes = b"",
        beside: Mapping[str, Raw] = _NONE,
    ) -> bytes:
        """A valid frame around a payload, which is not checked; ``beside`` are values of the frame."""
        message = self.plan.message(name)
        frame = message.frame_for(len(payload))
        cells = self.cells(message, sent(frame, payload), address, beside, frame)
        return self.join(message, cells, request, frame)

    def cells(
        self,
        message: MessagePlan,
        sent: bytes,
        address: int = 0,
        beside: Mapping[str, Raw] = _NONE,
        frame: FramePlan | None = None,
    ) -> dict[str, bytes]:
        """The bytes of each part except check values, and of seeds; ``beside`` are values of the frame.

        ``frame`` is the kind of frame; by default the one for a payload of this size. Raises Unsendable for
        a value that the frame does not have.
        """
        given = Given(len(sent), message.number, address, beside)
        envelope = message.envelope_in(frame or message.frame_for(len(sent)))
        parts = {
            part.name: sent if isinstance(part, PayloadPart) else _cell(part, given)
            for part in envelope.parts
            if not isinstance(part, CheckPart | BlocksPart)
        }
        for each in envelope.conditional:
            if not each.holds(parts):
                parts |= _absent(each, beside)
        return {**parts, **dict(message.message.seeds)}

    def join(
        self,
        message: MessagePlan,
        cells: Mapping[str, bytes],
        request: bytes = b"",
        frame: FramePlan | None = None,
    ) -> bytes:
        """The frame of these parts as sent; computes the check values that are not among them.

        ``frame`` is the kind of frame; by default the one for a payload of this size.
        """
        frame = frame or message.frame_for(len(cells[message.envelope.payload.name]))
        envelope, transparency = message.envelope_in(frame), frame.transparency
        for part in (*envelope.filling, *envelope.conditional_checks):
            if part.name not in cells:
                value = self.check_value(part, envelope, cells, request)
                cells = {**cells, part.name: part.check.pack(value)}
        if blocks := envelope.blocks:
            payload = cells[envelope.payload.name]
            sent = blocks.join(payload, cells.get(blocks.name, blocks.values(payload)))
            cells = {**cells, envelope.payload.name: sent, blocks.name: b""}
        whole = b"".join(cells[each.name] for each in envelope.parts)
        match transparency:
            case FrameStuffing():
                return transparency.stuff(whole)
            case Coded():
                return transparency.encode(whole)
            case Plain() | SevenBit() | PayloadStuffing():
                return whole
            case _:
                assert_never(transparency)

    @staticmethod
    def check_value(
        part: CheckPart, envelope: Envelope, cells: Mapping[str, bytes], request: bytes = b""
    ) -> int:
        """The check value over the bytes of the covered parts as sent."""
        if part.check.chained:
            return part.check.of(request[1:], cells[envelope.payload.name], start=request[0])
        return part.check.of(b"".join(cells[name] for name in part.check.over))

    # From the wire

    def decode(self, wire: bytes, direction: Direction, request: bytes = b"") -> Decoded:
        """The message of exactly one frame; ``request`` is the frame that it answers. Raises BadFrame."""
        if not wire:
            raise BadFrame("truncated", 0)
        try:
            return self._decode(wire, direction, request)
        except Incomplete:
            raise BadFrame("truncated", len(wire)) from None
        except NoFrame as no_frame:
            raise BadFrame(no_frame.kind, no_frame.at) from None

    def decode_as(self, message: MessagePlan, wire: bytes, request: bytes = b"") -> Decoded:
        """The frame of a message, which may be told by its turn alone. Raises BadFrame."""
        if not message.turned:
            return self.decode(wire, self.plan.direction_of(message), request)
        try:
            values = content.unpack(message.payload, wire)
        except BadContent as bad:
            raise BadFrame(bad.kind, len(wire), bad.field) from None
        return Decoded(message, None, values, wire, {})

    def _decode(self, wire: bytes, direction: Direction, request: bytes) -> Decoded:
        frame, known = self.plan.frames[direction], self.plan.known(direction)
        match frame.receiver:
            case InStep():
                return self._packet(wire, direction, request)
            case Marks():
                return self.judge(read_marked(frame, known, wire), direction)
            case Hunt() | Rescan() | Gaps():
                hunting = isinstance(frame.receiver, Hunt)
                taken = frame_reader(frame, known).read(wire, hunting=hunting)
                if wire[taken.end :] not in (b"", taken.due):
                    raise BadFrame("length", taken.end)
                return self.judge(taken, direction, request)
            case _:
                assert_never(frame.receiver)

    def judge(self, taken: Taken, direction: Direction, request: bytes = b"") -> Decoded:
        """Check a frame whose parts have been read and decode its message. Raises BadFrame."""
        message = self.plan.known(direction).get(-1 if taken.number is None else taken.number)
        frame = taken.frame or self.plan.frames[direction]
        envelope = message.envelope_in(frame) if message else frame.envelope
        for part in (*envelope.checks, *envelope.conditional_checks):
            if part not in envelope.seeded and not envelope.absent(part, taken.cells):
                self._verify(part, envelope, taken, taken.cells, request)
        if envelope.blocks and taken.cells[envelope.blocks.name] != envelope.blocks.values(taken.payload):
            raise BadFrame("crc", taken.end)
        if message is None:
            raise BadFrame("unknown", taken.end)
        for part in envelope.seeded:
            self._verify(part, envelope, taken, {**taken.cells, **dict(message.message.seeds)})
        try:
            decided = _beside(envelope, taken, message.payload.decided_by)
            values = content.unpack(message.payload, taken.payload, decided)
        except BadContent as bad:
            raise BadFrame(bad.kind, taken.end, bad.field) from None
        if message.allowed and taken.address is not None and not message.allowed.holds(taken.address):
            raise BadFrame("range", taken.end, self.plan.frame.address)
        decoded = Decoded(message, taken.address, values, taken.payload, _beside(envelope, taken))
        if request and message is self.plan.carrier:
            return self._answer(decoded, request, taken.end)
        return decoded

    def _answer(self, carried: Decoded, request: bytes, end: int) -> Decoded:
        """The answer to a request in what carries it. Raises BadFrame, as for the first answer."""
        faults = []
        for message in self.plan.asked.get(self.decode(request, "request").message.name, ()):
            try:
                values = content.unpack(message.payload, carried.payload, carried.beside)
                return replace(carried, message=message, values=values)
            except BadContent as bad:
                faults.append(BadFrame(bad.kind, end, bad.field))
        if faults:
            raise faults[0]
        return carried

    def _verify(
        self,
        part: CheckPart,
        envelope: Envelope,
        taken: Taken,
        cells: Mapping[str, bytes],
        request: bytes = b"",
    ) -> None:
        if part.check.normal(taken.cells[part.name]) != part.check.pack(
            self.check_value(part, envelope, cells, request)
        ):
            refusal = part.check.rejected is not None and part.check.pack(part.check.rejected)
            raise BadFrame("illegal" if taken.cells[part.name] == refusal else "crc", taken.end)

    # Packets

    def _packet(self, wire: bytes, direction: Direction, request: bytes) -> Decoded:
        first = request[:1] if direction == "response" else wire[:1]
        message = self.plan.known(direction).get(first[0]) if first else None
        if message is None:
            raise BadFrame("unknown", 1 if direction == "request" else 0)
        beside = message.envelope.overhead
        least = 0 if message.payload.empty_is_default else message.payload.least
        if len(wire) < least + beside:
            raise BadFrame("truncated", len(wire))
        if len(wire) > message.payload.most + beside:
            raise BadFrame("length", message.payload.most + beside)
        return self.judge(take_packet(message, wire), direction, request)


def _absent(conditional: Conditional, beside: Mapping[str, Raw]) -> Mapping[str, bytes]:
    """The bytes of parts that a frame does not have. Raises Unsendable if one of their values is given."""
    for member in conditional.values:
        if (value := beside.get(member.name, member.number.default)) != member.number.default:
            raise Unsendable(member.name, value)
    return dict.fromkeys((part.name for part in conditional.parts), b"")


def _beside(envelope: Envelope, taken: Taken, wanted: Collection[Member] | None = None) -> Mapping[str, int]:
    """The values of a frame, or those wanted. Raises BadFrame."""
    found: dict[str, int] = {}
    for part, member in envelope.values:
        if wanted is not None and member not in wanted:
            continue
        if envelope.absent(part, taken.cells):
            found[member.name] = member.number.default
            continue
        found[member.name] = number = member.of(part.integer.unpack(taken.cells[part.name]))
        if content.broken(member.conditions, number):
            raise BadFrame("range", taken.end, member.name)
    return found


def take_packet(message: MessagePlan, wire: bytes) -> Taken:
    """The parts of a packet whose message is known."""
    taken = Taken(number=message.id, end=len(wire))
    at = 0
    for part in message.envelope.parts:
        size = len(wire) - message.envelope.overhead if isinstance(part, PayloadPart) else part.size
        taken.cells[part.name] = wire[at : at + size]
        at += size
    taken.payload = taken.cells[message.envelope.payload.name]
    return taken


def _cell(part: Sized, given: Given) -> bytes:
    """The bytes of a part."""
    match part:
        case ConstantPart():
            return part.data
        case LengthPart() | IdPart() | AddressPart() | CellPart() | EqualPart():
            return part.integer.pack(_number(part, given))
        case MarkPart():
            return bytes((part.byte(given.number, given.address),))
        case _:
            assert_never(part)


def _number(part: Numeric, given: Given) -> int:
    """The integer of a part."""
    match part:
        case LengthPart():
            return part.number(given.size)
        case IdPart():
            return given.number
        case AddressPart():
            return given.address
        case CellPart():
            return sum(_bits(slot, given) << slot.shift for slot in part.slots)
        case EqualPart():
            return part.value(_number(part.of, given))
        case _:
            assert_never(part)


def _bits(slot: Slot, given: Given) -> int:
    """The bits of a slot."""
    match slot:
        case IdSlot():
            return given.number >> slot.at & (1 << slot.bits) - 1
        case AddressSlot():
            return given.address
        case ConstantSlot():
            return slot.values[0]
        case Member():
            return content.member_bits(slot, {slot.name: slot.number.default, **given.beside})
        case _:
            assert_never(slot)
