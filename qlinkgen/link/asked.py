"""Answers that only their request tells apart: a master and a monitor know the request."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from qlinkgen.link.codec import Codec, Decoder, DecoderCounters, Fault, Framed, is_message

#: The answer to a request in a received message, of `answer_to` of a generated module.
AnswerTo = Callable[[Framed, Framed], Framed]


class NotAnAnswer(NamedTuple):
    """A fault: a frame that is not an answer to the request that was sent."""

    kind: str
    offset: int
    raw: bytes
    message: str


def answer_to(codec: Codec) -> AnswerTo | None:
    """The function of a codec, None if its answers are all told by their numbers."""
    found: AnswerTo | None = getattr(codec, "answer_to", None)
    return found


class AskedDecoder:
    """The receiver of a master whose answers only their request tells apart."""

    def __init__(
        self, codec: Codec, decoder: Decoder, answers: AnswerTo, asked: Callable[[Framed], Iterable[Framed]]
    ) -> None:
        """``asked`` returns the requests that a message may answer."""
        self._decoder = decoder
        self._answers = answers
        self._asked = asked
        self._error = codec.DecodeError
        self._fed = 0

    @property
    def counters(self) -> DecoderCounters:
        """Counts so far."""
        return self._decoder.counters

    def feed(self, data: bytes, /) -> Sequence[Framed | Fault]:
        """Take the next bytes of the stream; return the events that they complete."""
        self._fed += len(data)
        return [self._told(event) for event in self._decoder.feed(data)]

    def finish(self) -> Sequence[Framed | Fault]:
        """End the stream; return the remaining events."""
        return [self._told(event) for event in self._decoder.finish()]

    def _told(self, event: Framed | Fault) -> Framed | Fault:
        if not is_message(event):
            return event
        fault: NotAnAnswer | None = None
        for request in self._asked(event):
            try:
                return self._answers(request, event)
            except self._error as error:
                raw = event.to_frame()
                kind, at = getattr(error, "kind", ""), self._fed - len(raw)
                fault = fault or NotAnAnswer(kind, at, raw, str(error))
        return fault or event
