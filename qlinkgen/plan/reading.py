"""Reads one frame, part by part in wire order.

A wrong start is detected at the earliest possible byte, so the result does not depend on how the stream is
split.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.plan.coding import Bytewise, Insertion
from qlinkgen.plan.content import BadContent, MoreNeeded, measure
from qlinkgen.plan.ends import ByKind, ByLength, ByMark, ByMessage, BySilence, ByTerminator, ByTurn, Rescan
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
from qlinkgen.plan.text_ids import text_ids
from qlinkgen.plan.transparency import Coded, FrameStuffing, PayloadStuffing
from qlinkgen.plan.tree import MessagePlan


class BadFrame(ValueError):
    """Bytes that are not a valid frame.

    Attributes:
        kind: frame, stuffing, length, truncated, crc, illegal, unknown or range.
        end: wire offset at which the error was detected.
        field: the wrong field, "" for other errors.
    """

    def __init__(self, kind: str, end: int, field: str = "") -> None:
        """Compose the error text."""
        super().__init__(f"{kind} at {end}{field and f': {field}'}")
        self.kind = kind
        self.end = end
        self.field = field


class NoFrame(Exception):
    """No frame begins here.

    Attributes:
        kind: the error of a decoder of one whole frame; receivers do not report it.
        at: wire offset.
        empty: size of an empty frame, which has only its terminator; 0 for others.
    """

    def __init__(self, kind: str, at: int, *, empty: int = 0) -> None:
        """Set the attributes."""
        super().__init__(kind, at)
        self.kind = kind
        self.at = at
        self.empty = empty


class Incomplete(Exception):
    """The bytes may be the beginning of a frame.

    Attributes:
        size: the number of bytes needed to decide.
        ending: fewer bytes decide if this is the last of them, as an inserted byte may have to follow it.
    """

    def __init__(self, size: int = 0, ending: bytes = b"") -> None:
        """Set the attributes."""
        super().__init__(size, ending)
        self.size = size
        self.ending = ending

    def is_undecided(self, wire: bytes) -> bool:
        """Whether these bytes, one more than before, do not decide either."""
        return len(wire) < self.size and wire[-1:] != self.ending


@dataclass
class Taken:
    """A received frame, divided into parts.

    Attributes:
        cells: unstuffed bytes of each part; where only the payload is stuffed, the payload as sent.
        payload: the unstuffed payload.
        number: number of the message, None if the frame has none.
        address: the address, None if the frame has none.
        end: wire offset of its end.
        due: the inserted byte that may follow the end, b"" if none may.
        kept: number of its last bytes that may begin the next frame.
        frame: its plan, None where there is one kind of frame.
    """

    cells: dict[str, bytes] = field(default_factory=dict)
    payload: bytes = b""
    number: int | None = None
    address: int | None = None
    end: int = 0
    due: bytes = b""
    kept: int = 0
    frame: FramePlan | None = None


class Cursor:
    """A wire offset; reads bytes, skips inserted ones, and decodes coded ones."""

    def __init__(
        self,
        wire: bytes,
        at: int,
        rule: Insertion | None,
        *,
        hunting: bool = False,
        coding: Bytewise | None = None,
    ) -> None:
        """``rule`` or ``coding`` apply to the stuffed parts, None if the frame is not stuffed as a whole."""
        self._wire = wire
        self._rule = rule
        self._coding = coding
        self._hunting = hunting
        self._recent = b""
        self.at = at
        #: The next byte must be an inserted one.
        self.due = False
        #: Offsets of the bytes taken, and of the inserted ones between them.
        self.places: list[int] = []
        self.inserted: list[int] = []
        #: All offsets of each coded byte, and its value, by its first offset.
        self.coded: dict[int, tuple[range, int]] = {}

    def take(self, size: int, *, stuffed: bool) -> bytes:
        """Bytes of a part. Raises Incomplete, or BadFrame for a wrong inserted byte."""
        taken = b""
        if self._coding is not None and stuffed:
            return bytes(self._decoded(self._coding) for _ in range(size))
        rule = self._rule if stuffed else None
        while len(taken) < size:
            self._pass_inserted()
            run = self._run(size - len(taken), rule)
            taken += run
            if rule is not None:
                self._recent = (self._recent + run)[-len(rule.after) :]
                self.due = self._recent == rule.after
        if not stuffed:
            self._recent = b""
        return taken

    def _decoded(self, coding: Bytewise) -> int:
        """The next byte of a coded part."""
        first = self.at
        try:
            value = coding.take(self)
        except Incomplete:
            self.at = first
            raise
        self.places.append(first)
        self.coded[first] = range(first, self.at), value
        return value

    def byte(self) -> int:
        """The next byte on the wire."""
        return self._byte()

    def miscoded(self, byte: int) -> int:
        """Raise for a wrong byte of a coding."""
        at = self.at
        self.misplaced(again=False)
        self.at = at
        return byte

    def _run(self, most: int, rule: Insertion | None) -> bytes:
        """The bytes up to the next inserted one."""
        start, left = self.at, len(self._wire) - self.at
        if left == 0:
            raise Incomplete(start + most, rule.after[-1:] if rule is not None else b"")
        last = -1 if rule is None else self._wire.find(rule.after[-1:], start, start + most)
        size = min(most, left) if last < 0 else last + 1 - start
        self.at += size
        self.places += range(start, self.at)
        if size < most and rule is None:
            raise Incomplete(start + most)
        return self._wire[start : self.at]

    def _pass_inserted(self) -> None:
        if self.due and self._rule is not None:
            if self._byte() == self._rule.insert:
                self.inserted.append(self.at - 1)
            else:
                again = self._hunting and self._wire[self.at - 1] == self._rule.after[0]
                self.misplaced(again=again)
            self.due, self._recent = False, b""

    def misplaced(self, *, again: bool) -> None:
        """Raise for a wrong byte before ``at``; ``again``: it is the second byte of a preamble."""
        # A preamble inside a frame: the frame ends before it.
        raise BadFrame("truncated", self.at - 2) if again else BadFrame("stuffing", self.at)

    def _byte(self) -> int:
        if self.at == len(self._wire):
            raise Incomplete(self.at + 1)
        self.at += 1
        return self._wire[self.at - 1]


def stuffed_parts(plan: FramePlan) -> tuple[Part, ...]:
    """The parts that are stuffed or coded together, of a frame that is read from left to right."""
    way = plan.transparency
    return plan.envelope.between(way.front, way.back) if isinstance(way, FrameStuffing | Coded) else ()


class FrameReader:
    """Reads frames that end by length or by message."""

    def __init__(self, plan: FramePlan, known: Mapping[int, MessagePlan]) -> None:
        """``known`` are the messages of the direction of the frame, by number."""
        self._plan = plan
        self._known = known
        self._envelope = plan.envelope
        stuffing = plan.transparency
        self._whole = stuffing if isinstance(stuffing, FrameStuffing) else None
        self._alone = stuffing if isinstance(stuffing, PayloadStuffing) else None
        self._coding = None if plan.whole or not isinstance(stuffing, Coded) else stuffing.bytewise
        self._stuffed = {part.name for part in stuffed_parts(plan)}
        self._bare = isinstance(plan.receiver, Rescan) and plan.receiver.bare
        self._texts = text_ids(each.message for each in known.values())

    def read(self, wire: bytes, start: int = 0, *, hunting: bool = False) -> Taken:
        """The frame that begins at ``start``; contents, and check values over them, are not checked.

        Raises NoFrame, Incomplete or BadFrame.
        """
        rule = self._whole.rule if self._whole else None
        cursor = Cursor(wire, start, rule, hunting=hunting, coding=self._coding)
        taken = Taken()
        self._identify(taken)
        length = 0
        for part in self._envelope.front:
            if self._has(part, taken):
                length = self._head(cursor, part, taken) or length
        self._check_header(cursor, taken)
        sent = self._payload(cursor, taken, length)
        for part in self._envelope.back:
            if not isinstance(part, BlocksPart) and self._has(part, taken):
                taken.cells[part.name] = self._take(cursor, part, part.size)
        self._identify(taken)
        taken.end = cursor.at
        taken.due = bytes((rule.insert,)) if rule and cursor.due else b""
        taken.payload = self._judged(taken, sent)
        self._open(taken)
        return taken

    def _has(self, part: Part, taken: Taken) -> bool:
        """Whether the frame has a part; if not, its bytes are none."""
        if self._envelope.absent(part, taken.cells):
            taken.cells[part.name] = b""
            return False
        return True

    def _take(self, cursor: Cursor, part: Part, size: int) -> bytes:
        return cursor.take(size, stuffed=part.name in self._stuffed)

    def _head(self, cursor: Cursor, part: Part, taken: Taken) -> int:
        """Take a part of the header; returns the value of a length, 0 for other parts."""
        match part:
            case ConstantPart():
                self._begin(cursor, part, part.starts, taken)
                return 0
            case IdPart() | AddressPart() | CellPart() if part.numbers:
                self._begin(cursor, part, part.starts, taken)
                return self._numeric(cursor, part, taken)
            case LengthPart() | IdPart() | AddressPart() | CellPart() | EqualPart():
                taken.cells[part.name] = self._take(cursor, part, part.size)
                return self._numeric(cursor, part, taken)
            case CheckPart():
                taken.cells[part.name] = self._take(cursor, part, part.size)
                return 0
            case MarkPart() | PayloadPart() | BlocksPart():
                raise AssertionError(f"{part.name} is not a part of a header")
            case _:
                assert_never(part)

    def _begin(self, cursor: Cursor, part: Part, starts: Sequence[bytes], taken: Taken) -> None:
        """Take the bytes of a constant, or of one of several."""
        seen = b""
        while len(seen) < part.size:
            seen += self._take(cursor, part, 1)
            if not any(each.startswith(seen) for each in starts):
                raise NoFrame("frame", cursor.at - 1)
        taken.cells[part.name] = seen

    def _check_header(self, cursor: Cursor, taken: Taken) -> None:
        """Verify the check values of the header: a receiver does not wait for a payload of a wrong length."""
        for part in self._envelope.header_checks:
            value = part.check.of(b"".join(taken.cells[name] for name in part.check.over))
            if part.check.normal(taken.cells[part.name]) != part.check.pack(value):
                raise BadFrame("crc", cursor.at)

    def _numeric(self, cursor: Cursor, part: Numeric, taken: Taken) -> int:
        """Check a number of the header; returns the value of a length."""
        if isinstance(part, LengthPart):
            value = part.integer.unpack(taken.cells[part.name])
            if not part.holds(value):
                raise BadFrame("length", cursor.at)
            return value
        if is_wrong(part, taken.cells):
            raise NoFrame("frame", cursor.at)
        if self._envelope.identifies(part):
            self._identify(taken)
            if self._bare:
                self._check_known(cursor.at, taken)
        return 0

    def _identify(self, taken: Taken) -> None:
        number = gathered(self._envelope.id, taken.cells)
        taken.number = None if number is None else number + self._plan.base
        taken.address = gathered(self._envelope.address, taken.cells) if self._envelope.address else None

    def _open(self, taken: Taken) -> None:
        """Identify the message by its payload, if that begins with the id."""
        if self._texts is not None:
            taken.number = self._texts.number(taken.payload)

    def _check_known(self, at: int, taken: Taken) -> None:
        """Without a leading constant, only number and address distinguish a frame from noise."""
        if taken.number is None:
            return
        message = self._known.get(taken.number)
        if message is None:
            raise NoFrame("unknown", at)
        if taken.address is not None and message.allowed and not message.allowed.holds(taken.address):
            raise NoFrame("range", at)

    def _payload(self, cursor: Cursor, taken: Taken, length: int) -> bytes:
        part, end = self._envelope.payload, self._plan.end
        match end:
            case ByLength() if self._envelope.blocks:
                sent = self._blocks(cursor, self._envelope.blocks, taken, end.part.payload(length))
            case ByLength():
                sent = self._take(cursor, part, end.part.payload(length))
            case ByMessage():
                sent = self._measured(cursor, part, taken)
            case ByMark() | ByTerminator() | BySilence() | ByKind() | ByTurn():
                raise AssertionError("marks, a terminator, a silence, the kind or the turn are found first")
            case _:
                assert_never(end)
        taken.cells[part.name] = sent
        return sent

    def _blocks(self, cursor: Cursor, part: BlocksPart, taken: Taken, size: int) -> bytes:
        """Take a payload with the check values of its blocks; returns the payload."""
        sent = self._take(cursor, self._envelope.payload, size + part.added(size))
        starts = range(0, len(sent), part.every + part.check.size)
        pieces = [sent[at : at + part.every + part.check.size] for at in starts]
        taken.cells[part.name] = b"".join(piece[-part.check.size :] for piece in pieces)
        return b"".join(piece[: -part.check.size] for piece in pieces)

    def _measured(self, cursor: Cursor, part: PayloadPart, taken: Taken) -> bytes:
        message = self._known.get(taken.number if taken.number is not None else -1)
        if message is None:
            raise BadFrame("unknown", cursor.at)
        sent = b""
        while True:
            try:
                size = measure(message.payload, sent)
            except MoreNeeded as more:
                sent += self._take(cursor, part, more.needed - len(sent))
            except BadContent:
                raise BadFrame("length", cursor.at) from None
            else:
                return sent + self._take(cursor, part, size - len(sent))

    def _judged(self, taken: Taken, sent: bytes) -> bytes:
        """The unstuffed payload; checks the constants and derived numbers after it."""
        for part in self._envelope.back:
            if not self._envelope.absent(part, taken.cells) and is_wrong(part, taken.cells):
                raise BadFrame("frame", taken.end)
        if self._alone is None:
            return sent
        payload = self._alone.unstuff(sent)
        if payload is None:
            raise BadFrame("stuffing", taken.end)
        if len(payload) > self._envelope.payload.most:
            raise BadFrame("length", taken.end)
        return payload


class KindsReader:
    """Reads frames of several kinds, of which at most one begins at a place."""

    def __init__(self, kinds: Sequence[tuple[FramePlan, FrameReader]]) -> None:
        """``kinds`` are the kinds, each with its reader."""
        self._kinds = kinds

    def read(self, wire: bytes, start: int = 0, *, hunting: bool = False) -> Taken:
        """The frame that begins at ``start``; see `FrameReader.read`."""
        none = NoFrame("frame", start)
        for kind, reader in self._kinds:
            try:
                taken = reader.read(wire, start, hunting=hunting)
            except NoFrame as no_frame:
                none = max(none, no_frame.with_traceback(None), key=lambda each: each.at)
            else:
                taken.frame = kind
                return taken
        raise none


def is_wrong(part: Part, cells: Mapping[str, bytes]) -> bool:
    """Whether a received constant, a derived number, or one of the digits of a number is wrong."""
    match part:
        case AddressPart() if part.digits:
            return part.digits.number(cells[part.name]) is None
        case ConstantPart():
            return cells[part.name] != part.data
        case CellPart():
            number = part.integer.unpack(cells[part.name])
            return not all(slot.holds(number) for slot in part.constants)
        case EqualPart():
            right = part.value(part.of.integer.unpack(cells[part.of.name]))
            return part.integer.unpack(cells[part.name]) != right
        case (
            LengthPart() | IdPart() | AddressPart() | MarkPart() | PayloadPart() | CheckPart() | BlocksPart()
        ):
            return False
        case _:
            assert_never(part)


def read_marked(plan: FramePlan, known: Mapping[int, MessagePlan], wire: bytes) -> Taken:
    """The frame from a header to the next end, which must be all the data. Raises Incomplete or BadFrame."""
    assert isinstance(plan.end, ByMark)
    header, end = plan.end.header, plan.end.end
    marks = [at for at, byte in enumerate(wire) if byte & header.marker]
    if not marks or marks[0] != 0 or header.id_of(wire[0]) == end.end_id:
        raise BadFrame("frame", 0)
    if len(marks) == 1:
        raise Incomplete
    last = marks[1]
    if header.id_of(wire[last]) != end.end_id:
        raise BadFrame("frame", last)
    if last != len(wire) - 1:
        raise BadFrame("frame", last + 1)
    return take_marked(plan, known, wire)


def take_marked(plan: FramePlan, known: Mapping[int, MessagePlan], wire: bytes) -> Taken:
    """The parts of a frame with a header and an end. Raises BadFrame."""
    assert isinstance(plan.end, ByMark)
    header, end = plan.end.header, plan.end.end
    number, address = header.id_of(wire[0]), header.address_of(wire[0])
    message = known.get(number)
    if message is None or address == 0 or end.address_of(wire[-1]) != address:
        raise BadFrame("frame", len(wire))
    part = message.envelope.check
    size = len(wire) - 2 - (part.size if part else 0)
    plan_ = message.payload
    if not (plan_.least <= size <= plan_.most or (size == 0 and plan_.empty_is_default)):
        raise BadFrame("frame", len(wire))
    payload = wire[1 : 1 + size]
    cells = {header.name: wire[:1], message.envelope.payload.name: payload, end.name: wire[-1:]}
    if part:
        cells[part.name] = wire[1 + size : -1]
    return Taken(cells, payload, number, address, len(wire))
