"""What ends a frame, and how a receiver finds frames."""

from __future__ import annotations

from qlinkgen._dataclass import dataclass
from qlinkgen.plan.parts import ConstantPart, LengthPart, MarkPart


@dataclass(frozen=True, slots=True)
class ByLength:
    """A length gives the number of payload bytes."""

    part: LengthPart


@dataclass(frozen=True, slots=True)
class ByMessage:
    """The size of the payload follows from the message and its counts."""


@dataclass(frozen=True, slots=True)
class ByMark:
    """The next byte with the marker bit ends the payload."""

    header: MarkPart
    end: MarkPart


@dataclass(frozen=True, slots=True)
class ByTerminator:
    """Bytes that do not occur before end the frame; ``after`` bytes of other parts follow them.

    Attributes:
        part: the terminator, one of the parts after the payload.
        shared: it may also begin the next frame.
        paired: the byte that begins it, and pairs of coded bytes; None if one of its bytes cannot occur.
    """

    part: ConstantPart
    after: int
    shared: bool
    paired: int | None = None

    def find(self, wire: bytes, first: int, limit: int) -> int:
        """The offset of the terminator that is wholly between two offsets, -1 if there is none."""
        if self.paired is None:
            return wire.find(self.part.data, first, limit)
        at = wire.find(self.part.data[:1], first, limit - 1)
        while at >= 0 and wire[at : at + 2] != self.part.data:
            at = wire.find(self.part.data[:1], at + 2, limit - 1)
        return at


@dataclass(frozen=True, slots=True)
class BySilence:
    """Only an idle line ends a frame."""


@dataclass(frozen=True, slots=True)
class ByKind:
    """Each kind of frame has an end of its own."""


@dataclass(frozen=True, slots=True)
class ByTurn:
    """Only the turn of a frame in its dialogue tells it: receivers do not look for it."""


End = ByLength | ByMessage | ByMark | ByTerminator | BySilence | ByKind | ByTurn


# How a receiver finds frames


@dataclass(frozen=True, slots=True)
class Hunt:
    """The preamble occurs nowhere else: each byte is processed once, and only the frame itself is buffered.

    Attributes:
        mark: the byte that the preamble consists of, twice; inside a frame ``insert`` follows it.
    """

    mark: int
    insert: int


@dataclass(frozen=True, slots=True)
class Rescan:
    """An apparent start of a frame may be data: after a failed attempt the search continues at the next byte.

    Attributes:
        bare: frames do not begin with a constant, so only a known message number and an allowed address
            distinguish them from noise.
        verified: frames have a check value, so one with a valid check value is consumed even if its contents
            are wrong.
        seeded: the check value covers a seed, so it cannot be verified if the message is unknown.
    """

    bare: bool
    verified: bool
    seeded: bool = False

    def proves(self, kind: str, *, inside: bool) -> bool:
        """Whether a frame with a fault of this kind is certain to be one; ``inside``: in a field of it."""
        return self.verified and (inside or kind != "crc") and not (self.seeded and kind == "unknown")


@dataclass(frozen=True, slots=True)
class Marks:
    """Header and end have a marker bit that all other bytes lack."""


@dataclass(frozen=True, slots=True)
class InStep:
    """Frames have no delimiter: both sides must stay in step."""


@dataclass(frozen=True, slots=True)
class Gaps:
    """The bytes between two silences are a frame, or none begins in them."""


Receiver = Hunt | Rescan | Marks | InStep | Gaps
