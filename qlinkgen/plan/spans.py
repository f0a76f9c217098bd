"""A dissected frame: spans of bytes and violated rules."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum

from qlinkgen._dataclass import dataclass
from qlinkgen.model.message import Direction
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.parts import Part
from qlinkgen.plan.payload import Member, Step
from qlinkgen.plan.tree import MessagePlan, Plan


class Around(Enum):
    """The role of bytes outside of parts and steps."""

    #: Before the frame.
    BEFORE = "before"
    #: The last bytes of an incomplete preamble.
    LOST = "lost"
    #: An inserted byte.
    INSERTED = "inserted"
    #: A coded byte that cannot be decoded, or that follows one.
    UNCLEAR = "unclear"
    #: Between two fields.
    SEPARATOR = "separator"
    #: In the payload, after the last step.
    EXTRA = "extra"
    #: The next frame, which begins before this one is complete.
    NEXT = "next"
    #: After the frame.
    AFTER = "after"


class Rule(Enum):
    """A rule that a frame may violate."""

    #: The frame has a beginning: a preamble, or a header.
    BEGINNING = "beginning"
    #: The frame begins with the first byte.
    FIRST = "first"
    #: A constant part has its value.
    CONSTANT = "constant"
    #: The frame is complete; ``seen`` bytes are missing.
    WHOLE = "whole"
    #: No other frame begins inside the frame.
    ALONE = "alone"
    #: The inserted byte follows; ``seen`` is the wrong byte, None at the end of the payload.
    STUFFING = "stuffing"
    #: The length is within its bounds.
    LENGTH = "length"
    #: The terminator follows within the longest frame.
    TERMINATOR = "terminator"
    #: The length is the size of what it counts; ``seen`` is the length.
    COUNTED = "counted"
    #: The frame ends with the last byte; ``seen`` bytes follow.
    LAST = "last"
    #: The message number is known.
    MESSAGE = "message"
    #: The message can have a payload of this size; ``seen`` is the size.
    SIZE = "size"
    #: The end byte has the address of the header.
    END = "end"
    #: The message may carry the address.
    ADDRESS = "address"
    #: The check value is right.
    CHECK = "check"
    #: The check value does not signal a refused request.
    REFUSED = "refused"
    #: A value is legal for its field.
    VALUE = "value"
    #: The check value of a response is that of its request and its own bytes.
    PROOF = "proof"


Owner = Part | Step | Member | Around


@dataclass(frozen=True, slots=True)
class Span:
    """Bytes that belong together.

    Attributes:
        of: the part, step or member, or the role of bytes outside of them.
        places: wire offsets, ascending; a member has those of its integer, a coded byte may have several.
        raw: the bytes at these offsets.
        size: the expected number of bytes.
        number: the integer that they encode, or the number of items in a row of bits; None if they are
            incomplete or another field.
        fault: kind of the fault in them, "" if there is none.
        inside: the record that they are in, followed by a dot: "satellites[3]."; "" outside of records.
    """

    of: Owner
    places: tuple[int, ...]
    raw: bytes
    size: int
    number: int | None = None
    fault: str = ""
    inside: str = ""


@dataclass(frozen=True, slots=True)
class Fault:
    """A violated rule.

    Attributes:
        kind: the kind of error that `decode` raises.
        rule: the rule.
        at: wire offset of the first wrong byte; the size of the data if bytes are missing.
        of: the wrong part, step or member, None for the frame.
        seen: the wrong number, see `Rule`.
        inside: as in `Span`.
        right: the only legal number of a field that follows from others, None for others.
    """

    kind: str
    rule: Rule
    at: int
    of: Part | Step | Member | None = None
    seen: int | None = None
    inside: str = ""
    right: int | None = None


@dataclass(frozen=True, slots=True)
class Cell:
    """A received part: its bytes without inserted ones, their wire offsets, its bytes as received."""

    data: bytes
    places: tuple[int, ...]
    sent: bytes


@dataclass(frozen=True)
class Dissection:
    """A frame in spans.

    Attributes:
        plan: plan of the protocol.
        direction: the assumed direction.
        wire: all bytes.
        request: the packet that the frame answers, b"" if responses do not depend on it.
        message: the message with the number in the frame, None if the number is missing or unknown.
        number: number of the message, None if missing or incomplete.
        address: the address, None if missing or incomplete.
        spans: by first offset, a member after its integer; those that are not members cover the wire once.
        faults: the violated rules, the one of `kind` first; () if `kind` is "".
        kind: the kind of error that `Codec.decode` raises, "" for a valid frame.
        cells: the parts found, and seeds of the check value, whose places are -1.
        expected: the right check values that are known, by part.
        frame: the plan of the frame, of its kind if there are several.
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
    expected: Mapping[str, int]
    frame: FramePlan
