"""Requests with a number that a slave does not know."""

from __future__ import annotations

from collections.abc import Callable

from qlinkgen.link.codec import Codec, Framed
from qlinkgen.link.gaps import silence_of

#: The answer to the bytes of a request to a node, of `answer_unknown` of a generated module.
AnswerUnknown = Callable[[bytes, int | None], Framed | None]
#: A request comes in so many pieces at most.
_PIECES = 4


class UnknownRequests:
    """Finds the requests with an unknown number to one node, and the answers to them.

    A fault of the decoder has the bytes of such a request, if the frame tells its end. If a silence does, the
    bytes since the last request are kept, and are one if they are whole when the line has been idle.
    """

    def __init__(self, codec: Codec, answer: AnswerUnknown, byte_time: float) -> None:
        """``answer`` is that of the codec."""
        self._answer = answer
        silence: tuple[float, float] | None = getattr(codec, "IDLE", None)
        if silence_of(codec, byte_time):  # then a fault has the bytes of the whole request
            silence = None
        self._silence = max(silence[0] * byte_time, silence[1]) if silence else None
        self._pieces: list[bytes] = []
        #: When the line has been idle, None if nothing was received since.
        self.due: float | None = None

    def received(self, data: bytes, now: float) -> None:
        """Keep bytes."""
        if self._silence is not None:
            self._pieces = [*self._pieces[1 - _PIECES :], data]
            self.due = now + self._silence

    def known(self) -> None:
        """Forget the bytes: they were a request."""
        self._pieces, self.due = [], None

    def answer(self, raw: bytes, node: int | None) -> Framed | None:
        """The answer to the bytes of a fault, None if they are not an unknown request to the node."""
        return self._answer(raw, node)

    def silent(self, node: int | None) -> Framed | None:
        """The line has been idle: the answer to the bytes before, None without."""
        self.due = None
        for first in range(len(self._pieces)):
            found = self._answer(b"".join(self._pieces[first:]), node)
            if found is not None:
                self._pieces = []
                return found
        return None


def unknown_requests(codec: Codec, byte_time: float) -> UnknownRequests | None:
    """Those of a protocol, None if a slave does not answer them."""
    found: AnswerUnknown | None = getattr(codec, "answer_unknown", None)
    return None if found is None else UnknownRequests(codec, found, byte_time)
