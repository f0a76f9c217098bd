"""The FIFO of path words of a virtual node, and the motor that consumes them (sections 7.10 to 7.13).

A motor consumes one word every 1/rate seconds and moves by it. `advance(now)` computes the words consumed by
then, so the cost depends only on the number of words.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable

from qlinkgen.protocols.qlink.arguments import positive, whole
from qlinkgen.protocols.qlink.facts import MOST_SPACE

#: Tolerance for the end of a word, relative to its duration, for times like 0.1 that are not exact in binary.
_NEARLY = 1e-6


def signed_word(word: int) -> int:
    """Return the displacement of a path word: two's complement of 16 bits, in encoder counts."""
    return word - 0x10000 if word & 0x8000 else word


def wrapped(position: int) -> int:
    """Return a position as a 32-bit two's complement number, as on the wire."""
    return (position + 0x8000_0000) % 0x1_0000_0000 - 0x8000_0000


class PathFifo:
    """Queued path words, and the position after the consumed ones.

    Always `queued == drained + dropped + waiting`.

    Attributes:
        capacity: words that fit, 0..255.
        position: position of the motor, a 32-bit number.
        started: the motor consumes words; if stopped, it holds them.
        queued: number of words ever queued.
        drained: number of words ever consumed.
        dropped: number of words discarded by `clear`.
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
            capacity: words that fit, at most the number that a motion's answer can report.
            rate: words per second that the motor consumes, 0 for one that never moves.
            displacement: returns the displacement of a word, in encoder counts.
            started: whether the motor consumes words from the beginning.

        Raises:
            ValueError: capacity or rate is out of range.
        """
        self.capacity = whole("capacity", capacity, 0, MOST_SPACE)
        self.started = started
        self.position = 0
        self.queued = self.drained = self.dropped = 0
        self._rate = positive("rate", rate, "words per second")
        self._displacement = displacement
        self._words: deque[int] = deque()
        # Start of uninterrupted consumption, and words since: rounding errors do not accumulate.
        self._since: float | None = None
        self._done = 0

    @property
    def waiting(self) -> int:
        """Number of words in the FIFO, including the current word of the motor."""
        return len(self._words)

    @property
    def space(self) -> int:
        """Number of words that still fit."""
        return self.capacity - len(self._words)

    @property
    def running(self) -> bool:
        """Whether the motor is moving along the path."""
        return self.started and bool(self._words)

    @property
    def rate(self) -> float:
        """Words per second that the motor consumes."""
        return self._rate

    def push(self, words: Iterable[int], now: float) -> bool:
        """Queue words, all or none. Return whether they fitted."""
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
        """Consume the words that are due by `now`."""
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
        """Start consumption; no effect if already started."""
        if not self.started:
            self.started = True
            self._begin(now)

    def stop(self) -> None:
        """Hold the words. The current word starts over at the next start."""
        self.started = False
        self._since = None

    def set_rate(self, rate: float, now: float) -> None:
        """Change the rate of the motor; the current word starts over.

        Raises:
            ValueError: the rate is negative or not finite.
        """
        self.advance(now)
        self._rate = positive("rate", rate, "words per second")
        self._begin(now)

    def clear(self) -> None:
        """Discard the queued words; the position does not change."""
        self.dropped += len(self._words)
        self._words.clear()
        self._since = None

    def _begin(self, now: float) -> None:
        self._since = now if self.running else None
        self._done = 0
