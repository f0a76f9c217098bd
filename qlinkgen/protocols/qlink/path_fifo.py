"""The FIFO of path words of a virtual node, and the motor that consumes them (sections 7.10 to 7.13).

A motor takes one word every 1/rate seconds and moves by it. Nothing happens by itself: `advance(now)` works
out which words are done by then, so that a minute of path costs no more than the words in it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable

from qlinkgen.protocols.qlink.arguments import positive, whole

#: A word within a millionth of its end is done, so that times like 0.1 that binary cannot hold lose none.
_NEARLY = 1e-6


def signed_word(word: int) -> int:
    """Return the displacement of a path word: two's complement of 16 bits, in encoder counts."""
    return word - 0x10000 if word & 0x8000 else word


def wrapped(position: int) -> int:
    """Return a position as the 32 bits of the wire show it, in two's complement."""
    return (position + 0x8000_0000) % 0x1_0000_0000 - 0x8000_0000


class PathFifo:
    """Path words that wait, and the position that the finished ones led to.

    Always `queued == drained + dropped + waiting`.

    Attributes:
        capacity: words that fit, 0..255.
        position: where the motor is, a 32-bit number.
        started: the motor consumes words; a stopped one holds them.
        queued: words ever taken in.
        drained: words ever done.
        dropped: words that `clear` threw away.
    """

    def __init__(
        self,
        capacity: int,
        rate: float,
        displacement: Callable[[int], int] = signed_word,
        *,
        started: bool = False,
    ) -> None:
        """Make an empty FIFO.

        Args:
            capacity: words that fit, 0..255 (a byte tells the free ones).
            rate: words a second that the motor takes, 0 for one that never moves.
            displacement: gives how far a word moves, in encoder counts.
            started: whether the motor consumes words from the beginning.

        Raises:
            ValueError: capacity or rate are out of range.
        """
        self.capacity = whole("capacity", capacity, 0, 255)
        self.started = started
        self.position = 0
        self.queued = self.drained = self.dropped = 0
        self._rate = positive("rate", rate, "words a second")
        self._displacement = displacement
        self._words: deque[int] = deque()
        # Since when words are consumed without a break, and how many were: no error of rounding adds up.
        self._since: float | None = None
        self._done = 0

    @property
    def waiting(self) -> int:
        """Words in the FIFO; the one that the motor is at counts until it is done."""
        return len(self._words)

    @property
    def space(self) -> int:
        """Words that still fit."""
        return self.capacity - len(self._words)

    @property
    def running(self) -> bool:
        """Whether the motor is moving along the path."""
        return self.started and bool(self._words)

    @property
    def rate(self) -> float:
        """Words a second that the motor takes."""
        return self._rate

    def push(self, words: Iterable[int], now: float) -> bool:
        """Queue words, all or none. Returns whether they fitted."""
        self.advance(now)
        fresh = tuple(words)
        if len(fresh) > self.space:
            return False
        self._words.extend(fresh)
        self.queued += len(fresh)
        if self._since is None:
            self._begin(now)
        return True

    def advance(self, now: float) -> None:
        """Move along the words that are done by now."""
        if self._since is None:
            return
        reached = min((now - self._since) * self._rate + _NEARLY, self._done + len(self._words))
        for _ in range(int(reached) - self._done):
            self.position = wrapped(self.position + self._displacement(self._words.popleft()))
            self.drained += 1
            self._done += 1
        if not self._words:
            self._since = None

    def start(self, now: float) -> None:
        """Let the motor consume; a start of a started one changes nothing."""
        if not self.started:
            self.started = True
            self._begin(now)

    def stop(self) -> None:
        """Hold the words. The one that the motor is at begins again at the next start."""
        self.started = False
        self._since = None

    def set_rate(self, rate: float, now: float) -> None:
        """Change how many words a second the motor takes; the one that it is at begins again.

        Raises:
            ValueError: it is not a finite number from 0 up.
        """
        self.advance(now)
        self._rate = positive("rate", rate, "words a second")
        self._begin(now)

    def clear(self) -> None:
        """Throw away what waits; the position stays where the motor is."""
        self.dropped += len(self._words)
        self._words.clear()
        self._since = None

    def _begin(self, now: float) -> None:
        self._since = now if self.running else None
        self._done = 0
