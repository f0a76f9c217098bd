"""Check values of responses that cover their request.

Copied next to modules that use it, unchanged.
"""

from __future__ import annotations

from ._checks import Checksum
from ._support import Command

TYPE_CHECKING = False  # as typing.TYPE_CHECKING; importing `typing` costs 5 ms
if TYPE_CHECKING:
    from typing import Any

    from ._support import MessageClass


class Proof:
    """The check value of a response, its last field, that covers bytes of its request.

    Attributes:
        field: its name.
        check: its algorithm.
        slices: the bytes of the frame of the request: first byte, and the end, counted from that of the frame
            if it is 0 or less.
        begin: the first byte of the response that it covers.
        size: its own bytes.
    """

    __slots__ = ("begin", "check", "field", "size", "slices")

    def __init__(
        self,
        field: str,
        check: Checksum,
        slices: tuple[tuple[int, int], ...],
        begin: int,
        size: int,
    ) -> None:
        self.field = field
        self.check = check
        self.slices = slices
        self.begin = begin
        self.size = size

    def compute(self, request: bytes, payload: bytes) -> int:
        """The value for the frame of a request and the payload of its response."""
        covered = b""
        for first, end in self.slices:
            covered += request[first : end if end > 0 else len(request) + end]
        own = payload[self.begin : len(payload) - self.size]
        return self.check.compute(covered + own, self.check.start)


class ProvenCommand(Command):
    """A transaction whose response has a check value that covers its request.

    Attributes:
        proof: that check value.
    """

    __slots__ = ("proof",)

    def __init__(
        self,
        proof: Proof,
        name: str,
        id: int,
        request: MessageClass,
        response: MessageClass,
        **others: Any,  # the arguments of a command
    ) -> None:
        super().__init__(name, id, request, response, **others)
        self.proof = proof
