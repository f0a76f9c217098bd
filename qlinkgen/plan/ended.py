"""Reads frames that a terminator or a silence ends: decodes all bytes, then takes parts from both ends."""

from __future__ import annotations

from collections.abc import Mapping

from qlinkgen._dataclass import dataclass
from qlinkgen.plan.ends import ByTerminator
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.parts import LengthPart, PayloadPart
from qlinkgen.plan.reading import BadFrame, FrameReader, Incomplete, KindsReader, NoFrame, Taken, is_wrong
from qlinkgen.plan.transparency import Coded
from qlinkgen.plan.tree import MessagePlan


@dataclass(frozen=True, slots=True)
class Whole:
    """A decoded frame.

    Attributes:
        plain: its bytes, as far as they are right.
        places: the wire offset of each; that of the last one of several bytes that represent it.
        end: wire offset of its end.
        wrong: wire offset of the first wrongly coded byte, None if there is none.
    """

    plain: bytes
    places: tuple[int, ...]
    end: int
    wrong: int | None


def find_end(frame: FramePlan, wire: bytes, start: int = 0) -> int:
    """The wire offset of the terminator of the frame at ``start``.

    Raises NoFrame, also if nothing precedes the terminator; Incomplete; or BadFrame if no frame is so long.
    """
    assert isinstance(frame.end, ByTerminator)
    lead, last = frame.envelope.preamble, frame.end.part.data
    head = wire[start : start + len(lead)]
    if not lead.startswith(head):
        raise NoFrame("frame", start + next(at for at in range(len(head)) if head[at] != lead[at]))
    if len(head) < len(lead):
        raise Incomplete(start + len(head) + 1)
    first, limit = start + len(lead), start + frame.max_wire - frame.end.after
    stop = frame.end.find(wire, first, limit)
    if stop == first:
        raise NoFrame("length", first, empty=first + len(last) - start)
    if stop < 0 and len(wire) >= limit:
        raise BadFrame("length", limit)
    if stop < 0:
        raise Incomplete(limit, last[-1:])
    return stop


def read_whole(frame: FramePlan, wire: bytes, start: int = 0) -> Whole:
    """The frame at ``start``, decoded. Raises as `find_end`."""
    assert isinstance(frame.transparency, Coded)
    if frame.silent:
        return decoded(frame, wire, start, _silent_end(frame, wire, start))
    assert isinstance(frame.end, ByTerminator)
    stop = find_end(frame, wire, start)
    rest = frame.end.part.size + frame.end.after
    end = stop + rest
    if len(wire) < end:
        raise Incomplete(end)
    return decoded(frame, wire, start, end)


def _silent_end(frame: FramePlan, wire: bytes, start: int) -> int:
    """The wire offset of the end of the bytes between two silences. Raises BadFrame."""
    lead = frame.envelope.preamble
    head = wire[start : start + len(lead)]
    if head != lead:
        seen = next((at for at in range(len(head)) if head[at] != lead[at]), len(head))
        raise BadFrame("frame" if seen < len(head) else "length", start + seen)
    if len(wire) - start > frame.max_wire:
        raise BadFrame("length", start + frame.max_wire)
    return len(wire)


def decoded(frame: FramePlan, wire: bytes, start: int, end: int) -> Whole:
    """The frame between two offsets, decoded."""
    coded = frame.transparency
    assert isinstance(coded, Coded)
    first, last = start + coded.front, end - coded.back
    if last <= first:
        return Whole(wire[start:end], tuple(range(start, end)), end, None)
    inner = coded.read(wire[first:last])
    before, after = tuple(range(start, first)), tuple(range(last, end))
    places = (*before, *(first + at for at in inner.places), *after)
    plain = wire[start:first] + inner.plain + wire[last:end]
    return Whole(plain, places, end, None if inner.wrong is None else first + inner.wrong)


def cells_of(envelope: Envelope, plain: bytes) -> Mapping[str, bytes] | None:
    """The bytes of each part of a decoded frame, None if it is too short."""
    size = len(plain) - envelope.overhead
    if size < 0:
        return None
    cells, at = {}, 0
    for part in envelope.parts:
        end = at + (size if isinstance(part, PayloadPart) else part.size)
        cells[part.name], at = plain[at:end], end
    return cells


class EndedReader(FrameReader):
    """Reads frames that a terminator or a silence ends."""

    def read(self, wire: bytes, start: int = 0, *, hunting: bool = False) -> Taken:
        """The frame that begins at ``start``; see `FrameReader.read`."""
        del hunting
        envelope = self._envelope
        whole = read_whole(self._plan, wire, start)
        if whole.wrong is not None:
            raise BadFrame("stuffing", whole.end)
        cells, part = cells_of(envelope, whole.plain), envelope.payload
        if cells is None or not part.least <= len(cells[part.name]) <= part.most:
            raise BadFrame("length", whole.end)
        taken = Taken(dict(cells), cells[part.name], end=whole.end)
        taken.kept = self._plan.kept
        self._judge(taken)
        self._open(taken)
        return taken

    def _judge(self, taken: Taken) -> None:
        """Check constants, length, and what distinguishes a frame without a leading constant from noise."""
        cells, taken.cells = taken.cells, {}
        for part in self._envelope.parts:
            taken.cells[part.name] = cells[part.name]
            if is_wrong(part, taken.cells):
                raise BadFrame("frame", taken.end)
            if isinstance(part, LengthPart):
                number = part.integer.unpack(cells[part.name])
                if part.payload(number) != len(taken.payload):
                    raise BadFrame("length", taken.end)
            self._identify(taken)
            if self._bare and part in self._envelope.front and self._envelope.identifies(part):
                self._check_known(taken.end, taken)


def frame_reader(plan: FramePlan, known: Mapping[int, MessagePlan]) -> FrameReader | KindsReader:
    """The reader of frames of parts; ``known`` are the messages of their direction, by number."""
    if plan.kinds:
        return KindsReader([(each, _reader(each, known)) for each in plan.sought])
    return _reader(plan, known)


def _reader(plan: FramePlan, known: Mapping[int, MessagePlan]) -> FrameReader:
    """The reader of frames of one kind."""
    kind = EndedReader if plan.whole else FrameReader
    return kind(plan, known)
