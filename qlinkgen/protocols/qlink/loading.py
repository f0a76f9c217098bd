"""Loading a program into a node (section 7.6).

An opening request without data starts the load; then the text follows in pieces, numbered from 0.
"""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen.codecs import qlink
from qlinkgen.link.loading import LoadProgress, LoadReport, Pieces
from qlinkgen.link.loading import load as load_pieces
from qlinkgen.link.procedure import Procedure
from qlinkgen.protocols.qlink.arguments import whole
from qlinkgen.protocols.qlink.facts import PIECE, PIECES

__all__ = ["LoadProgress", "LoadReport", "load", "pieces"]


def pieces(text: bytes, size: int = PIECE) -> Iterator[bytes]:
    """Cut a text into the program data of its requests, all of the same size except the last.

    Args:
        text: as in `HexImage.text`.
        size: bytes of each, 1..25.

    Raises:
        ValueError: `size` is out of range.
    """
    whole("size", size, 1, PIECE)
    return (text[at : at + size] for at in range(0, len(text), size))


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
    if not 1 <= piece <= PIECE:
        raise ValueError(f"piece must be 1..{PIECE} bytes, not {piece}")

    def make(number: int, data: bytes) -> qlink.NodeProgramLoadRequest:
        return qlink.NodeProgramLoadRequest(node=node, counter=number, program_data=data)

    opening = qlink.NodeProgramLoadRequest(node=node)
    return load_pieces(text, Pieces(make, PIECES.most + 1, piece, opening, node), patience=patience)
