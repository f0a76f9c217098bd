"""Frames with one wrong part each, and the kind of fault that every decoder reports.

One part of a valid frame is changed, and parts that depend on it (length, check value, inserted bytes) are
computed again. The interpreter of the plan determines the kind. A change that results in a valid frame does
not become a vector.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.vectors.choice import filled, whole
from qlinkgen.backends.vectors.writer import Json
from qlinkgen.model.integer import Integer
from qlinkgen.plan.codec import Codec, sent
from qlinkgen.plan.coding import Insertion
from qlinkgen.plan.content import Raw, pack, pack_items, places, unpack_items
from qlinkgen.plan.expr import Clear, Condition, Legible, OneOf, Within
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
    Part,
    PayloadPart,
    Slot,
)
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ConstantStep,
    CountStep,
    FilledStep,
    ItemsStep,
    Member,
    RecordPlan,
    RecordsStep,
    RecordStep,
    ReservedStep,
    SimpleStep,
    Step,
    ValueStep,
)
from qlinkgen.plan.reading import BadFrame
from qlinkgen.plan.transparency import Coded, FrameStuffing, PayloadStuffing, Plain, SevenBit
from qlinkgen.plan.tree import MessagePlan


@dataclass(frozen=True, slots=True)
class Good:
    """A valid frame."""

    message: MessagePlan
    address: int | None
    values: Mapping[str, Raw]
    #: Values of the frame.
    beside: Mapping[str, Raw]
    payload: bytes
    wire: bytes
    #: The frame that it answers, b"" if it does not depend on one.
    request: bytes

    @property
    def frame(self) -> FramePlan:
        """The kind of its frame."""
        return self.message.frame_for(len(self.payload))


@dataclass(frozen=True, slots=True)
class Bad:
    """One wrong frame.

    Attributes:
        part: the wrong part of the frame, or the one in which it ends.
        what: the error.
    """

    kind: str
    part: str
    what: str
    wire: bytes
    good: Good

    def entry(self) -> Mapping[str, Json]:
        """The line in the file."""
        request: dict[str, Json] = {"request": self.good.request.hex()} if self.good.request else {}
        return {
            "kind": self.kind,
            "message": self.good.message.name,
            "part": self.part,
            "what": self.what,
            "wire": self.wire.hex(),
            **request,
        }


#: A frame of up to this size is cut after each byte.
_ALL_CUTS = 512


class Faults:
    """Makes wrong frames from valid ones."""

    def __init__(self, codec: Codec, kept: Codec | None = None) -> None:
        """``codec`` determines the kinds; ``kept`` knows only the selected messages, if not all are."""
        self._codec, self._kept = codec, kept

    def of(self, good: Good, *, first: bool) -> Iterator[Bad]:
        """The faults of a message; ``first``: including those that are the same for its direction."""
        seen = {good.wire}
        for part, what, wire in _Frame(self._codec, good).changes(first=first):
            if wire not in seen and (kind := self._kind(good, wire)):
                yield Bad(kind, part, what, wire, good)
            seen.add(wire)

    def absent(self, good: Good) -> tuple[str, ...]:
        """The names of the parts that a frame does not have as their condition does not hold."""
        sent = _Frame(self._codec, good).parts
        return tuple(part.name for part in good.message.envelope_in(good.frame).parts if part not in sent)

    def _kind(self, good: Good, wire: bytes) -> str:
        """The kind of a fault; "" if there is none, or another one where only some messages are known."""
        kind = _judged(self._codec, good, wire)
        known = self._kept is None or bool(good.request) or kind == _judged(self._kept, good, wire)
        return kind if known else ""


def _judged(codec: Codec, good: Good, wire: bytes) -> str:
    try:
        codec.decode_as(good.message, wire, good.request)
    except BadFrame as bad:
        return bad.kind
    return ""


class _Frame:
    """A valid frame, divided into parts."""

    def __init__(self, codec: Codec, good: Good) -> None:
        self._codec, self._good, self._message = codec, good, good.message
        self._frame = good.frame
        self._envelope, self._transparency = good.message.envelope_in(good.frame), good.frame.transparency
        self._cells = self._made(good.payload)

    @property
    def parts(self) -> Sequence[Part]:
        """The parts that the frame has."""
        return [part for part in self._envelope.parts if not self._envelope.absent(part, self._cells)]

    def changes(self, *, first: bool) -> Iterator[tuple[str, str, bytes]]:
        """All changes to try: name of the part, error, frame."""
        for part in self.parts:
            if first or not isinstance(part, ConstantPart | LengthPart | IdPart | CellPart | EqualPart):
                for what, cells in self._changed(part):
                    yield part.name, what, self._joined(self._derived({**self._cells, **cells}, part))
        yield from self._misplaced()
        wire = self._good.wire
        for size in _cuts(len(wire)) if first else (len(wire) - 1,):
            yield self._part_at(self._cells, wire, size), f"it ends after {size} bytes", wire[:size]
        if first:
            yield self.parts[-1].name, "a byte follows the frame", wire + b"\1"

    def _made(self, payload: bytes) -> dict[str, bytes]:
        good = self._good
        data = sent(self._frame, payload)
        return self._codec.cells(self._message, data, good.address or 0, good.beside, self._frame)

    def _derived(self, cells: dict[str, bytes], changed: Part) -> Mapping[str, bytes]:
        """The parts, those that are derived from others computed again."""
        for part in self._envelope.parts:
            if isinstance(part, EqualPart) and part is not changed:
                number = part.of.integer.unpack(cells[part.of.name])
                cells[part.name] = part.integer.pack(part.value(number))
        return cells

    def _joined(self, cells: Mapping[str, bytes]) -> bytes:
        return self._codec.join(self._message, cells, self._good.request, self._frame)

    # Parts

    def _changed(self, part: Part) -> Iterator[tuple[str, Mapping[str, bytes]]]:
        """Errors in a part, each with the changed parts."""
        name = part.name
        match part:
            case ConstantPart():
                data = part.data[:-1] + bytes((part.data[-1] ^ 1,))
                yield f"{name} is {data.hex()}", {name: data}
            case LengthPart() | IdPart() | AddressPart() | CellPart() | EqualPart():
                for number in self._numbers(part):
                    yield f"{name} is {number}", {name: part.integer.pack(number)}
                if part.digits:
                    yield f"{name} is not a number", {name: part.digits.wrong}
            case MarkPart():
                yield from self._marks(part)
            case PayloadPart():
                yield from ((what, self._made(payload)) for what, payload in self._payloads())
            case CheckPart():
                yield from ((what, {name: part.check.pack(value)}) for what, value in self._checks(part))
            case BlocksPart():
                values = part.values(self._cells[self._envelope.payload.name])
                if values:
                    yield "a bit of the last is flipped", {name: values[:-1] + bytes((values[-1] ^ 1,))}
            case _:
                assert_never(part)

    def _numbers(self, part: Numeric) -> Iterable[int]:
        most = part.integer.maximum
        match part:
            case LengthPart():
                now = part.integer.unpack(self._cells[part.name])
                near = (part.least - 1, now - 1, now + 1, part.most + 1)
                return [number for number in near if 0 <= number <= most]
            case IdPart():
                return self._unused(most)
            case AddressPart():
                return _outside(self._message.allowed, 0, most)
            case CellPart():
                return [number for slot in part.slots for number in self._slot_numbers(part, slot)]
            case EqualPart():
                return (part.integer.unpack(self._cells[part.name]) ^ 1,)
            case _:
                assert_never(part)

    def _slot_numbers(self, part: CellPart, slot: Slot) -> Iterator[int]:
        """Numbers of a part with other bits in a slot."""
        now, mask = part.integer.unpack(self._cells[part.name]), (1 << slot.bits) - 1
        wrong: Iterable[int]
        match slot:
            case ConstantSlot():
                wrong = itertools.islice((bits for bits in range(mask + 1) if bits not in slot.values), 1)
            case IdSlot():
                known = self._codec.plan.known(self._codec.plan.direction_of(self._message))
                rest = self._message.id & ~(mask << slot.at)
                unused = (bits for bits in range(mask + 1) if rest | bits << slot.at not in known)
                wrong = itertools.islice(unused, 1)
            case AddressSlot():
                wrong = _outside(self._message.allowed, 0, mask)
            case Member():
                integer = slot.number.integer
                outside = (
                    n for rule in slot.conditions for n in _outside(rule, integer.minimum, integer.maximum)
                )
                wrong = [number & mask for number in outside]
            case _:
                assert_never(slot)
        yield from (now & ~(mask << slot.shift) | bits << slot.shift for bits in wrong)

    def _unused(self, most: int) -> Iterable[int]:
        """An unused message number, if there is one."""
        ends = {part.end_id for part in self._envelope.parts if isinstance(part, MarkPart)}
        taken = {message.id - self._frame.base for message in self._codec.plan.messages} | ends
        return itertools.islice((number for number in range(1, most + 1) if number not in taken), 1)

    def _marks(self, part: MarkPart) -> Iterator[tuple[str, Mapping[str, bytes]]]:
        name, (byte,) = part.name, self._cells[part.name]
        yield f"{name} has another address", {name: bytes((byte ^ 1 << part.address.shift,))}
        yield f"{name} is not marked", {name: bytes((byte ^ part.marker,))}
        if part.end_id is not None:
            yield f"{name} is a header", {name: bytes((byte ^ 1 << part.id.shift,))}
            return
        for number in self._unused(part.id.mask):
            yield f"{part.id_name} is {number}", {name: bytes((part.byte(number, part.address_of(byte)),))}
        for address in _outside(self._message.allowed, 0, part.address.mask):
            yield f"{part.address_name} is {address}", self._codec.cells(self._message, b"", address)

    def _checks(self, part: CheckPart) -> Iterator[tuple[str, int]]:
        mask, refusal = part.check.mask, part.check.rejected
        value = self._value(part) & mask
        bits = (1 << bit for bit in range(mask.bit_length()) if mask >> bit & 1)
        yield "a bit is flipped", next(value ^ bit for bit in bits if value ^ bit != refusal)
        if refusal is not None:
            yield "the command is refused", refusal

    def _value(self, part: CheckPart) -> int:
        """The right check value."""
        cells = dict(self._cells)
        for each in (*self._envelope.filling, *self._envelope.conditional_checks):
            value = self._codec.check_value(each, self._envelope, cells, self._good.request)
            if each is part:
                return value
            cells[each.name] = each.check.pack(value)
        raise AssertionError(part.name)

    def _payloads(self) -> Iterator[tuple[str, bytes]]:
        plan, length = self._message.payload, self._envelope.length
        payload = plan.filled(self._good.payload)
        # Of a list between separators the first item.
        firsts = {
            step.name: (step, at) for step, at in reversed(list(places(plan, payload, self._good.beside)))
        }
        for step, at in reversed(firsts.values()):
            for name, number, data in _spoilt(step, payload[at:]):
                yield f"{name} is {number}", payload[:at] + data + payload[at + len(data) :]
        if length is None or length.integer.unpack(self._cells[length.name]) < length.integer.maximum:
            yield "one byte too many", payload + b"\0"
        yield "the last byte is missing", payload[:-1]
        if isinstance(self._transparency, SevenBit) and payload:
            yield "a byte is marked", bytes((payload[0] | self._transparency.marker,)) + payload[1:]

    # Stuffing

    def _misplaced(self) -> Iterator[tuple[str, str, bytes]]:
        """Frames with many stuffed bytes, one of the inserted bytes wrong."""
        plan, address = self._message.payload, self._good.address or 0
        match self._transparency:
            case FrameStuffing(rule):
                beside = self._good.beside
                cells = self._made(pack(plan, {**filled(rule.after).values(plan, beside), **beside}))
                wire = self._joined(cells)
                for at in _lone(rule, wire, self._inserted(wire)):
                    for what, data in _damaged(rule, wire, at):
                        yield self._part_at(cells, wire, at - 1), what, data
            case PayloadStuffing(rule) if isinstance(rule, Insertion):
                sent = rule.encode(pack(plan, filled(rule.after).values(plan)))
                for at in _lone(rule, sent, rule.places(sent)):
                    for what, data in _damaged(rule, sent, at):
                        cells = self._codec.cells(self._message, data, address)
                        yield self._envelope.payload.name, what, self._joined(cells)
            case Coded(stages=()) | Plain() | SevenBit() | PayloadStuffing():
                pass  # every byte of a payload to which a number is added is right
            case Coded():
                yield from self._miscoded(self._transparency)
            case _:
                assert_never(self._transparency)

    def _miscoded(self, coded: Coded) -> Iterator[tuple[str, str, bytes]]:
        """Frames with a coded byte changed or missing."""
        wire, name = self._good.wire, self._envelope.payload.name
        for at in range(coded.front, len(wire) - coded.back):
            if wire[at] not in self._good.payload:
                yield name, "a coded byte is wrong", wire[:at] + bytes((wire[at] ^ 0x80,)) + wire[at + 1 :]
                yield name, "a coded byte is missing", wire[:at] + wire[at + 1 :]
                return

    def _inserted(self, wire: bytes) -> list[int]:
        """Offsets of the bytes inserted into a stuffed frame."""
        if not isinstance(self._transparency, FrameStuffing):
            return []
        front, end = self._transparency.front, len(wire) - self._transparency.back
        return [front + at for at in self._transparency.rule.places(wire[front:end])]

    def _part_at(self, cells: Mapping[str, bytes], wire: bytes, at: int) -> str:
        """The name of the part that a byte belongs to."""
        at -= sum(place < at for place in self._inserted(wire))
        blocks = self._envelope.blocks
        for part in self._envelope.parts:
            if isinstance(part, PayloadPart) and blocks:
                size = len(cells[part.name]) + blocks.added(len(cells[part.name]))
                if at < size and at % (blocks.every + blocks.check.size) >= min(
                    blocks.every, size - blocks.check.size
                ):
                    return blocks.name
                at -= size
            else:
                at -= len(cells[part.name]) if part.name in cells else part.size
            if at < 0:
                return part.name
        return self.parts[-1].name


def _lone(rule: Insertion, sent: bytes, places: Iterable[int]) -> Iterable[int]:
    """The first inserted byte whose removal leaves neither a valid frame nor a preamble."""
    hidden = (rule.insert, rule.after[0])
    lone = (at for at in places if at + 1 < len(sent) and sent[at + 1] not in hidden)
    return itertools.islice(lone, 1)


def _damaged(rule: Insertion, sent: bytes, at: int) -> Iterator[tuple[str, bytes]]:
    other = next(byte for byte in (rule.insert ^ 1, rule.insert ^ 2) if byte not in rule.after[:1])
    yield "an inserted byte is wrong", sent[:at] + bytes((other,)) + sent[at + 1 :]
    yield "an inserted byte is missing", sent[:at] + sent[at + 1 :]


# Illegal values ---------------------------------------------------------------------------------------------


def _spoilt(step: Step, data: bytes) -> Iterator[tuple[str, int, bytes]]:
    """Name, number and bytes of illegal values of a step; ``data`` begins with the legal bytes."""
    if isinstance(step, RecordStep):
        return _spoilt_record(step.name, step.record, data)
    if isinstance(step, RecordsStep):
        return _spoilt_record(f"{step.name}[0]", step.record, data) if step.length.minimum else iter(())
    return _spoilt_simple(step, data)


def _spoilt_simple(step: SimpleStep, data: bytes) -> Iterator[tuple[str, int, bytes]]:  # noqa: C901  # a case a step
    match step:
        case ValueStep() | ConstantStep():
            yield from _beside(step.name, step.integer, step.conditions)
        case CountStep() if step.integer.text:
            yield from _beside(step.name, step.integer, ())
        case CountStep():
            number = step.integer.unpack(data[: step.integer.size])
            yield from _beside(step.name, step.integer, (Within(number, number),))
        case FilledStep():
            number = step.integer.unpack(data[: step.integer.size]) ^ 1
            yield step.name, number, step.integer.pack(number)
        case BitsStep():
            whole = step.integer.unpack(data[: step.integer.size])
            for member in step.members:
                own = member.number.integer
                for name, number, _ in _beside(member.name, own, member.conditions):
                    bits = whole & ~(own.mask << member.shift) | (number & own.mask) << member.shift
                    yield name, number, step.integer.pack(step.integer.signed_value(bits & step.integer.mask))
        case BytesStep():
            if step.text and step.length.minimum:
                yield step.name, data[0] | 0x80, bytes((data[0] | 0x80,))
        case ItemsStep():
            yield from _items(step, data)
        case ReservedStep():
            pass
        case _:
            assert_never(step)


def _spoilt_record(name: str, record: RecordPlan, data: bytes) -> Iterator[tuple[str, int, bytes]]:
    for step in record.payload.steps:
        at = step.place.front.fixed
        for inner, number, spoilt in _spoilt(step, data[at:]):
            yield f"{name}.{inner}", number, data[:at] + spoilt


def _items(step: ItemsStep, data: bytes) -> Iterator[tuple[str, int, bytes]]:
    """An illegal first item of a run that has always some."""
    if not step.length.minimum:
        return
    if not step.packed:
        yield from _beside(step.name, step.item, step.conditions)
        return
    items = unpack_items(step, data, whole(step, step.length.minimum))
    for rule in step.conditions:
        for number in _outside(rule, step.item.minimum, step.item.maximum):
            yield step.name, number, pack_items(step, [number, *items[1:]])


def _beside(name: str, integer: Integer, rules: Iterable[Condition]) -> Iterator[tuple[str, int, bytes]]:
    for rule in rules:
        for number in _outside(rule, integer.minimum, integer.maximum):
            yield name, number, integer.pack(number)
    if integer.text and integer.text.fixed:
        data = integer.text.wrong
        yield name, integer.unpack(data), data
    if integer.bcd:
        data = bytes((0xA5, *bytes(integer.size - 1)))
        yield name, integer.unpack(data), data


def _outside(rule: Condition | None, least: int, most: int) -> list[int]:
    """A number from least to most that violates a condition, if there is one."""
    match rule:
        case Within():
            near = [rule.high + 1, rule.low - 1]
        case OneOf():
            near = [number for each in rule.ranges for number in (each.high + 1, each.low - 1)]
        case Clear():
            near = [rule.mask & -rule.mask]
        case Legible():
            near = [rule.characters.excluded[-1] if rule.characters.excluded else 0x80]
        case None:
            return []
        case _:
            assert_never(rule)
    return [number for number in near if least <= number <= most and not rule.holds(number)][:1]


def _cuts(size: int) -> Iterable[int]:
    """Sizes to which a frame is cut: all, or those near both ends of a long frame."""
    return range(size) if size <= _ALL_CUTS else (*range(_ALL_CUTS // 2), *range(size - _ALL_CUTS // 2, size))
