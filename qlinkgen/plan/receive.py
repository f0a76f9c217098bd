"""Finds frames in a byte stream: a simple and slow reference for the receivers of every target.

Bytes are fed one at a time, so events cannot depend on how the stream is split. `docs/receiver.md` describes
the four strategies.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.model.message import Direction
from qlinkgen.plan.codec import Codec, Decoded, take_packet
from qlinkgen.plan.content import BadContent, MoreNeeded, measure
from qlinkgen.plan.ended import frame_reader
from qlinkgen.plan.ends import ByMark, ByTerminator, Gaps, Hunt, InStep, Marks, Rescan
from qlinkgen.plan.reading import BadFrame, FrameReader, Incomplete, NoFrame, Taken, take_marked
from qlinkgen.plan.tree import Plan


@dataclass(frozen=True, slots=True)
class Event:
    """A message or a fault.

    Attributes:
        kind: "message", or the kind of fault.
        at: offset of the byte that completed it; the length of the stream if its end did.
        offset: offset of its first byte in the stream.
        raw: its bytes as received.
        decoded: the message, None for a fault.
        inside: the fault is in a field, so the frame around it is right.
    """

    kind: str
    at: int
    offset: int
    raw: bytes
    decoded: Decoded | None = None
    inside: bool = False


class Receiver:
    """Base class of the strategies."""

    def __init__(self, plan: Plan, direction: Direction) -> None:
        """Receive messages of one direction."""
        self.plan = plan
        self.direction = direction
        self.codec = Codec(plan)
        self.frame = plan.frames[direction]
        self.known = plan.known(direction)
        #: Bytes taken so far.
        self.taken = 0
        #: The stream has ended; the next byte begins a new one.
        self.ended = False

    def run(self, stream: bytes) -> list[Event]:
        """The events of a whole stream, those of its end included."""
        return [event for byte in stream for event in self.feed(byte)] + list(self.finish())

    def feed(self, byte: int) -> Iterator[Event]:
        """Take one byte."""
        self.taken += 1
        self.ended = False
        yield from self.take(byte)

    def take(self, byte: int) -> Iterator[Event]:
        """Take one byte; its offset is ``taken`` - 1."""
        raise NotImplementedError

    def finish(self) -> Iterator[Event]:
        """End the stream and reset the receiver."""
        self.ended = True
        yield from self.give_up()

    def gap(self) -> Iterator[Event]:
        """The line was idle: an unfinished frame ends, and the next byte begins anew."""
        yield from self.finish()

    def give_up(self) -> Iterator[Event]:
        """The events of the bytes left at the end of the stream."""
        raise NotImplementedError

    @property
    def _at(self) -> int:
        return self.taken if self.ended else self.taken - 1

    def event(self, kind: str, raw: bytes, offset: int | None = None) -> Event:
        """A fault; by default it ends at the last byte taken."""
        start = self.taken - len(raw) if offset is None else offset
        return Event(kind, self._at, start, bytes(raw))

    def judged(self, taken: Taken, raw: bytes, offset: int, request: bytes = b"") -> Event:
        """The message of a frame, or its fault."""
        try:
            decoded = self.codec.judge(taken, self.direction, request)
        except BadFrame as bad:
            return Event(bad.kind, self._at, offset, raw, inside=bool(bad.field))
        return Event("message", self._at, offset, raw, decoded)


def receiver(plan: Plan, direction: Direction) -> Receiver:
    """The receiver of a protocol's frames."""
    strategy = plan.frame.receiver
    match strategy:
        case Hunt():
            return HuntingReceiver(plan, direction)
        case Rescan():
            return RescanningReceiver(plan, direction)
        case Marks():
            return MarkReceiver(plan, direction)
        case InStep():
            return PacketReceiver(plan, direction)
        case Gaps():
            return GapReceiver(plan, direction)
        case _:
            assert_never(strategy)


class HuntingReceiver(Receiver):
    """The preamble occurs nowhere else: every byte is processed once."""

    def __init__(self, plan: Plan, direction: Direction) -> None:
        """Hunt for a preamble."""
        super().__init__(plan, direction)
        assert isinstance(self.frame.receiver, Hunt)
        self._mark = self.frame.receiver.mark
        self._reader = FrameReader(self.frame, self.known)
        self._marks = 0
        self._raw = b""
        #: Why the frame is not complete.
        self._incomplete = Incomplete()

    def take(self, byte: int) -> Iterator[Event]:
        """Search for a preamble, or collect a frame."""
        if not self._raw:
            yield from self._hunt(byte)
            return
        self._raw += bytes((byte,))
        yield from self._inside()

    def _hunt(self, byte: int) -> Iterator[Event]:
        if byte == self._mark:
            self._marks += 1
            return
        marks, self._marks = self._marks, 0
        if marks >= 2:
            self._raw, self._incomplete = bytes((self._mark, self._mark, byte)), Incomplete()
            yield from self._inside()

    def _inside(self) -> Iterator[Event]:
        if self._incomplete.is_undecided(self._raw):
            return
        try:
            taken = self._reader.read(self._raw, hunting=True)
        except Incomplete as incomplete:
            self._incomplete = incomplete.with_traceback(None)
            return
        except BadFrame as bad:
            aborted = bad.kind == "truncated"
            raw, self._raw, self._marks = self._raw[: bad.end], b"", 2 if aborted else 0
            yield self.event(bad.kind, raw, self.taken - len(raw) - (2 if aborted else 0))
            return
        raw, self._raw = self._raw, b""
        self._marks = int(raw[-1] == self._mark)
        yield self.judged(taken, raw, self.taken - len(raw))

    def give_up(self) -> Iterator[Event]:
        """An unfinished frame is truncated."""
        raw = self._raw or (bytes((self._mark, self._mark)) if self._marks >= 2 else b"")
        if raw:
            yield self.event("truncated", raw)
        self._raw, self._marks = b"", 0


class RescanningReceiver(Receiver):
    """Buffers bytes until a frame is valid; otherwise the search continues at the next byte."""

    def __init__(self, plan: Plan, direction: Direction) -> None:
        """Begin with an empty buffer."""
        super().__init__(plan, direction)
        assert isinstance(self.frame.receiver, Rescan)
        self._strategy = self.frame.receiver
        self._reader = frame_reader(self.frame, self.known)
        starts = [each.envelope.starts for each in self.frame.every]
        #: The bytes with which a frame may begin, b"" if any may.
        self._first = b"".join(each[:1] for kind in starts for each in kind)
        self._longest = self.frame.longest
        self._buffer, self._skipped, self._due = b"", b"", b""
        end = self.frame.end
        #: The terminator if only it may precede a frame.
        self._line_end = end.part.data if isinstance(end, ByTerminator) and self.frame.lines else b""
        #: No frame begins before the next one.
        self._lost = False
        #: Why the frame that may begin the buffer is not complete.
        self._incomplete = Incomplete()

    def take(self, byte: int) -> Iterator[Event]:
        """Buffer the byte and search for frames."""
        self._buffer += bytes((byte,))
        if not self._incomplete.is_undecided(self._buffer):
            yield from self._scan()

    def _scan(self) -> Iterator[Event]:
        while self._buffer:
            self._incomplete = Incomplete()
            due, self._due = self._due, b""
            if due and self._buffer[:1] == due:
                self._buffer = self._buffer[1:]
                continue
            if self._first and self._buffer[0] not in self._first:
                # As for NoFrame below, but for several bytes at once: most bytes do not begin a frame.
                at = next((at for at, byte in enumerate(self._buffer) if byte in self._first), 0)
                self._buffer = self._buffer[at:] if at > 0 else b""
                continue
            try:
                taken = self._read()
            except Incomplete as incomplete:
                if not self.ended:
                    self._incomplete = incomplete.with_traceback(None)
                    return
                yield from self._drop("", b"")
            except NoFrame as no_frame:
                if no_frame.empty and self._strategy.bare:
                    # The terminator of the bytes skipped so far.
                    yield from self._report(self._start)
                    self._buffer, self._lost = self._buffer[no_frame.empty :], False
                else:
                    yield from self._drop("", b"")
            except BadFrame as bad:
                yield from self._drop(bad.kind, self._buffer[: bad.end])
            else:
                yield from self._whole(taken)

    def _read(self) -> Taken:
        """The frame at the beginning of the buffer."""
        if self._lost and not self._buffer.startswith(self._line_end):
            if self._line_end.startswith(self._buffer):
                raise Incomplete(len(self._buffer) + 1)
            raise NoFrame("frame", 0)
        return self._reader.read(self._buffer)

    @property
    def _start(self) -> int:
        return self.taken - len(self._buffer)

    def _whole(self, taken: Taken) -> Iterator[Event]:
        raw = self._buffer[: taken.end]
        event = self.judged(taken, raw, self._start)
        strategy = taken.frame.receiver if taken.frame else self._strategy
        assert isinstance(strategy, Rescan)
        proven = strategy.proves(event.kind, inside=event.inside)
        if event.kind != "message" and not proven:
            yield from self._drop(event.kind, raw)
            return
        yield from self._report(self._start)
        yield event
        self._buffer = self._buffer[taken.end - taken.kept :]
        self._due = taken.due

    def _drop(self, kind: str, raw: bytes) -> Iterator[Event]:
        """Drop the first byte, which does not begin a frame."""
        if kind and not self._strategy.bare:
            yield self.event(kind, raw, self._start)
        if self._strategy.bare:
            self._skipped += self._buffer[:1]
            if len(self._skipped) == self._longest:
                yield from self._report(self._start + 1)
        self._buffer, self._lost = self._buffer[1:], bool(self._line_end)

    def _report(self, end: int) -> Iterator[Event]:
        """Report consecutive skipped bytes as one fault."""
        if self._skipped:
            yield self.event("frame", self._skipped, end - len(self._skipped))
        self._skipped = b""

    def give_up(self) -> Iterator[Event]:
        """Give up the incomplete frame and search its bytes for others."""
        if self._buffer not in (b"", self.frame.flag) and not self._strategy.bare:
            yield self.event("truncated", self._buffer, self._start)
            self._buffer = self._buffer[1:]
        yield from self._scan()
        yield from self._report(self.taken)
        self._buffer, self._due, self._incomplete, self._lost = b"", b"", Incomplete(), False


class GapReceiver(Receiver):
    """What lies between two silences is a frame, or one fault."""

    def __init__(self, plan: Plan, direction: Direction) -> None:
        """Begin after a silence."""
        super().__init__(plan, direction)
        self._reader = frame_reader(self.frame, self.known)
        self._raw = b""
        #: The bytes up to the next silence belong to a fault already reported.
        self._lost = False

    def take(self, byte: int) -> Iterator[Event]:
        """Collect the byte; no frame is longer than the longest."""
        if self._lost:
            return
        self._raw += bytes((byte,))
        if len(self._raw) > self.frame.max_wire:
            raw, self._raw, self._lost = self._raw, b"", True
            yield self.event("length", raw)

    def give_up(self) -> Iterator[Event]:
        """The silence ends a frame."""
        raw, self._raw, self._lost = self._raw, b"", False
        if not raw:
            return
        try:
            taken = self._reader.read(raw)
        except BadFrame as bad:
            yield self.event(bad.kind, raw)
        else:
            yield self.judged(taken, raw, self.taken - len(raw))


class MarkReceiver(Receiver):
    """Header and end have a marker bit that the bytes between them lack."""

    def __init__(self, plan: Plan, direction: Direction) -> None:
        """Wait for a header."""
        super().__init__(plan, direction)
        assert isinstance(self.frame.end, ByMark)
        self._header, self._end_id = self.frame.end.header, self.frame.end.end.end_id
        envelope = self.frame.envelope
        self._most = envelope.payload.most + (envelope.check.size if envelope.check else 0)
        self._raw = b""
        #: Bytes up to the next header belong to a fault already reported.
        self._hunting = False

    def take(self, byte: int) -> Iterator[Event]:
        """Wait for a header, or collect a frame."""
        marked = bool(byte & self._header.marker)
        if marked and self._header.id_of(byte) != self._end_id:
            if self._raw:
                yield self.event("frame", self._raw, self.taken - 1 - len(self._raw))
            self._raw, self._hunting = bytes((byte,)), False
        elif self._raw:
            self._raw += bytes((byte,))
            if marked:
                yield self._complete()
            elif len(self._raw) - 1 > self._most:
                yield self.event("frame", self._raw)
                self._raw, self._hunting = b"", True
        elif not self._hunting:
            self._hunting = True
            yield self.event("frame", bytes((byte,)))

    def _complete(self) -> Event:
        raw, self._raw = self._raw, b""
        try:
            taken = take_marked(self.frame, self.known, raw)
        except BadFrame as bad:
            return self.event(bad.kind, raw)
        return self.judged(taken, raw, self.taken - len(raw))

    def give_up(self) -> Iterator[Event]:
        """An unfinished message is truncated."""
        if self._raw:
            yield self.event("truncated", self._raw)
        self._raw, self._hunting = b"", False


class PacketReceiver(Receiver):
    """No delimiters: the first byte gives the size of a request, the request that of a response."""

    def __init__(self, plan: Plan, direction: Direction) -> None:
        """Begin between packets."""
        super().__init__(plan, direction)
        self._raw = b""
        self._requests: list[bytes] = []

    def expect(self, request: bytes) -> None:
        """Expect the response to this request, after those already expected."""
        if request[0] in self.known:
            self._requests.append(request)

    def take(self, byte: int) -> Iterator[Event]:
        """Collect a packet."""
        self._raw += bytes((byte,))
        answers = self.direction == "response"
        if answers and not self._requests:
            raw, self._raw = self._raw, b""
            yield self.event("frame", raw)
            return
        message = self.known.get(self._requests[0][0] if answers else self._raw[0])
        if message is None:
            raw, self._raw = self._raw, b""
            yield self.event("unknown", raw)
            return
        start = self._raw if answers else self._raw[1:]
        try:
            size = measure(message.payload, start) + message.envelope.overhead
        except MoreNeeded:
            return
        except BadContent:
            size = 0
        if len(self._raw) >= size:
            raw, self._raw = self._raw, b""
            request = self._requests.pop(0) if answers else b""
            yield self.judged(take_packet(message, raw), raw, self.taken - len(raw), request)

    def give_up(self) -> Iterator[Event]:
        """An unfinished packet is truncated."""
        if self._raw:
            yield self.event("truncated", self._raw)
        self._raw = b""
        self._requests.clear()
