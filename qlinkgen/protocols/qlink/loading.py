"""Loading a program into a node (section 7.6).

An opening request without data says that a load begins; then the text follows in pieces, numbered from 0. A
piece whose acknowledgement was lost is sent again under its number, and the node does not store it twice.
"""

from __future__ import annotations

from dataclasses import dataclass

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError, LoadError
from qlinkgen.link.procedure import Ask, Pause, Procedure, Tell
from qlinkgen.link.transaction import Reply
from qlinkgen.protocols.qlink.facts import PIECE

#: Seconds between two rounds of attempts at one piece.
RETRY_PAUSE = 0.05


@dataclass(frozen=True, slots=True)
class LoadProgress:
    """How far a load is: bytes of the program's text that the node has acknowledged, of all."""

    acknowledged: int
    total: int


@dataclass(frozen=True, slots=True)
class LoadReport:
    """A load that has come to its end.

    Attributes:
        size: bytes of text.
        pieces: requests that carried them.
        repeats: requests beyond the first for each piece.
        seconds: time from the first request to the last answer.
    """

    size: int
    pieces: int
    repeats: int
    seconds: float


def load(node: int, text: bytes, *, piece: int = PIECE, patience: float = 5.0) -> Procedure[LoadReport]:
    """Hand the text of a program to a node; tells LoadProgress.

    Args:
        node: the node, 1..16.
        text: Intel HEX text, checked before.
        piece: bytes in one request, 1..25.
        patience: seconds for which one piece is tried.

    Raises:
        LoadError: a piece was not acknowledged in that time. The node holds a part of the program; a new load
            begins from the start.
        ValueError: nothing to load, or a piece of a size that cannot be.
    """
    if not text:
        raise ValueError("there is nothing to load: the program's text is empty")
    if not 1 <= piece <= PIECE:
        raise ValueError(f"piece: {piece} bytes were asked for; a request carries 1..{PIECE}")
    total, repeats = len(text), 0
    opening = qlink.NodeProgramLoadRequest(node=node)
    reply = yield from _insist(opening, 0, total, patience)
    began = reply.at - reply.elapsed
    yield Tell(LoadProgress(0, total))
    starts = range(0, total, piece)
    for number, start in enumerate(starts):
        request = qlink.NodeProgramLoadRequest(
            node=node, counter=number & 0xFF, program_data=text[start : start + piece]
        )
        reply = yield from _insist(request, start, total, patience)
        repeats += reply.attempts - 1
        yield Tell(LoadProgress(start + len(request.program_data), total))
    return LoadReport(total, len(starts), repeats, reply.at - began)


def _insist(
    request: qlink.NodeProgramLoadRequest, acknowledged: int, total: int, patience: float
) -> Procedure[Reply]:
    """Ask until the piece is acknowledged, or for as long as there is patience."""
    began: float | None = None
    attempts = 0
    while True:
        try:
            reply: Reply = yield Ask(request, trial=True)
        except LinkError as error:
            attempts += error.attempts
            now = yield Pause(RETRY_PAUSE)
            if began is None:
                began = now - RETRY_PAUSE - error.elapsed
            if now - began >= patience:
                held = "holds a part of the program" if acknowledged else "may have dropped its program"
                raise LoadError(
                    f"node {request.node}: {acknowledged} of {total} bytes were acknowledged, then no "
                    f"answer for {now - began:.1f} s; the node {held}, so load it again: {error}",
                    acknowledged=acknowledged,
                    total=total,
                    node=request.node,
                    attempts=attempts,
                    elapsed=now - began,
                    received=error.received,
                ) from error
        else:
            return reply._replace(attempts=reply.attempts + attempts)
