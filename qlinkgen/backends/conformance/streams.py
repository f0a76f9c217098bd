"""The stream of a message: its vectors, right and wrong, one behind the other with noise between them.

What a receiver tells of it is not worked out here: a receiver that is known to be right is asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from qlinkgen.backends.conformance.rows import Right, Row
from qlinkgen.backends.conformance.sources import Header, Heard, Sources
from qlinkgen.model.frame import DelimitedFrame, MarkedFrame
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol

#: The word for an event that is an intact frame.
INTACT = "intact"
#: Most events that a row of the kit can hold.
_MOST_EVENTS = 0xFE


@dataclass(frozen=True, slots=True)
class Stream:
    """What a receiver tells of a message's rows, one after the other.

    Attributes:
        noisy: a piece of noise stands in front of each row that is fed, see :func:`noise`.
        events: for each row the words of what it completes, "intact" or the kind of a fault; None for a row
            that is left out.
    """

    noisy: bool
    events: tuple[tuple[str, ...] | None, ...]


def noise(protocol: Protocol) -> tuple[bytes, ...]:
    """Pieces that stand between frames, each in its turn: bytes that begin no frame, or begin one in vain."""
    frame = protocol.frame
    if isinstance(frame, DelimitedFrame):
        return tuple(dict.fromkeys((b"\x00\xff", frame.preamble[:1], b"", frame.preamble + b"\x00")))
    if isinstance(frame, MarkedFrame):
        header = frame.marker | 1 << frame.address_bits.shift | protocol.messages[0].id << frame.id_bits.shift
        return bytes([frame.marker ^ 0xFF]), b"", bytes([header])
    ids = {message.id for message in protocol.messages}
    return bytes([next((number for number in range(0xFF, -1, -1) if number not in ids), 0)]), b""


def stream(protocol: Protocol, sources: Sources, direction: Direction, rows: Sequence[Row]) -> Stream | None:
    """The stream of a message, with as much noise and as many broken frames as its frames stand out of.

    Where nothing but an id tells a frame from noise, they can become one with it. None where not even frame
    behind frame is heard as they were sent.
    """
    for noisy, everything in ((True, True), (False, True), (False, False)):
        found = _heard(protocol, sources, direction, rows, noisy=noisy, everything=everything)
        if found is not None:
            return Stream(noisy, found)
    return None


def _heard(
    protocol: Protocol,
    sources: Sources,
    direction: Direction,
    rows: Sequence[Row],
    *,
    noisy: bool,
    everything: bool,
) -> tuple[tuple[str, ...] | None, ...] | None:
    listener, pieces = sources.listen(direction), noise(protocol)
    due = [row for row in rows if isinstance(row, Right)]
    events: list[tuple[str, ...] | None] = []
    intact: list[Heard] = []
    for index, row in enumerate(rows):
        if not everything and not isinstance(row, Right):
            events.append(None)
            continue
        heard = list(listener.feed((pieces[index % len(pieces)] if noisy else b"") + row.wire))
        if sources.header.rescans and index == len(rows) - 1:
            heard += listener.finish()
        intact += [each for each in heard if not each.kind]
        events.append(tuple(each.kind or INTACT for each in heard))
        if len(heard) > _MOST_EVENTS:
            return None
    return tuple(events) if _same(intact, due) else None


def _same(intact: Sequence[Heard], due: Sequence[Right]) -> bool:
    return len(intact) == len(due) and all(
        (heard.message, heard.address) == (row.message.name, row.address)
        and (row.decode_only or heard.payload == row.payload)
        for heard, row in zip(intact, due, strict=True)
    )


def received_as(header: Header, protocol: Protocol, message: Message, role: str) -> Direction | None:
    """The direction in which a receiver hears a message, None where there is none for it."""
    if header.packets:
        return "request" if message.direction == "request" else None
    if message.direction != "message" or protocol.directions == ("message",):
        return message.direction
    return "response" if role == "master" else "request"
