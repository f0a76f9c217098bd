"""A frame as parts in wire order, with sizes, coverage of the check value, end and receiver.

All three kinds of frame have the same kind of plan. The end of a delimited frame follows from a length or
from its message. Header and end of a marked frame are single bytes with a marker bit. The request of a packet
protocol is an id and a payload, its response a payload and a check value.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.model.frame import (
    DelimitedFrame,
    Frame,
    FrameKinds,
    MarkedFrame,
    PacketFrame,
    PartBits,
    Silence,
)
from qlinkgen.model.frame import Part as StatedPart
from qlinkgen.model.integer import Integer, byte_chunks
from qlinkgen.model.message import Direction
from qlinkgen.model.texts import Text
from qlinkgen.plan.check import Check
from qlinkgen.plan.coding import Add, Insertion, stage
from qlinkgen.plan.conditional import conditional
from qlinkgen.plan.ends import (
    ByKind,
    ByLength,
    ByMark,
    ByMessage,
    BySilence,
    ByTerminator,
    ByTurn,
    End,
    Gaps,
    Hunt,
    InStep,
    Marks,
    Receiver,
    Rescan,
)
from qlinkgen.plan.envelope import Envelope
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
    Part,
    PayloadPart,
    Slot,
)
from qlinkgen.plan.payload import Member
from qlinkgen.plan.transparency import (
    Coded,
    FrameStuffing,
    PayloadStuffing,
    Plain,
    SevenBit,
    Transparency,
)


@dataclass(frozen=True)
class FramePlan:
    """The frame around the messages of a direction; in most protocols both directions have the same.

    Attributes:
        envelope: its parts.
        end: what determines the end of a frame.
        transparency: the stuffing of its bytes.
        receiver: how frames are found in a stream.
        address: name of the address, "" if there is none.
        id_name: name of the message number.
        idle: silence on the line that ends a frame, None if the document states none.
        kinds: the kinds of frame, () if there is one; each with its own ``envelope``.
        name: name of the kind, "" if there is one.
        base: what is added to the number of a message in frames of this kind.
        only: the direction that frames of this kind go, None for both.
        texts: the ids that payloads begin with, by their number in generated code; () if parts hold ids.
        doc: what the document says of it; "" if there are several kinds, each of which has its own.
        section: where the document says so.
    """

    envelope: Envelope
    end: End
    transparency: Transparency
    receiver: Receiver
    address: str
    id_name: str
    idle: Silence | None = None
    kinds: tuple[FramePlan, ...] = ()
    name: str = ""
    base: int = 0
    only: Direction | None = None
    texts: tuple[bytes, ...] = ()
    doc: Text = ""
    section: Text = ""

    def towards(self, direction: Direction) -> FramePlan:
        """The kinds of frame of a direction."""
        found = tuple(each for each in self.kinds if each.only in (None, direction))
        return self if found == self.kinds else _several(found)

    @property
    def turned(self) -> bool:
        """Whether only its turn in a dialogue tells a frame."""
        return isinstance(self.end, ByTurn)

    @property
    def sought(self) -> tuple[FramePlan, ...]:
        """The kinds of frame that receivers look for, or the only one."""
        return tuple(each for each in self.every if not each.turned)

    @property
    def every(self) -> tuple[FramePlan, ...]:
        """The kinds of frame, or the only one."""
        return self.kinds or (self,)

    @property
    def values(self) -> Mapping[str, Member]:
        """The values of frames of any kind, by name."""
        return {member.name: member for each in self.every for _, member in each.envelope.values}

    @property
    def late_insert(self) -> bool:
        """Whether a byte may follow that is inserted after the last one of a frame; receivers do not wait."""
        return any(
            isinstance(each.transparency, FrameStuffing) and not each.transparency.back for each in self.every
        )

    @property
    def search(self) -> Mapping[str, object]:
        """What one receiver needs to find the frames of both directions, by its name in error messages."""
        envelope, end, way = self.envelope, self.end, self.transparency
        check = envelope.check
        return {
            "their first constant": envelope.preamble,
            "their main check value": check.check.algorithm if check else None,
            "check values of blocks": envelope.blocks is not None,
            "covered attributes": bool(envelope.seeded),
            "a main check value before the payload": check is not None and check in envelope.header_checks,
            "bytes after the terminator": isinstance(end, ByTerminator) and end.after > 0,
            "unstuffed parts at the end": isinstance(way, FrameStuffing) and way.back > 0,
        }

    @property
    def check(self) -> Check | None:
        """The main check value, of the first kind that has one; None where there is none."""
        if self.kinds:
            return next((each.check for each in self.kinds if each.check), None)
        part = self.envelope.check
        return part.check if part else None

    @property
    def whole(self) -> bool:
        """Whether the end of a frame is found before anything in it is read."""
        return isinstance(self.end, ByTerminator | BySilence)

    @property
    def silent(self) -> bool:
        """Whether nothing but a silence ends a frame."""
        return isinstance(self.end, BySilence)

    @property
    def seeded(self) -> bool:
        """Whether check values cover attributes of messages."""
        return any(each.envelope.seeded for each in self.every)

    def skips(self, byte: bytes) -> bool:
        """Whether receivers skip a byte between frames: each kind has a beginning, which is another one."""
        kinds = [each.envelope.starts for each in self.sought]
        return all(starts and not any(each.startswith(byte) for each in starts) for starts in kinds)

    @property
    def needs_request(self) -> bool:
        """Whether a response can be decoded only with its request."""
        return isinstance(self.receiver, InStep)

    @property
    def checks_header(self) -> bool:
        """Whether only message number and address in the header distinguish a frame from noise."""
        if self.kinds:
            return False
        envelope = self.envelope
        identifying = (part for part in envelope.front if envelope.identifies(part))
        bare = isinstance(self.receiver, Rescan) and self.receiver.bare
        return bare and any(envelope.known_at(part, envelope.id) for part in identifying)

    @property
    def max_payload(self) -> int:
        """Maximum payload size of the frame."""
        return max(each.envelope.payload.most for each in self.every)

    def holds(self, size: int) -> bool:
        """Whether a payload of a size fits."""
        part = self.envelope.payload
        return part.least <= size <= part.most

    @property
    def max_wire(self) -> int:
        """Maximum size on the wire of a frame that receivers look for, valid or not."""
        if self.kinds:
            return max(each.max_wire for each in self.sought)
        most = self.envelope.max_frame
        stuffing = self.transparency
        return stuffing.most_frame(most) if isinstance(stuffing, FrameStuffing | Coded) else most

    @property
    def longest(self) -> int:
        """Number of bytes after which a receiver reports bytes outside of frames."""
        if self.kinds:
            return self.max_wire
        return self.max_wire if self.whole else self.envelope.max_frame

    @property
    def flag(self) -> bytes:
        """The bytes that both begin and end a frame, b"" if no bytes do."""
        end = self.end.part.data if isinstance(self.end, ByTerminator) else b""
        return end if end and end == self.envelope.preamble else b""

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

    def with_check(self, *, checked: bool) -> Envelope:
        """The envelope of a message with (``checked``) or without a check value."""
        envelope = self.envelope
        if checked or envelope.check is None:
            return envelope
        return replace(
            envelope, parts=tuple(part for part in envelope.parts if not isinstance(part, CheckPart))
        )


# From the model


def frame_plan(frame: Frame, direction: Direction = "response") -> FramePlan:
    """Plan the frames of a direction of a protocol; of several kinds, those of both."""
    match frame:
        case DelimitedFrame():
            return _delimited(frame, direction)
        case MarkedFrame():
            return _marked(frame)
        case PacketFrame():
            return _packet(frame, direction)
        case FrameKinds():
            return _several(_kinds(frame))
        case _:
            assert_never(frame)


def frame_plans(frame: Frame) -> Mapping[Direction, FramePlan]:
    """The frames of each direction; directions with the same frame share one object."""
    response = frame_plan(frame)
    if isinstance(frame, FrameKinds):
        ways: tuple[Direction, ...] = ("request", "response")
        if not all(any(each.only in (None, way) for each in response.kinds) for way in ways):
            # No frame goes the other direction: its receivers pass over those of this one.
            response = _several(tuple(replace(each, only=None) for each in response.kinds))
        return {**{way: response.towards(way) for way in ways}, "message": response}
    same = not (isinstance(frame, PacketFrame) or (isinstance(frame, DelimitedFrame) and frame.directed))
    request = response if same else frame_plan(frame, "request")
    return {"request": request, "response": response, "message": request}


def _kinds(frame: FrameKinds) -> tuple[FramePlan, ...]:
    """Each kind has a plan of its own."""
    found: list[FramePlan] = []
    for each in frame.kinds:
        plan = _delimited(each.frame, "response", alone=False)
        end = ByTurn() if each.frame.is_payload else plan.end
        base = frame.base(each.family)
        found.append(replace(plan, end=end, name=each.title, base=base, only=each.only))
    return tuple(found)


def _several(kinds: tuple[FramePlan, ...]) -> FramePlan:
    """Frames of several kinds."""
    receivers = [each.receiver for each in kinds if not each.turned]
    return FramePlan(
        envelope=Envelope(()),
        end=ByKind(),
        transparency=Plain(),
        receiver=Rescan(
            bare=False,
            verified=all(isinstance(each, Rescan) and each.verified for each in receivers),
            seeded=any(each.envelope.seeded for each in kinds),
        ),
        address=next((each.address for each in kinds if each.address), ""),
        id_name=next((each.id_name for each in kinds if each.id_name), ""),
        kinds=kinds,
    )


def _delimited(whole: DelimitedFrame, direction: Direction, *, alone: bool = True) -> FramePlan:
    """Plan the frames of a direction; ``alone``: all frames have these parts."""
    frame = whole.towards(direction)
    transparency = _transparency(frame)
    envelope = _envelope(frame, transparency)
    address = frame.address
    end: End = ByLength(envelope.length) if envelope.length else ByMessage()
    if stated := frame.part("terminator"):
        part = next(each for each in envelope.parts if each.name == stated.name)
        assert isinstance(part, ConstantPart)
        end = ByTerminator(part, envelope.from_end(part) - part.size, stated.shared, frame.paired)
    if frame.ends_idle:
        end = BySilence()
    return FramePlan(
        envelope=envelope,
        end=end,
        transparency=transparency,
        receiver=Gaps()
        if frame.ends_idle
        else _receiver(envelope, transparency, alone=alone and not whole.directed),
        address=address.name if address else "",
        id_name=_id_name(frame),
        idle=frame.idle,
        doc=frame.doc,
        section=frame.section,
    )


def _id_name(frame: DelimitedFrame) -> str:
    opening = frame.payload.opening
    if opening is not None:
        return opening.name
    return frame.id_bits[-1].name if frame.id_bits else ""


def _transparency(frame: DelimitedFrame) -> Transparency:
    if not (frame.coding or frame.part("terminator") or frame.ends_idle):
        return Plain()
    coded = _coded(frame)
    rule = coded.stages[0] if coded.stages else None
    if frame.checked_after and isinstance(rule, Insertion | Add):
        return PayloadStuffing(rule)
    if frame.stuffing is not None and isinstance(rule, Insertion):
        return FrameStuffing(rule, coded.front, coded.back)
    return coded


def _coded(frame: DelimitedFrame) -> Coded:
    """The coding of a frame whose end is found first; without one, all before that is sent as it is."""
    names = [part.name for part in frame.parts]
    coded = [index for index, name in enumerate(names) if name in frame.coded]
    if not coded:
        roles = [part.role for part in frame.parts]
        end = roles.index("terminator") if "terminator" in roles else len(roles)
        coded = [int(roles[0] == "constant"), end - 1]
    front, back = frame.parts[: coded[0]], frame.parts[coded[-1] + 1 :]
    stages = tuple(map(stage, frame.coding))
    return Coded(stages, sum(part.size for part in front), sum(part.size for part in back))


def _envelope(frame: DelimitedFrame, transparency: Transparency) -> Envelope:
    whole = Envelope(_parts(frame, transparency))
    when = {part.name: part.when for part in frame.conditional}
    behind = {name: test for name, test in when.items() if name in {part.name for part in whole.back}}
    before = {name: test for name, test in when.items() if name not in behind}
    return replace(whole, before=conditional(whole.parts, before), after=conditional(whole.parts, behind))


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
            opening = part.opening.name if part.opening else ""
            return PayloadPart(part.name, part.min_size, part.max_size, most_sent, part.trim, opening)
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
        return IdPart(part.name, integer, part.numbers)
    if part.role == "address":
        return AddressPart(part.name, integer, part.numbers)
    if part.bits:
        return CellPart(part.name, integer, part.numbers, tuple(map(_slot, part.bits)))
    bias, payload = frame.length_bias, frame.payload
    most = min(integer.maximum, (bias + transparency.most_sent(payload.max_size)) // part.scale)
    least = -(-(bias + payload.min_size) // part.scale)
    first = frame.part("length")
    if first and first.otherwise is not None and first.scalar:
        if part is first:
            most = first.scalar.maximum
        else:
            least = max(least, first.scalar.maximum + 1)
    return LengthPart(part.name, integer, bias, least, most, part.scale, part.otherwise)


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


def _receiver(envelope: Envelope, transparency: Transparency, *, alone: bool) -> Receiver:
    """Choose between hunting and rescanning, for all targets; ``alone``: all frames have these parts."""
    if alone and isinstance(transparency, FrameStuffing) and _unique(envelope, transparency):
        return Hunt(transparency.rule.after[0], transparency.rule.insert)
    return Rescan(
        bare=not envelope.starts,
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
    plain = not any(
        isinstance(part, ConstantPart | CellPart | EqualPart)
        or (isinstance(part, AddressPart) and part.digits)
        for part in inner
    )
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
        envelope=envelope,
        end=ByMark(header, end),
        transparency=SevenBit(frame.marker),
        receiver=Marks(),
        address=frame.address_name,
        id_name=frame.id_name,
        doc=frame.doc,
        section=frame.section,
    )


def _packet(frame: PacketFrame, direction: Direction) -> FramePlan:
    payload = PayloadPart("payload", 0, frame.payload_max, frame.payload_max)
    number = IdPart(frame.id_name, Integer(8, signed=False, chunks=byte_chunks(1, "big")))
    request = Envelope((number, payload))
    check: tuple[Part, ...] = ()
    if frame.checksum is not None:
        value = Check(frame.checksum, frame.word_size, chained=True, rejected=frame.rejected)
        check = (CheckPart(frame.checksum_name, value),)
    return FramePlan(
        envelope=Envelope((payload, *check)) if direction == "response" else request,
        end=ByMessage(),
        transparency=Plain(),
        receiver=InStep(),
        address="",
        id_name=frame.id_name,
        doc=frame.doc,
        section=frame.section,
    )
