"""How the bytes of a frame travel: inserted bytes, and what that costs.

Each class is one kind of transparency with its encoding, its decoding and its growth; nothing else in the
compiler knows how stuffing works.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Plain:
    """Bytes travel as they are."""

    def most_sent(self, payload: int) -> int:
        """Most bytes that a payload of so many bytes takes on the wire, as far as a length counts them."""
        return payload


@dataclass(frozen=True, slots=True)
class SevenBit:
    """No byte of the payload has the marker bit, so header and end can be told from it."""

    marker: int

    def most_sent(self, payload: int) -> int:
        """Most bytes that a payload of so many bytes takes on the wire, as far as a length counts them."""
        return payload


@dataclass(frozen=True, slots=True)
class Insertion:
    """After each occurrence of ``after`` an ``insert`` byte is added; occurrences do not overlap."""

    after: bytes
    insert: int

    @property
    def inserted(self) -> bytes:
        """``after`` with the byte that follows it."""
        return self.after + bytes((self.insert,))

    def stuff(self, data: bytes) -> bytes:
        """The bytes as they are sent."""
        return data.replace(self.after, self.inserted)

    def places(self, sent: bytes) -> Iterator[int]:
        """Places at which an inserted byte is due; the last may lie past the end."""
        at = sent.find(self.after)
        while at >= 0:
            at += len(self.after)
            yield at
            at = sent.find(self.after, at + (sent[at : at + 1] == bytes((self.insert,))))

    def growth(self, size: int) -> int:
        """Most bytes that are added to so many."""
        return size // len(self.after)


@dataclass(frozen=True, slots=True)
class FrameStuffing:
    """The finished frame is stuffed, its check value included; ``front`` and ``back`` bytes of it are not.

    The byte inserted after the frame's very last byte is sent, but no receiver waits for it.
    """

    rule: Insertion
    front: int
    back: int

    def most_sent(self, payload: int) -> int:
        """Most bytes that a payload of so many bytes takes on the wire, as far as a length counts them."""
        return payload

    def most_frame(self, size: int) -> int:
        """Most bytes on the wire that a frame of so many bytes takes, whatever it holds."""
        return size + self.rule.growth(size - self.front - self.back)

    def stuff(self, frame: bytes) -> bytes:
        """The frame as it is sent."""
        end = len(frame) - self.back
        return frame[: self.front] + self.rule.stuff(frame[self.front : end]) + frame[end:]


@dataclass(frozen=True, slots=True)
class PayloadStuffing:
    """The payload alone is stuffed; the length counts and the check value covers what is sent."""

    rule: Insertion

    def most_sent(self, payload: int) -> int:
        """Most bytes that a payload of so many bytes takes on the wire, as far as a length counts them."""
        return payload + self.rule.growth(payload)

    def unstuff(self, sent: bytes) -> bytes | None:
        """The payload without the inserted bytes, None where one is missing or another one."""
        plain = sent.replace(self.rule.inserted, self.rule.after)
        return plain if self.rule.stuff(plain) == sent else None


Transparency = Plain | SevenBit | FrameStuffing | PayloadStuffing
