"""The stream of a message: its valid and wrong vectors with noise between them.

The receiver of the plan determines the expected events.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.conformance.rows import Right, Row
from qlinkgen.model.message import Direction
from qlinkgen.plan import MessagePlan, Plan
from qlinkgen.plan.codec import Decoded
from qlinkgen.plan.ends import Gaps, Hunt, InStep, Marks, Rescan
from qlinkgen.plan.parts import MarkPart
from qlinkgen.plan.receive import receiver

#: The event of an intact frame.
INTACT = "intact"
#: Maximum number of events of a row.
_MOST_EVENTS = 0xFE


@dataclass(frozen=True, slots=True)
class Stream:
    """The expected events for the rows of a message.

    Attributes:
        noisy: whether a piece of noise precedes each row, see :func:`noise`.
        events: for each row the events that it completes, "intact" or the kind of a fault; None for an
            omitted row.
    """

    noisy: bool
    events: tuple[tuple[str, ...] | None, ...]


def noise(plan: Plan) -> tuple[bytes, ...]:
    """Noise between frames: bytes that do not begin a frame, or begin one without completing it."""
    strategy, direction = plan.frame.receiver, plan.received_directions[0]
    envelopes = [each.envelope for each in plan.frames[direction].sought]
    match strategy:
        case Hunt() | Rescan():
            # One byte more must not complete a frame.
            long = [each for each in envelopes if len(envelopes) == 1 or each.overhead > each.header_size + 1]
            preambles = [each.starts[0] if each.starts else b"" for each in long]
            begun = [each + b"\x00" for each in preambles]
            return tuple(dict.fromkeys((b"\x00\xff", *(each[:1] for each in preambles), b"", *begun)))
        case Marks():
            header = envelopes[0].front[0]
            assert isinstance(header, MarkPart)
            first = header.byte(plan.messages[0].id, header.address.mask & 1)
            return bytes((header.marker ^ 0xFF,)), b"", bytes((first,))
        case InStep():
            ids = {message.id for message in plan.protocol.messages}
            return bytes((next((number for number in range(0xFF, -1, -1) if number not in ids), 0),)), b""
        case Gaps():
            return (b"",)
        case _:
            assert_never(strategy)


def stream(plan: Plan, message: MessagePlan, rows: Sequence[Row]) -> Stream | None:
    """The stream of a message, with noise and wrong frames as far as its frames remain detectable.

    If only an id distinguishes frames from noise, noise can become part of a frame. Returns None for a
    message that is not received, or if not even consecutive frames are received as sent.
    """
    unframed = message.asked or message.turned
    if not message.decoded or unframed or (plan.frame.needs_request and message.direction == "response"):
        return None
    direction, right = plan.direction_of(message), [isinstance(row, Right) for row in rows]
    kept = [right[index] or fed(plan, direction, row.wire) for index, row in enumerate(rows)]
    for noisy, chosen in ((True, kept), (False, kept), (False, right)):
        found = _heard(plan, direction, rows, chosen, noisy=noisy)
        if found is not None:
            return Stream(noisy, found)
    return None


def fed(plan: Plan, direction: Direction, wire: bytes) -> bool:
    """Whether a wrong frame can be part of a stream: it contains no valid frame, and receivers recover."""
    alone = receiver(plan, direction)
    heard = [event for byte in wire for event in alone.feed(byte)]
    left = list(alone.finish())
    return not any(event.decoded for event in heard + left) and not (plan.frame.needs_request and left)


def _heard(
    plan: Plan, direction: Direction, rows: Sequence[Row], chosen: Sequence[bool], *, noisy: bool
) -> tuple[tuple[str, ...] | None, ...] | None:
    listener, pieces = receiver(plan, direction), noise(plan)
    events: list[tuple[str, ...] | None] = []
    intact: list[Decoded] = []
    for index, row in enumerate(rows):
        if not chosen[index]:
            events.append(None)
            continue
        data = (pieces[index % len(pieces)] if noisy else b"") + row.wire
        heard = [event for byte in data for event in listener.feed(byte)]
        last = isinstance(plan.frame.receiver, Rescan) and index == len(rows) - 1
        if last or plan.frame.silent:
            heard += listener.finish()
        intact += [event.decoded for event in heard if event.decoded]
        events.append(tuple(INTACT if event.decoded else event.kind for event in heard))
        if len(heard) > _MOST_EVENTS:
            return None
    due = [row for row in rows if isinstance(row, Right)]
    return tuple(events) if _same(intact, due) else None


def _same(intact: Sequence[Decoded], due: Sequence[Right]) -> bool:
    return len(intact) == len(due) and all(
        (heard.message.name, heard.address or 0) == (row.message.name, row.address)
        and (row.decode_only or (heard.payload == row.payload and heard.beside.items() >= row.beside.items()))
        for heard, row in zip(intact, due, strict=True)
    )
