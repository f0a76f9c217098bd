"""The attempts of a transaction: how many, since when, and what was received instead of an answer."""

from __future__ import annotations

from qlinkgen.link.transaction import Reply


class Attempts:
    """The attempts of the current transaction of an engine, which uses the same object for all of them.

    Attributes:
        number: transmissions so far.
        tries: largest number of transmissions.
        started: time of the call.
        sent_at: time of the last transmission.
        patient_until: deadline set by the first pending reply to the last transmission, 0 without one.
        wrong: kind and bytes of each reply that was not the answer.
    """

    __slots__ = ("number", "patient_until", "sent_at", "started", "tries", "wrong")

    def __init__(self) -> None:
        self.number = 0
        self.tries = 0
        self.started = 0.0
        self.sent_at = 0.0
        self.patient_until = 0.0
        self.wrong: list[tuple[str, bytes]] = []

    def begin(self, tries: int, now: float) -> None:
        """Begin a transaction of at most so many transmissions."""
        self.number = 0
        self.tries = tries
        self.started = now
        if self.wrong:
            self.wrong = []

    @property
    def left(self) -> bool:
        """Whether the request may be sent once more."""
        return self.number < self.tries

    def wrong_kinds(self) -> list[str]:
        """Return the kinds of wrong replies, sorted."""
        return sorted({kind for kind, _ in self.wrong})

    def wrong_bytes(self) -> bytes:
        """Return the bytes of all wrong replies."""
        return b"".join(raw for _, raw in self.wrong)

    def reply(self, response: object, now: float) -> Reply:
        """Return the outcome of a successful transaction."""
        return Reply(response, self.number, now - self.started, now, now - self.sent_at)
