"""The check value of a frame: the bytes it covers and its encoding."""

from __future__ import annotations

from qlinkgen._dataclass import dataclass
from qlinkgen.model.checksum import Checksum as AnyAlgorithm
from qlinkgen.model.checksum import Sum
from qlinkgen.model.frame import Checksum
from qlinkgen.model.integer import ByteOrder, unpack_chunks


@dataclass(frozen=True, slots=True)
class Check:
    """A check value.

    Attributes:
        value: algorithm, wire bytes and covered parts, as the document states them.
        word: size of the big-endian words that a sum adds; 1 for a sum of bytes.
        chained: the sum includes the request: its id as a number, then its payload.
        rejected: the value that signals a refused request, None if there is none.
    """

    value: Checksum
    word: int = 1
    chained: bool = False
    rejected: int | None = None

    @property
    def algorithm(self) -> AnyAlgorithm:
        """The algorithm that computes the value."""
        return self.value.algorithm

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        return self.value.size

    @property
    def over(self) -> tuple[str, ...]:
        """Names of the covered parts, in wire order."""
        return self.value.over

    @property
    def mask(self) -> int:
        """The bits that are sent."""
        return self.value.mask

    @property
    def regular(self) -> ByteOrder | None:
        """Byte order of a value that is sent whole, None if bits are omitted or regrouped."""
        return self.value.regular

    @property
    def otherwise(self) -> int | None:
        """The value over no bytes, None if the algorithm gives it."""
        return self.value.otherwise

    @property
    def complete(self) -> bool:
        """Whether every bit of the value is sent."""
        return self.mask == self.algorithm.mask

    def of(self, *runs: bytes, start: int = 0) -> int:
        """The value over runs of bytes; a sum begins with ``start`` and splits each run into words."""
        if self.otherwise is not None and not any(runs):
            return self.otherwise
        if not isinstance(self.algorithm, Sum):
            return self.algorithm.compute(b"".join(runs))
        words = [run[at : at + self.word] for run in runs for at in range(0, len(run), self.word)]
        return self.algorithm.compute([start, *(int.from_bytes(word, "big") for word in words)])

    def pack(self, value: int) -> bytes:
        """The wire bytes of a value."""
        return self.value.pack(value)

    def sent(self, value: int) -> int:
        """A value as far as it is sent."""
        return self.value.sent(value)

    def unpack(self, data: bytes) -> int:
        """The value of wire bytes; bits that are not sent are 0."""
        if self.value.base == 10:
            return int(data) if data.isdigit() else 0
        if self.value.base:
            return int(data, 16) if data.isalnum() and not data.upper().strip(b"0123456789ABCDEF") else 0
        return unpack_chunks(data, self.value.chunks)

    def normal(self, data: bytes) -> bytes:
        """Received bytes as they are sent: digits in upper case."""
        return self.value.normal(data)
