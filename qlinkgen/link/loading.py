"""Loading a program into a node in numbered pieces, each acknowledged before the next one.

If an acknowledgement is lost, the piece is sent again under its number, and the node does not store it twice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from qlinkgen.errors import LinkError, LoadError, Refused
from qlinkgen.link.codec import Framed
from qlinkgen.link.procedure import Ask, Pause, Procedure, Tell
from qlinkgen.link.transaction import Reply

#: Seconds between two rounds of attempts at one piece.
RETRY_PAUSE = 0.05


@dataclass(frozen=True, slots=True)
class LoadProgress:
    """Progress of a load: bytes of the program that the node has acknowledged, of the total."""

    acknowledged: int
    total: int


@dataclass(frozen=True, slots=True)
class LoadReport:
    """A completed load.

    Attributes:
        size: bytes of the program.
        pieces: number of pieces.
        repeats: repeated requests.
        seconds: time from the first request to the last answer.
    """

    size: int
    pieces: int
    repeats: int
    seconds: float


@dataclass(frozen=True, slots=True)
class Pieces:
    """The requests that carry a program.

    Attributes:
        make: makes the request of a piece from its number and its bytes.
        numbers: how many numbers there are, from 0; after the last one, 0 follows.
        piece: bytes in one request.
        opening: request without data that starts a load, None if there is none.
        node: address of the node, None if frames have no address.
    """

    make: Callable[[int, bytes], Framed]
    numbers: int
    piece: int
    opening: Framed | None
    node: int | None


def load(program: bytes, pieces: Pieces, *, patience: float = 5.0) -> Procedure[LoadReport]:
    """Send a program to a node; reports LoadProgress.

    Args:
        program: its bytes.
        pieces: the requests.
        patience: time limit for one piece in seconds.

    Raises:
        LoadError: a piece was refused, or not acknowledged in that time. The node may hold part of the
            program; a new load starts over.
        ValueError: the program is empty.
    """
    if not program:
        raise ValueError("the program is empty")
    total, repeats, ended = len(program), 0, 0.0
    began: float | None = None
    if pieces.opening is not None:
        reply = yield from _insist(pieces, pieces.opening, 0, total, patience)
        began = reply.at - reply.elapsed
    yield Tell(LoadProgress(0, total))
    starts = range(0, total, pieces.piece)
    for number, start in enumerate(starts):
        data = program[start : start + pieces.piece]
        request = pieces.make(number % pieces.numbers, data)
        reply = yield from _insist(pieces, request, start, total, patience)
        began, ended = reply.at - reply.elapsed if began is None else began, reply.at
        repeats += reply.attempts - 1
        yield Tell(LoadProgress(start + len(data), total))
    return LoadReport(total, len(starts), repeats, ended - (began or 0.0))


def _insist(
    pieces: Pieces, request: Framed, acknowledged: int, total: int, patience: float
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
            if isinstance(error, Refused) or now - began >= patience:
                held = "holds part of the program" if acknowledged else "may have discarded its program"
                who = "the device" if pieces.node is None else f"node {pieces.node}"
                ended = "a refusal" if isinstance(error, Refused) else f"no answer for {now - began:.1f} s"
                whose = "it" if pieces.node is None else "the node"
                raise LoadError(
                    f"{who}: {acknowledged} of {total} bytes were acknowledged, then {ended}; "
                    f"{whose} {held}, so load it again: {error}",
                    acknowledged=acknowledged,
                    total=total,
                    node=pieces.node,
                    attempts=attempts,
                    elapsed=now - began,
                    received=error.received,
                ) from error
        else:
            return reply._replace(attempts=reply.attempts + attempts)
