"""Check values of answers that cover parts of the frame of their request, too."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from qlinkgen._dataclass import dataclass
from qlinkgen.model.frame import FrameKinds, Part
from qlinkgen.model.integer import Chunk
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Command, Proof

#: What a proof covers of a request: constant bytes, bytes of its address, or its payload.
Piece = bytes | tuple[Chunk, ...] | Literal["payload"]


@dataclass(frozen=True)
class ProofPlan:
    """The check value of a response.

    Attributes:
        value: its name, that of the last field.
        proof: as the document states it.
        pieces: what it covers of the request, in order.
        slices: the same as bytes of its frame: first byte, and the end, 0 or less where it is counted from
            that of the frame.
    """

    value: str
    proof: Proof
    pieces: tuple[Piece, ...]
    slices: tuple[tuple[int, int], ...]

    def compute(self, request: bytes, payload: bytes) -> int:
        """The value for the frame of a request and the payload of its response."""
        ends = ((first, end if end > 0 else len(request) + end) for first, end in self.slices)
        covered = b"".join(request[first:end] for first, end in ends)
        own = payload[self.proof.begin : len(payload) - self.proof.size]
        return self.proof.algorithm.compute(covered + own)


def proof_of(protocol: Protocol, command: Command) -> ProofPlan | None:
    """The check value of the response to a command that covers its request, None without one."""
    proof = command.proof
    if proof is None:
        return None
    value = next(each.value for each in command.echoes if each.of == proof)
    frame = protocol.frame
    assert isinstance(frame, FrameKinds)  # only in one of several kinds may an answer be a payload alone
    kind = frame.carrying(command.request.id)[0]
    parts = {part.name: part for part in kind.frame.parts}
    number = command.request.id - frame.base(kind.family)
    places = dict(_places(kind.frame.parts))
    pieces = tuple(_piece(parts[name], number) for name in proof.over)
    return ProofPlan(value, proof, pieces, _joined(places[name] for name in proof.over))


def _piece(part: Part, number: int) -> Piece:
    """A part of the frame of a request whose number is known."""
    if part.role == "payload":
        return "payload"
    if part.scalar is None:
        return part.constant
    if part.role == "address":
        return part.scalar.integer.chunks
    whole = sum((number >> bits.at & ((1 << bits.bits) - 1)) << bits.shift for bits in part.bits)
    return part.scalar.integer.pack(whole if part.role == "message" else part.scalar.default)


def _places(parts: tuple[Part, ...]) -> Iterator[tuple[str, tuple[int, int]]]:
    """The first byte of each part of a frame and the end, as in `ProofPlan.slices`."""
    at, left = 0, sum(part.size for part in parts)
    for part in parts:
        if part.role == "payload":
            left -= at
            yield part.name, (at, -left)
            at = -left
        else:
            yield part.name, (at, at + part.size)
            at += part.size


def _joined(slices: Iterator[tuple[int, int]]) -> tuple[tuple[int, int], ...]:
    """The slices, adjoining ones as one."""
    found: list[tuple[int, int]] = []
    for first, end in slices:
        if found and found[-1][1] == first:
            found[-1] = found[-1][0], end
        else:
            found.append((first, end))
    return tuple(found)
