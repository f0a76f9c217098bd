"""A dissected frame: spans of bytes, and the rules that are broken."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from qlinkgen.model.message import Direction
from qlinkgen.plan.framing import Part
from qlinkgen.plan.payload import Member, Step
from qlinkgen.plan.tree import MessagePlan, Plan


class Around(Enum):
    """Bytes that belong to neither a part nor a step."""

    #: Before the frame.
    BEFORE = "before"
    #: The last bytes of a preamble that is not whole.
    LOST = "lost"
    #: An inserted byte.
    INSERTED = "inserted"
    #: In the payload, after the last step.
    EXTRA = "extra"
    #: The next frame, which begins before this one is complete.
    NEXT = "next"
    #: After the frame.
    AFTER = "after"


class Rule(Enum):
    """What a frame may break."""

    #: The frame has a beginning: a preamble, or a header.
    BEGINNING = "beginning"
    #: The frame begins with the first byte.
    FIRST = "first"
    #: A constant part has its value.
    CONSTANT = "constant"
    #: All bytes are there; ``seen`` are missing.
    WHOLE = "whole"
    #: No frame begins inside another.
    ALONE = "alone"
    #: The inserted byte follows; ``seen`` is another one, None the end of the payload.
    STUFFING = "stuffing"
    #: The length is within its bounds.
    LENGTH = "length"
    #: The frame ends with the last byte; ``seen`` bytes follow.
    LAST = "last"
    #: The message number is known.
    MESSAGE = "message"
    #: The payload has a size that the message can have; ``seen`` is its size.
    SIZE = "size"
    #: The end has the address of the header.
    END = "end"
    #: The message may carry the address.
    ADDRESS = "address"
    #: The check value is right.
    CHECK = "check"
    #: The check value is not that of a refusal.
    REFUSED = "refused"
    #: A value is one that its field may have.
    VALUE = "value"


Owner = Part | Step | Member | Around


@dataclass(frozen=True, slots=True)
class Span:
    """Bytes that belong together.

    Attributes:
        of: the part, step or member that they are, or where they lie.
        places: wire offsets, in rising order; a member has those of its integer.
        raw: the bytes at these places.
        size: bytes that it should have.
        number: the integer in them, None where they are not whole or hold none.
        fault: kind of what is wrong with them, "" where nothing is.
    """

    of: Owner
    places: tuple[int, ...]
    raw: bytes
    size: int
    number: int | None = None
    fault: str = ""


@dataclass(frozen=True, slots=True)
class Fault:
    """A rule that is broken.

    Attributes:
        kind: what `decode` calls it.
        rule: which rule.
        at: wire offset of the first byte that shows it; the size of the wire where bytes are missing.
        of: the part, step or member that is wrong, None where it is the frame.
        seen: the number that is wrong, see `Rule`.
    """

    kind: str
    rule: Rule
    at: int
    of: Part | Step | Member | None = None
    seen: int | None = None


@dataclass(frozen=True, slots=True)
class Cell:
    """A part as it was found: its bytes without inserted ones, their places, its bytes as they were sent."""

    data: bytes
    places: tuple[int, ...]
    sent: bytes


@dataclass(frozen=True)
class Dissection:
    """A frame in spans.

    Attributes:
        plan: of the protocol.
        direction: the direction that the frame is taken for.
        wire: all bytes.
        request: the packet that is answered, b"" where the protocol has none.
        message: the message that the number in the frame means, None where that is missing or unknown.
        number: number of the message, None where it is not in the frame or not whole.
        address: the address, None where it is not in the frame or not whole.
        spans: by their first place, a member after its integer; without members they are the wire exactly.
        faults: what is wrong, that of `kind` first; () where `kind` is "".
        kind: what `Codec.decode` raises, "" where it gives a message.
        cells: the parts that were found.
        expected: the check value that would be right, None where it cannot be told.
    """

    plan: Plan
    direction: Direction
    wire: bytes
    request: bytes
    message: MessagePlan | None
    number: int | None
    address: int | None
    spans: tuple[Span, ...]
    faults: tuple[Fault, ...]
    kind: str
    cells: Mapping[str, Cell]
    expected: int | None
