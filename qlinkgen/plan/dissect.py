"""Assigns each byte of a frame to a span, and lists the rules that the frame violates.

`Codec.decode` stops at the first fault; `dissect` continues until every byte belongs to a span. Both agree:
`Dissection.kind` is the kind that `decode` raises, and one of `Dissection.faults` has it. Consequences of
another fault are not listed: after a wrong inserted byte, for example, the check value is not checked.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import assert_never

from qlinkgen.model.integer import Integer
from qlinkgen.model.message import Direction
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.coding import Add, Bytewise
from qlinkgen.plan.content import BadContent, MoreNeeded, broken, measure
from qlinkgen.plan.ends import ByKind, ByLength, ByMark, ByMessage, BySilence, ByTerminator, ByTurn, Hunt
from qlinkgen.plan.fields import Fields
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.parts import (
    AddressPart,
    BlocksPart,
    CellPart,
    CheckPart,
    ConstantPart,
    EqualPart,
    IdPart,
    LengthPart,
    MarkPart,
    Numeric,
    Part,
    PayloadPart,
    gathered,
)
from qlinkgen.plan.payload import Member, Step
from qlinkgen.plan.proofs import proof_of
from qlinkgen.plan.reading import BadFrame, Cursor, Incomplete, is_wrong, stuffed_parts
from qlinkgen.plan.spans import Around, Cell, Dissection, Fault, Rule, Span
from qlinkgen.plan.transparency import Coded, FrameStuffing, PayloadStuffing
from qlinkgen.plan.tree import MessagePlan, Plan

Named = Part | Step | Member | None


def dissect(
    plan: Plan, wire: bytes, direction: Direction, request: bytes = b"", turned: MessagePlan | None = None
) -> Dissection:
    """Dissect exactly one frame; ``request`` is the frame that it answers.

    ``turned`` is the message of a frame that only its turn tells.
    """
    codec = Codec(plan)
    try:
        if turned is None:
            codec.decode(wire, direction, request)
        else:
            codec.decode_as(turned, wire)
    except BadFrame as bad:
        kind = bad.kind
    else:
        kind = ""
    frame = plan.frames[direction]
    if turned is not None:
        return _TurnedWalk(codec, wire, direction, request, kind, turned).run()
    frame = _kind_of(frame, wire) if frame.kinds else frame
    walk = _EndedWalk if frame.whole else _Walk
    return walk(codec, wire, direction, request, kind).run()


def _kind_of(frame: FramePlan, wire: bytes) -> FramePlan:
    """The kind of the frame, or else the one of which the bytes hold the first beginning."""
    kinds = [(first, each) for each in frame.kinds for first in each.envelope.starts]
    begun = (each for first, each in kinds if first.startswith(wire[: len(first)]))
    held = [(at, each) for first, each in kinds if (at := wire.find(first)) >= 0]
    return next(begun, min(held, key=lambda each: each[0])[1] if held else frame.sought[0])


def request_size(plan: Plan, wire: bytes) -> int:
    """Size of the packet at the beginning of ``wire``; the size of ``wire`` if it cannot be determined."""
    message = plan.known("request").get(wire[0]) if wire else None
    if message is None:
        return len(wire)
    beside = message.envelope.overhead
    try:
        size = measure(message.payload, wire[message.envelope.header_size :])
    except (MoreNeeded, BadContent):
        return len(wire)
    return min(len(wire), size + beside)


class _Cursor(Cursor):
    """Takes a wrong inserted byte as a byte of the frame and continues."""

    def __init__(
        self, wire: bytes, at: int, stuffing: FrameStuffing | None, coding: Bytewise | None, *, hunting: bool
    ) -> None:
        super().__init__(wire, at, stuffing.rule if stuffing else None, hunting=hunting, coding=coding)
        #: Offsets of wrong inserted bytes.
        self.wrong: list[int] = []
        #: Offset of a new frame inside this one.
        self.next: int | None = None

    def some(self, size: int, *, stuffed: bool) -> None:
        """Take ``size`` bytes, or all that are left."""
        if self.next is None:
            with suppress(Incomplete):
                self.take(size, stuffed=stuffed)

    def misplaced(self, *, again: bool) -> None:
        """Record the offset."""
        if again:
            self.at = self.next = self.at - 2
            raise Incomplete
        self.at -= 1
        self.wrong.append(self.at)


class _Walk:
    """Divides one frame into parts, then checks them."""

    def __init__(self, codec: Codec, wire: bytes, direction: Direction, request: bytes, kind: str) -> None:
        self.codec, self.plan, self.frame = codec, codec.plan, _kind_of(codec.plan.frames[direction], wire)
        self.wire, self.direction, self.request, self.kind = wire, direction, request, kind
        self.known = self.plan.known(direction)
        self.envelope = self.frame.envelope
        stuffing = self.frame.transparency
        self.whole = stuffing if isinstance(stuffing, FrameStuffing) else None
        self.alone = stuffing if isinstance(stuffing, PayloadStuffing) else None
        coded = isinstance(stuffing, Coded) and not self.frame.whole
        self.coding = stuffing.bytewise if isinstance(stuffing, Coded) and coded else None
        self.stuffed = {part.name for part in stuffed_parts(self.frame)}
        hunting = isinstance(self.frame.receiver, Hunt)
        self.cursor = _Cursor(wire, 0, self.whole, self.coding, hunting=hunting)
        self.message: MessagePlan | None = None
        self.number: int | None = None
        self.address: int | None = None
        self.cells: dict[str, Cell] = {}
        self.wanted: dict[str, int] = {}
        self.spans: list[Span] = []
        self.faults: list[Fault] = []
        self.expected: dict[str, int] = {}
        #: The preamble is missing, so the length may be any byte.
        self.no_preamble = False
        #: A count is out of range; the payload is assumed to be the rest.
        self.miscounted = False
        #: All offsets that represent a byte, by the first of them; one offset each if none is listed.
        self.units: dict[int, range] = {}

    def run(self) -> Dissection:
        """Dissect the frame."""
        front = self._begin()
        if front is not None:
            self._divide(front)
            self._close()
            self._judge()
        faults = sorted(self.faults, key=lambda fault: fault.kind != self.kind)
        return Dissection(
            self.plan, self.direction, self.wire, self.request, self.message, self.number, self.address,
            tuple(sorted(self.spans, key=lambda span: span.places[0])),
            tuple(dict.fromkeys(faults)), self.kind, {**self.cells, **self._seeds()}, self.expected,
            self.frame,
        )  # fmt: skip

    def _seeds(self) -> dict[str, Cell]:
        """The bytes of the seeds, which are not on the wire."""
        seeds = self.message.message.seeds if self.message else ()
        return {name: Cell(data, (-1,) * len(data), data) for name, data in seeds}

    # Places

    def _begin(self) -> tuple[Part, ...] | None:
        """Find the beginning. Returns the parts to take before the payload, None without a frame."""
        first, *others = self.envelope.parts
        match first:
            case ConstantPart() if self.kind == "frame" and not self.wire.startswith(first.data):
                start = self.wire.find(first.data)
                if start < 0:
                    self._lost(first)
                    return tuple(others[: self.envelope.payload_at - 1])
            case IdPart() | AddressPart() | CellPart() if first.numbers and self.kind == "frame":
                found = [at for each in first.starts if (at := self.wire.find(each)) >= 0]
                if not found:
                    self._fault("frame", Rule.BEGINNING, 0, first)
                    self._around(Around.BEFORE, range(len(self.wire)), "frame")
                    return None
                start = min(found)
            case MarkPart():
                heads = (at for at, byte in enumerate(self.wire) if self._is_header(first, byte))
                start = next(heads, -1)
                if start < 0:
                    kind = "frame" if self.wire else "truncated"
                    self._fault(kind, Rule.BEGINNING, 0, first)
                    self._around(Around.BEFORE, range(len(self.wire)), kind)
                    return None
            case _:
                start = 0
        if start:
            self._fault("frame", Rule.FIRST, 0, seen=start)
            self._around(Around.BEFORE, range(start), "frame")
            self.cursor.at = start
        return self.envelope.front

    def _is_header(self, part: MarkPart, byte: int) -> bool:
        assert isinstance(self.frame.end, ByMark)
        return bool(byte & part.marker) and part.id_of(byte) != self.frame.end.end.end_id

    def _lost(self, first: ConstantPart) -> None:
        """Handle a missing preamble: the first bytes may be its end, and a check value may cover it."""
        self.no_preamble = True
        self._fault("frame", Rule.BEGINNING, 0, first)
        ends = (first.data[at:] for at in range(1, first.size))
        rest = next((end for end in ends if self.wire.startswith(end)), b"")
        self._around(Around.LOST, range(len(rest)), "frame")
        self.cells[first.name] = Cell(first.data, (), first.data)
        self.wanted[first.name] = first.size
        self.cursor.at = len(rest)

    def _divide(self, front: Sequence[Part]) -> None:
        """Take the parts in wire order."""
        for part in front:
            self._take(part, self._size(part))
            if isinstance(part, LengthPart) and self._size(part) and not self.no_preamble:
                self._bound(part)
        self._identify()
        if self.message is not None:
            self.envelope = self.message.envelope_in(self.frame)
        self._take_payload()
        for part in self.envelope.back:
            if isinstance(part, BlocksPart):
                continue
            if isinstance(part, MarkPart) and self._interrupted(part):
                self.wanted[part.name] = 0
            self._take(part, self.wanted.get(part.name, self._size(part)))
        self._identify()

    def _size(self, part: Part) -> int:
        """Size of a part before stuffing, 0 if the frame does not have it."""
        cells = {name: cell.data for name, cell in self.cells.items()}
        return 0 if self.envelope.absent(part, cells) else part.size

    def _interrupted(self, part: MarkPart) -> bool:
        """Whether a header occurs in place of the end."""
        at = self.cursor.at
        if at < len(self.wire) and self._is_header(part, self.wire[at]):
            self.cursor.next = at
        return self.cursor.next is not None

    def _take(self, part: Part, size: int) -> None:
        """Take a part, or the rest of it."""
        before = self._found(part)
        taken = len(self.cursor.places)
        self.cursor.some(size, stuffed=part.name in self.stuffed)
        places = tuple(self.cursor.places[taken:])
        coded = self.cursor.coded
        data = bytes(coded[at][1] if at in coded else self.wire[at] for at in places)
        self.units |= {at: coded[at][0] for at in places if at in coded}
        self.cells[part.name] = Cell(before.data + data, before.places + places, b"")
        self.wanted[part.name] = len(before.data) + size

    def _take_payload(self) -> None:
        part, end = self.envelope.payload, self.frame.end
        trailer = sum(map(self._size, self.envelope.back))
        match end:
            case ByLength():
                told = end.part
                if (before := self.envelope.before) and before.length and self._size(before.length):
                    told = before.length
                length = self._number_in(told, told.integer)
                fits = length is not None and told.least <= length <= told.most
                size = told.payload(length) if fits and length is not None else self._left() - trailer
                if self.envelope.blocks:
                    self._take_blocks(self.envelope.blocks, max(0, size), fits=fits)
                    return
            case ByMark():
                size = self._marked_size(end)
            case ByTurn():
                size = self._left()
            case ByTerminator() | BySilence() | ByKind():
                raise AssertionError("the terminator or the kind is found first")
            case ByMessage() if self.frame.needs_request:
                payload = self.message.payload if self.message else None
                size = max(payload.least, min(payload.most, self._left() - trailer)) if payload else 0
            case ByMessage():
                size = self._measured(part)
            case _:
                assert_never(end)
        self._take(part, max(0, size))

    def _take_blocks(self, part: BlocksPart, size: int, *, fits: bool) -> None:
        """Take a payload of a size with its check values; without a length ``size`` is that of both."""
        payload, size = self.envelope.payload, size if fits else part.plain(size)
        for at in range(0, size, part.every):
            self._take(payload, min(part.every, size - at))
            self._take(part, part.check.size)
        for each, wanted in ((payload, size), (part, part.added(size))):
            self.cells.setdefault(each.name, Cell(b"", (), b""))
            self.wanted[each.name] = wanted

    def _marked_size(self, end: ByMark) -> int:
        """Size of the payload between two marks; without room for a check value none is assumed."""
        rest = self.wire[self.cursor.at :]
        between = next((at for at, byte in enumerate(rest) if byte & end.header.marker), None)
        least = self.message.payload.least if self.message else 0
        check = self.envelope.check
        beside = check.size if check else 0
        if between is None:
            return max(least, len(rest) - beside)
        if check and between - beside < least:
            self.wanted[check.name] = 0
            return between
        return between - beside

    def _measured(self, part: PayloadPart) -> int:
        """Bytes still to take of a payload whose size follows from its counts."""
        if self.message is None:
            return self._left() - self.envelope.trailer_size
        while True:
            data = self.cells[part.name].data if part.name in self.cells else b""
            try:
                return measure(self.message.payload, data) - len(data)
            except MoreNeeded as more:
                if self._left() == 0:
                    return more.least - len(data)
                self._take(part, 1)
            except BadContent:
                self.miscounted = True
                return self._left() - self.envelope.trailer_size

    def _left(self) -> int:
        """Number of bytes left, without inserted ones."""
        cursor = _Cursor(self.wire, self.cursor.at, self.whole, self.coding, hunting=False)
        cursor.due = self.cursor.due
        if self.cursor.next is None:
            cursor.some(len(self.wire) + 1, stuffed=True)
        return len(cursor.places)

    def _identify(self) -> None:
        """Set number, address and message as far as received."""
        if self.frame.needs_request and self.direction == "response":
            self.number = self.request[0] if self.request else None
        elif isinstance(first := self.envelope.parts[0], MarkPart):
            byte = self.cells[first.name].data[0]
            self.number, self.address = first.id_of(byte), first.address_of(byte)
        else:
            cells = {name: cell.data for name, cell in self.cells.items()}
            number = gathered(self.envelope.id, cells)
            self.number = None if number is None else number + self.frame.base
            self.address = gathered(self.envelope.address, cells) if self.envelope.address else None
            if (texts := self.plan.texts(self.direction)) is not None:
                self.number = texts.number(self._found(self.envelope.payload).data)
        self.message = None if self.number is None else self._told(self.known.get(self.number))

    def _told(self, message: MessagePlan | None) -> MessagePlan | None:
        """The answer to the request in a message that carries several: the valid one, or the first."""
        if message is None or not self.request or message is not self.plan.carrier:
            return message
        try:
            return self.codec.decode(self.wire, self.direction, self.request).message
        except BadFrame:
            asked = self.codec.decode(self.request, "request").message
            return self.plan.asked.get(asked.name, (message,))[0]

    def _number_in(self, part: Part, integer: Integer) -> int | None:
        data = self._found(part).data
        return integer.unpack(data) if len(data) == integer.size else None

    def _found(self, part: Part) -> Cell:
        return self.cells.get(part.name, Cell(b"", (), b""))

    def _close(self) -> None:
        """Add spans for bytes outside of parts; report missing and surplus bytes."""
        cursor, size = self.cursor, len(self.wire)
        self._close_cells()
        for at in cursor.inserted:
            self._around(Around.INSERTED, range(at, at + 1))
        for at in cursor.wrong:
            self._fault("stuffing", Rule.STUFFING, at, seen=self.wire[at])
        if cursor.next is not None:
            self._cut(cursor.next)
            return
        follows = self.wire[cursor.at : cursor.at + 1]
        if cursor.due and self.whole and follows == bytes((self.whole.rule.insert,)):
            self._around(Around.INSERTED, range(cursor.at, cursor.at + 1))
            cursor.at += 1
        self._after()
        short = [part for part in self.envelope.parts if self._short(part)]
        if short and not self.no_preamble:
            self._fault("truncated", Rule.WHOLE, size, short[0], sum(map(self._short, short)))

    def _close_cells(self) -> None:
        """Extend the sent bytes of each part up to the next one, inserted bytes included."""
        end = self.cursor.at
        for name, cell in reversed(self.cells.items()):
            if cell.places:
                self.cells[name] = replace(cell, sent=self.wire[cell.places[0] : end])
                end = cell.places[0]

    def _cut(self, at: int) -> None:
        """Remove the bytes from ``at`` on, which belong to a new frame."""
        marked = isinstance(self.frame.end, ByMark)
        self._fault("frame" if marked else "truncated", Rule.ALONE, at)
        self._around(Around.NEXT, range(at, len(self.wire)), "frame" if marked else "truncated")
        for name, cell in self.cells.items():
            kept = tuple(place for place in cell.places if place < at)
            if kept != cell.places:
                self.cells[name] = Cell(
                    cell.data[: len(kept)], kept, self.wire[kept[0] : at] if kept else b""
                )
        self._identify()

    def _after(self) -> None:
        rest = range(self.cursor.at, len(self.wire))
        if rest and self.coding and any(self._short(part) for part in self.envelope.parts):
            self._around(Around.UNCLEAR, rest, "truncated")  # the beginning of a coded byte
        elif rest:
            kind = "frame" if isinstance(self.frame.end, ByMark) else "length"
            self._fault(kind, Rule.LAST, rest.start, seen=len(rest))
            self._around(Around.AFTER, rest, kind)

    def _short(self, part: Part) -> int:
        """Number of missing bytes of a part."""
        return self.wanted.get(part.name, part.size) - len(self._found(part).data)

    # Checks

    def _judge(self) -> None:
        """Check the parts in wire order."""
        for part in self.envelope.parts:
            match part:
                case ConstantPart():
                    self._constant(part)
                case LengthPart() | IdPart() | AddressPart() | CellPart() | EqualPart():
                    self._numeric(part)
                case MarkPart():
                    self._mark(part)
                case PayloadPart():
                    self._payload(part)
                case CheckPart():
                    self._check(part)
                case BlocksPart():
                    self._check_blocks(part)
                case _:
                    assert_never(part)
        if self.frame.needs_request and self.direction == "response" and self.message is None:
            self._fault("unknown", Rule.MESSAGE, 0, seen=self.number)

    def _numeric(self, part: Numeric) -> None:
        match part:
            case LengthPart():
                self._length(part)
            case IdPart():
                self._span(part, self.number, "unknown" if self._unknown(part) else "")
            case AddressPart():
                self._address(part)
            case CellPart() | EqualPart():
                self._cell(part)
            case _:
                assert_never(part)

    def _constant(self, part: ConstantPart) -> None:
        data, places = self._found(part).data, self._found(part).places
        wrong = not part.data.startswith(data)
        if wrong:
            self._fault("frame", Rule.CONSTANT, places[0], part)
        self._span(part, None, "frame" if wrong else "")

    def _address(self, part: AddressPart) -> None:
        """Check an address, whose digits are wrong before it is."""
        cell = self._found(part)
        fault = self._addressed(part)
        if len(cell.data) == part.size and is_wrong(part, {part.name: cell.data}):
            fault = "frame"
            self._fault(fault, Rule.CONSTANT, cell.places[0], part)
        self._span(part, self.address, fault)

    def _cell(self, part: CellPart | EqualPart) -> None:
        """Check the constants, the message number and the address in the bits of an integer."""
        cells, number = (
            {name: cell.data for name, cell in self.cells.items()},
            self._number_in(part, part.integer),
        )
        fault = ""
        if number is not None and is_wrong(part, cells):
            fault = "frame"
            self._fault(fault, Rule.CONSTANT, self._found(part).places[0], part, number)
        if self.envelope.id and self.envelope.id[-1].part is part and self._unknown(part):
            fault = fault or "unknown"
        if isinstance(part, CellPart) and any(bits.part is part for bits in self.envelope.address):
            fault = fault or self._addressed(part)
        self._span(part, number, fault)
        if number is not None and isinstance(part, CellPart):
            for member in part.values:
                self._member(part, member, number)

    def _member(self, part: CellPart, member: Member, number: int) -> None:
        """Check a value of the frame."""
        cell, value = self._found(part), member.of(number)
        wrong = broken(member.conditions, value)
        if wrong:
            self._fault("range", Rule.VALUE, cell.places[0], member, value)
        self.spans.append(Span(member, cell.places, cell.data, part.size, value, "range" if wrong else ""))

    def _deciding(self, message: MessagePlan) -> Mapping[str, int]:
        """The values of the frame that decide about fields of the payload, as far as received."""
        found: dict[str, int] = {}
        for part, member in self.envelope.values:
            number = self._number_in(part, part.integer)
            if member in message.payload.decided_by and number is not None:
                found[member.name] = member.of(number)
        return found

    def _bound(self, part: LengthPart) -> None:
        number = self._number_in(part, part.integer)
        if number is not None and not part.holds(number):
            self._fault("length", Rule.LENGTH, self._found(part).places[0], part, number)

    def _length(self, part: LengthPart) -> None:
        wrong = any(each.rule is Rule.LENGTH for each in self.faults)
        self._span(part, self._number_in(part, part.integer), "length" if wrong else "")

    def _unknown(self, part: Part) -> bool:
        if self.number is None or self.message is not None:
            return False
        kind = "frame" if isinstance(part, MarkPart) else "unknown"
        self._fault(kind, Rule.MESSAGE, self._found(part).places[0], part, self.number)
        return True

    def _addressed(self, part: AddressPart | CellPart | MarkPart) -> str:
        """The kind of fault in the address, "" if there is none."""
        allowed = self.message.allowed if self.message else None
        if self.address is None or allowed is None or allowed.holds(self.address):
            return ""
        kind = "frame" if isinstance(part, MarkPart) and self.address == 0 else "range"
        self._fault(kind, Rule.ADDRESS, self._found(part).places[0], part, self.address)
        return kind

    def _mark(self, part: MarkPart) -> None:
        cell = self._found(part)
        if not cell.data:
            return
        byte = cell.data[0]
        if part.end_id is None:
            kind = "frame" if self._unknown(part) else self._addressed(part)
        else:
            wrong = part.address_of(byte) != self.address
            kind = "frame" if wrong else ""
            if wrong:
                self._fault("frame", Rule.END, cell.places[0], part, part.address_of(byte))
        self._span(part, byte, kind)

    def _check(self, part: CheckPart) -> None:
        data, check = self._found(part).data, part.check
        covered = [each for each in self.envelope.parts if each.name in check.over]
        by_message = check.chained or part in self.envelope.seeded
        if len(data) < part.size or any(map(self._short, covered)) or (by_message and not self.message):
            self._span(part, None)
            return
        cells = {name: cell.sent if self.alone else cell.data for name, cell in self.cells.items()}
        cells |= dict(self.message.message.seeds) if self.message else {}
        right = check.pack(self.codec.check_value(part, self.envelope, cells, self.request))
        received, expected = check.unpack(data), check.unpack(right)
        data = check.normal(data)
        if data != right and self._displaced(part):
            self._span(part, received)
            return
        self.expected[part.name] = expected
        if data == right:
            self._span(part, received)
            return
        refused = check.rejected is not None and data == check.pack(check.rejected)
        kind, rule = ("illegal", Rule.REFUSED) if refused else ("crc", Rule.CHECK)
        self._fault(kind, rule, self._found(part).places[0], part, received)
        self._span(part, received, kind)

    def _check_blocks(self, part: BlocksPart) -> None:
        """Check the values of all blocks; the first wrong one is a fault."""
        cell, size, check = self._found(part), part.check.size, part.check
        kind = ""
        for index, block in enumerate(part.blocks(self._found(self.envelope.payload).data)):
            received, right = cell.data[index * size : (index + 1) * size], check.of(block)
            if received != check.pack(right) and not self._displaced(part):
                kind, self.expected[part.name] = "crc", check.unpack(check.pack(right))
                self._fault(kind, Rule.CHECK, cell.places[index * size], part, check.unpack(received))
                break
        self._span(part, None, kind)

    def _displaced(self, part: CheckPart | BlocksPart) -> bool:
        """Whether wrong stuffing or a wrong length shifts the bytes, so the check value is meaningless."""
        if self.no_preamble:
            return True
        if part not in self.envelope.header_checks:
            return any(each.rule in (Rule.STUFFING, Rule.LENGTH, Rule.WHOLE) for each in self.faults)
        end = max(self._found(each).places[-1] for each in self.envelope.front)
        return any(
            each.rule is Rule.LENGTH or (each.rule is Rule.STUFFING and each.at <= end)
            for each in self.faults
        )

    # Payload

    def _payload(self, part: PayloadPart) -> None:
        cell = self._found(part)
        data, places = self._plain(cell, whole=self._short(part) == 0)
        at = places[0] if places else self.cursor.at
        message = self.message
        if message is None:
            if len(data) > part.most and self.alone:
                self._fault("length", Rule.SIZE, at, part, len(data))
            unknown = bool(self.frame.texts) and not self._short(part)
            if unknown:
                self._fault("unknown", Rule.MESSAGE, at, part)
            if places:
                fault = "unknown" if unknown else ""
                self.spans.append(Span(part, *self._sent(places), len(data), None, fault))
            return
        if not data and message.payload.empty_is_default and not self._short(part):
            return
        whole = self._short(part) == 0
        moved = any(each.rule in (Rule.STUFFING, Rule.ALONE) for each in self.faults)
        check = self.envelope.check
        # A marked frame without room for its check value.
        crowded = check is not None and self.wanted.get(check.name) == 0
        full = message.payload.filled(data) if whole else data
        beside = self._deciding(message)
        legal = not any(
            broken(each.conditions, beside.get(each.name, 0)) for each in message.payload.decided_by
        )
        sound = whole and not moved and not crowded and legal
        fields = Fields(message.payload, full, sound=sound, beside=beside)
        if fields.bad or crowded or self.miscounted:
            inside = message.payload.least <= len(data) <= message.payload.most and not crowded
            kind = "frame" if isinstance(self.frame.end, ByMark) and not inside else "length"
            self._fault(kind, Rule.SIZE, at, part, len(data))
        end = places[-1] + 1 if places else self.cursor.at
        for each in fields.wrong:
            place = places[each.at] if each.at < len(places) else end  # a zero that was not sent
            self.faults.append(
                Fault(each.kind, Rule.VALUE, place, each.of, each.seen, each.inside, each.right)
            )
        for span in fields.spans:
            own, raw = self._sent(places[at] for at in span.places if at < len(places))
            if own:
                self.spans.append(replace(span, places=own, raw=raw))

    def _plain(self, cell: Cell, *, whole: bool) -> tuple[bytes, tuple[int, ...]]:
        """The payload and its offsets without the bytes inserted by payload stuffing."""
        if self.alone is None:
            return cell.data, cell.places
        if isinstance(self.alone.rule, Add):
            return self.alone.rule.read(cell.data).plain, cell.places
        inserted = set()
        for at in self.alone.rule.places(cell.data):
            if cell.data[at : at + 1] == bytes((self.alone.rule.insert,)):
                inserted.add(at)
                self._around(Around.INSERTED, (cell.places[at],))
            elif at < len(cell.data):
                self._fault("stuffing", Rule.STUFFING, cell.places[at], seen=cell.data[at])
            elif whole:
                self._fault("stuffing", Rule.STUFFING, cell.places[-1] + 1)
        kept = [at for at in range(len(cell.data)) if at not in inserted]
        return bytes(cell.data[at] for at in kept), tuple(cell.places[at] for at in kept)

    # Results

    def _fault(self, kind: str, rule: Rule, at: int, of: Named = None, seen: int | None = None) -> None:
        self.faults.append(Fault(kind, rule, at, of, seen))

    def _around(self, where: Around, places: Sequence[int], fault: str = "") -> None:
        if places:
            raw = bytes(self.wire[at] for at in places)
            self.spans.append(Span(where, tuple(places), raw, len(raw), None, fault))

    def _span(self, part: Part, number: int | None, fault: str = "") -> None:
        """Add a span for the received bytes of a part."""
        cell = self._found(part)
        if cell.places:
            fault = fault or ("truncated" if self._short(part) else "")
            size = self.wanted.get(part.name, part.size)
            self.spans.append(Span(part, *self._sent(cell.places), size, number, fault))

    def _sent(self, places: Iterable[int]) -> tuple[tuple[int, ...], bytes]:
        """All offsets that represent bytes, and what is there."""
        own = tuple(each for place in places for each in self.units.get(place, (place,)))
        return own, bytes(self.wire[at] for at in own)


class _TurnedWalk(_Walk):
    """Checks a frame that is the payload of a known message."""

    def __init__(  # noqa: PLR0917  # as for other frames
        self, codec: Codec, wire: bytes, direction: Direction, request: bytes, kind: str, message: MessagePlan
    ) -> None:
        super().__init__(codec, wire, direction, request, kind)
        self.frame, self.envelope, self._known = message.frames[-1], message.envelope, message
        self.message, self.number = message, message.id

    def _identify(self) -> None:
        self.message, self.number = self._known, self._known.id

    def _payload(self, part: PayloadPart) -> None:
        super()._payload(part)
        command = self.plan.protocol.command_of(self._known.message)
        if command is None or command.response is not self._known.message or not self.request or self.kind:
            return
        proof = proof_of(self.plan.protocol, command)
        if proof is None:
            return
        last, right = self.spans[-1], proof.compute(self.request, self.wire)
        if last.number != right:
            assert isinstance(last.of, Step)
            self.kind = "crc"
            self.faults.append(Fault("crc", Rule.PROOF, last.places[0], last.of, last.number, right=right))
            self.spans[-1] = replace(last, fault="crc")


class _EndedWalk(_Walk):
    """Divides a frame that a terminator or a silence ends.

    It is decoded as a whole, then its parts are taken from both ends.
    """

    def _divide(self, front: Sequence[Part]) -> None:
        del front
        last, wire, start = self.frame.end, self.wire, self.cursor.at
        size = 0 if self.no_preamble else len(self.envelope.preamble)
        first = min(start + size, len(wire))
        stop = last.find(wire, first, len(wire)) if isinstance(last, ByTerminator) else len(wire)
        end = len(wire) if stop < 0 else min(len(wire), stop + self.closing)
        content = self._as_sent(start, first) + self._decoded(first, len(wire) if stop < 0 else stop)
        self.cursor.at = end
        self._allot(content, self._as_sent(stop, end) if stop >= 0 else None)
        self._identify()
        if self.message is not None:
            self.envelope = self.message.envelope
        limit = start + self.frame.max_wire - self.closing
        if isinstance(last, ByTerminator) and self.kind == "length" and not 0 <= stop <= limit:
            self._fault("length", Rule.TERMINATOR, len(wire), last.part)
        elif isinstance(last, BySilence) and len(wire) > limit:
            self._fault("length", Rule.LAST, limit, seen=len(wire) - limit)

    @property
    def closing(self) -> int:
        """Size of the terminator and what follows it."""
        end = self.frame.end
        return end.part.size + end.after if isinstance(end, ByTerminator) else 0

    def _as_sent(self, first: int, end: int) -> list[tuple[int, int]]:
        """Offset and value of bytes that are not coded."""
        return [(at, self.wire[at]) for at in range(first, end)]

    def _decoded(self, first: int, stop: int) -> list[tuple[int, int]]:
        """Offset and value of each byte from the first constant to the terminator."""
        coded = self.frame.transparency
        assert isinstance(coded, Coded)
        inner = min(stop, first + coded.front - len(self.envelope.preamble))
        end = max(inner, stop - (coded.back - self.closing))
        read, before, found = coded.read(self.wire[inner:end]), inner, self._as_sent(first, inner)
        for byte, place in zip(read.plain, read.places, strict=True):
            found.append((before, byte))
            self.units[before] = range(before, inner + place + 1)
            before = inner + place + 1
        if read.wrong is not None:
            at = inner + read.wrong
            self._fault("stuffing", Rule.STUFFING, at, seen=self.wire[at] if at < end else None)
        if before < end and (read.wrong is not None or len(found) == inner - first):
            self._around(Around.UNCLEAR, range(before, end), "stuffing" if read.wrong is not None else "")
        elif before < end:
            self.units[found[-1][0]] = range(found[-1][0], end)
        return found + self._as_sent(end, stop)

    def _allot(self, content: Sequence[tuple[int, int]], closing: Sequence[tuple[int, int]] | None) -> None:
        """Give each part its bytes; ``closing`` is the terminator and what follows it, None without one."""
        end, payload = self.frame.end, self.envelope.payload
        parts = [part for part in self.envelope.parts if part.name not in self.cells]
        last = parts.index(end.part) if isinstance(end, ByTerminator) else len(parts)
        before = parts[:last] if closing is not None else parts[: parts.index(payload)]
        fixed = sum(part.size for part in before)
        size = max(0, len(content) - fixed)
        self._give(parts[:last], content, size, whole=closing is not None)
        self._give(parts[last:], closing or (), size, whole=False)
        unclear = any(each.rule is Rule.STUFFING for each in self.faults)
        if closing is not None and not unclear and not payload.least <= len(content) - fixed <= payload.most:
            places = self._found(payload).places
            self._fault("length", Rule.SIZE, places[0] if places else self.cursor.at, payload, size)

    def _give(
        self, parts: Sequence[Part], content: Sequence[tuple[int, int]], size: int, *, whole: bool
    ) -> None:
        at = 0
        for part in parts:
            wanted = size if isinstance(part, PayloadPart) else part.size
            own = content[at : at + wanted]
            at += len(own)
            places = tuple(place for place, _ in own)
            data = bytes(byte for _, byte in own)
            self.cells[part.name] = Cell(data, places, self._sent(places)[1])
            self.wanted[part.name] = len(own) if whole else wanted

    def _close_cells(self) -> None:
        """Cells have their bytes as sent already."""

    def _displaced(self, part: CheckPart | BlocksPart) -> bool:
        del part
        incomplete = any(len(self._found(each).data) < each.size for each in self.envelope.parts)
        return self.no_preamble or incomplete or any(each.rule is Rule.STUFFING for each in self.faults)

    def _length(self, part: LengthPart) -> None:
        number, size = self._number_in(part, part.integer), len(self._found(self.envelope.payload).data)
        wrong = number is not None and part.payload(number) != size and not self._short(part)
        if wrong:
            self._fault("length", Rule.COUNTED, self._found(part).places[0], part, number)
        self._span(part, number, "length" if wrong else "")
