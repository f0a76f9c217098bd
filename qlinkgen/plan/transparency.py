"""Transparency: byte stuffing, and the bytes it adds.

Each class is one kind of transparency with its encoding, its decoding and its growth. No other module of the
compiler implements stuffing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Plain:
    """Bytes are sent unchanged."""

    def most_sent(self, payload: int) -> int:
        """Most bytes that a payload of so many bytes takes on the wire, as far as a length counts them."""
        return payload


@dataclass(frozen=True, slots=True)
class SevenBit:
    """Payload bytes do not have the marker bit, which header and end have."""

    marker: int

    def most_sent(self, payload: int) -> int:
        """Most bytes that a payload of so many bytes takes on the wire, as far as a length counts them."""
        return payload


@dataclass(frozen=True, slots=True)
class Insertion:
    """Inserts an ``insert`` byte after each occurrence of ``after``; occurrences do not overlap."""

    after: bytes
    insert: int

    @property
    def inserted(self) -> bytes:
        """``after`` and the inserted byte."""
        return self.after + bytes((self.insert,))

    def stuff(self, data: bytes) -> bytes:
        """The bytes with inserted ones."""
        return data.replace(self.after, self.inserted)

    def places(self, sent: bytes) -> Iterator[int]:
        """Offsets at which an inserted byte is due; the last may be the end of the data."""
        at = sent.find(self.after)
        while at >= 0:
            at += len(self.after)
            yield at
            at = sent.find(self.after, at + (sent[at : at + 1] == bytes((self.insert,))))

    def growth(self, size: int) -> int:
        """Maximum number of bytes inserted into ``size`` bytes."""
        return size // len(self.after)


@dataclass(frozen=True, slots=True)
class FrameStuffing:
    """The whole frame is stuffed, check value included, except its first ``front`` and last ``back`` bytes.

    A byte inserted after the last byte of the frame is sent, but receivers do not wait for it.
    """

    rule: Insertion
    front: int
    back: int

    def most_sent(self, payload: int) -> int:
        """Most bytes that a payload of so many bytes takes on the wire, as far as a length counts them."""
        return payload

    def most_frame(self, size: int) -> int:
        """Maximum size on the wire of a frame of ``size`` bytes."""
        return size + self.rule.growth(size - self.front - self.back)

    def stuff(self, frame: bytes) -> bytes:
        """The stuffed frame."""
        end = len(frame) - self.back
        return frame[: self.front] + self.rule.stuff(frame[self.front : end]) + frame[end:]


@dataclass(frozen=True, slots=True)
class PayloadStuffing:
    """Only the payload is stuffed; length and check value apply to the stuffed payload."""

    rule: Insertion

    def most_sent(self, payload: int) -> int:
        """Most bytes that a payload of so many bytes takes on the wire, as far as a length counts them."""
        return payload + self.rule.growth(payload)

    def unstuff(self, sent: bytes) -> bytes | None:
        """The payload without inserted bytes, None if one is missing or wrong."""
        plain = sent.replace(self.rule.inserted, self.rule.after)
        return plain if self.rule.stuff(plain) == sent else None


Transparency = Plain | SevenBit | FrameStuffing | PayloadStuffing
