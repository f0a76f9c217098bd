"""Transparency: how the bytes of a frame are coded on the wire, and the bytes that this adds.

Each class is one kind of transparency with its encoding, its decoding and its growth. No other module of the
compiler, besides the codings themselves, implements it.
"""

from __future__ import annotations

from qlinkgen._dataclass import dataclass
from qlinkgen.plan.coding import Add, Bytewise, Insertion, Read, Stage


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
        return frame[: self.front] + self.rule.encode(frame[self.front : end]) + frame[end:]


@dataclass(frozen=True, slots=True)
class PayloadStuffing:
    """Only the payload is stuffed or coded; length and check value apply to the stuffed payload."""

    rule: Insertion | Add

    def most_sent(self, payload: int) -> int:
        """Most bytes that a payload of so many bytes takes on the wire, as far as a length counts them."""
        return payload + self.rule.growth(payload)

    def unstuff(self, sent: bytes) -> bytes | None:
        """The payload without inserted bytes, None if one is missing or wrong."""
        read = self.rule.read(sent)
        return read.plain if read.wrong is None else None


@dataclass(frozen=True, slots=True)
class Coded:
    """A frame whose first ``front`` and last ``back`` bytes are not coded.

    The others pass the ``stages`` one after the other; without any they are sent unchanged. A frame whose end
    follows from its contents has one, which is decoded byte by byte.
    """

    stages: tuple[Stage, ...]
    front: int
    back: int

    def most_sent(self, payload: int) -> int:
        """Most bytes that a payload of so many bytes takes on the wire, as far as a length counts them."""
        return payload

    def most_frame(self, size: int) -> int:
        """Maximum size on the wire of a frame of ``size`` bytes."""
        inner = size - self.front - self.back
        for stage in self.stages:
            inner += stage.growth(inner)
        return self.front + inner + self.back

    @property
    def bytewise(self) -> Bytewise:
        """The only stage of a frame that is decoded as it is read."""
        (stage,) = self.stages
        assert isinstance(stage, Bytewise)
        return stage

    def encode(self, frame: bytes) -> bytes:
        """The frame as sent."""
        end = len(frame) - self.back
        inner = frame[self.front : end]
        for stage in self.stages:
            inner = stage.encode(inner)
        return frame[: self.front] + inner + frame[end:]

    def read(self, sent: bytes) -> Read:
        """Decode the coded bytes, without those before and after them."""
        found = Read(sent, tuple(range(len(sent))))
        for stage in reversed(self.stages):
            inner = stage.read(found.plain)
            places = (*found.places, len(sent) if found.wrong is None else found.wrong)
            wrong = found.wrong if inner.wrong is None else places[inner.wrong]
            found = Read(inner.plain, tuple(places[at] for at in inner.places), wrong)
        return found


Transparency = Plain | SevenBit | FrameStuffing | PayloadStuffing | Coded
