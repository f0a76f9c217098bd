"""Functions that compute the check values of responses that cover their request."""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import Names, unsigned_type
from qlinkgen.backends.c.places import in_hex
from qlinkgen.plan.proofs import Piece, ProofPlan, proof_of
from qlinkgen.plan.tree import Plan


@dataclass(frozen=True, slots=True)
class ProofView:
    """The check value of a response.

    Attributes:
        function: what the names of the functions of the response begin with.
        type: of the value.
        check: what the names of the functions of its algorithm begin with.
        lines: statements that update the value with the bytes of the request.
        reads: whether they read its frame.
        begin: the first byte of the response that it covers.
        size: its own bytes.
    """

    function: str
    type: str
    check: str
    lines: list[str]
    reads: bool
    begin: int
    size: int


def proof_views(plan: Plan, names: Names, layouts: Layouts, address: str) -> list[ProofView]:
    """The check values of the responses; ``address`` is the member of a frame with the address."""
    found = []
    for command in plan.commands:
        proof = proof_of(plan.protocol, command)
        response = plan.by_name.get(command.response.name) if command.response else None
        if proof is None or response is None:
            continue
        stated, check = proof.proof, layouts.check(proof.proof.algorithm)
        lines = list(_updates(proof, check, address))
        found.append(
            ProofView(
                names.function(response.message),
                unsigned_type(stated.algorithm.width),
                check,
                lines,
                any("request->" in line for line in lines),
                stated.begin,
                stated.size,
            )
        )
    return found


def _updates(proof: ProofPlan, check: str, address: str) -> Iterator[str]:
    for piece in proof.pieces:
        if piece == "payload":
            yield "for (size_t index = 0U; index < request->size; ++index) {"
            yield f"    value = {check}_update(value, request->payload[index]);"
            yield "}"
            continue
        yield from (f"value = {check}_update(value, {byte});" for byte in _bytes(piece, address))


def _bytes(piece: Piece, address: str) -> Iterator[str]:
    """The bytes of a constant, or of the address of a frame."""
    if isinstance(piece, bytes):
        yield from map(in_hex, piece)
        return
    for chunk in piece:
        assert not isinstance(chunk, str)
        shifted = f"(request->{address} >> {chunk.shift})" if chunk.shift else f"request->{address}"
        yield f"(uint8_t)({shifted} & {in_hex(chunk.mask)})"
