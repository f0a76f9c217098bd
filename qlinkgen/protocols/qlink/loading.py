"""Loading a program into a node (section 7.6).

An opening request without data starts the load; then the text follows in pieces, numbered from 0. If an
acknowledgement is lost, the piece is sent again under its number, and the node does not store it twice.
"""

from __future__ import annotations

from dataclasses import dataclass

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError, LoadError
from qlinkgen.link.procedure import Ask, Pause, Procedure, Tell
from qlinkgen.link.transaction import Reply
from qlinkgen.protocols.qlink.facts import PIECE, PIECES

#: Seconds between two rounds of attempts at one piece.
RETRY_PAUSE = 0.05


@dataclass(frozen=True, slots=True)
class LoadProgress:
    """Progress of a load: bytes of the program's text that the node has acknowledged, of the total."""

    acknowledged: int
    total: int


@dataclass(frozen=True, slots=True)
class LoadReport:
    """A completed load.

    Attributes:
        size: bytes of text.
        pieces: number of pieces.
        repeats: repeated requests.
        seconds: time from the first request to the last answer.
    """

    size: int
    pieces: int
    repeats: int
    seconds: float


def load(node: int, text: bytes, *, piece: int = PIECE, patience: float = 5.0) -> Procedure[LoadReport]:
    """Send the text of a program to a node; reports LoadProgress.

    Args:
        node: the node, 1..16.
        text: checked Intel HEX text.
        piece: bytes in one request, 1..25.
        patience: time limit for one piece in seconds.

    Raises:
        LoadError: a piece was not acknowledged in that time. The node holds part of the program; a new load
            starts over.
        ValueError: the text is empty, or `piece` is out of range.
    """
    if not text:
        raise ValueError("the text of the program is empty")
    if not 1 <= piece <= PIECE:
        raise ValueError(f"piece must be 1..{PIECE} bytes, not {piece}")
    total, repeats = len(text), 0
    opening = qlink.NodeProgramLoadRequest(node=node)
    reply = yield from _insist(opening, 0, total, patience)
    began = reply.at - reply.elapsed
    yield Tell(LoadProgress(0, total))
    starts = range(0, total, piece)
    for number, start in enumerate(starts):
        request = qlink.NodeProgramLoadRequest(
            node=node, counter=number % (PIECES.most + 1), program_data=text[start : start + piece]
        )
        reply = yield from _insist(request, start, total, patience)
        repeats += reply.attempts - 1
        yield Tell(LoadProgress(start + len(request.program_data), total))
    return LoadReport(total, len(starts), repeats, reply.at - began)


def _insist(
    request: qlink.NodeProgramLoadRequest, acknowledged: int, total: int, patience: float
) -> Procedure[Reply]:
    """Send a piece until it is acknowledged, within the time limit."""
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
                held = "holds part of the program" if acknowledged else "may have discarded its program"
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
