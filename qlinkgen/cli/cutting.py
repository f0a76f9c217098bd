"""Cuts the bytes of a line into frames, and the bytes between them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from qlinkgen.link.codec import Fault, Framed, is_message

#: Most bytes that are held for a frame; a frame of more is in several pieces.
MOST = 1 << 16


class Piece(NamedTuple):
    """A frame, or bytes that are none."""

    #: When its first byte was received, in seconds.
    at: float
    data: bytes
    #: The message, or the fault; None for other bytes.
    event: Framed | Fault | None


class Cutter:
    """Holds the bytes of one direction until a decoder tells what they are."""

    def __init__(self) -> None:
        self._held = b""
        #: Where the bytes of each read begin, and its time.
        self._reads: list[tuple[int, float]] = []

    def take(self, at: float, data: bytes) -> None:
        """Hold bytes that were received at this time."""
        if data:
            self._reads.append((len(self._held), at))
            self._held += data

    def cut(self, events: Iterable[tuple[Framed | Fault, bytes]]) -> Iterator[Piece]:
        """Return pieces up to the last of the frames and faults that a decoder has found, with their bytes.

        No byte is left out, and none is in two pieces: a fault ends where the next frame begins. Bytes that
        a decoder has read in another spelling than its own are not found, and are in a piece without event.
        """
        places: list[tuple[int, int, Framed | Fault]] = []
        begin = 0
        for event, data in events:
            if data and (found := self._held.find(data, begin)) >= 0:
                places.append((found, found + len(data), event))
                begin = found + (len(data) if is_message(event) else 1)
        done = 0
        for number, (start, end, event) in enumerate(places):
            yield from self._between(done, start)
            done = min([end, *(begin for begin, _, _ in places[number + 1 :][:1])])
            yield self._piece(start, done, event)
        if done or len(self._held) > MOST:
            if not done:
                yield from self._between(0, done := len(self._held))
            self._drop(done)

    def rest(self) -> Iterator[Piece]:
        """Return the bytes that are held: no more follow."""
        yield from self._between(0, len(self._held))
        self._drop(len(self._held))

    def _between(self, start: int, end: int) -> Iterator[Piece]:
        if start < end:
            yield self._piece(start, end, None)

    def _piece(self, start: int, end: int, event: Framed | Fault | None) -> Piece:
        at = next(at for begin, at in reversed(self._reads) if begin <= start)
        return Piece(at, self._held[start:end], event)

    def _drop(self, size: int) -> None:
        self._held = self._held[size:]
        last = max((each for each in self._reads if each[0] <= size), default=None)
        later = [(begin - size, at) for begin, at in self._reads if begin > size]
        self._reads = [(0, last[1]), *later] if last and self._held else []
