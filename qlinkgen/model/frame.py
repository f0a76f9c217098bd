"""The three kinds of frame: delimited by preamble, length or message; marked by a bit; and bare packets."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from qlinkgen.model.checksum import Algorithm, Sum
from qlinkgen.model.integer import ByteOrder, Chunk, Integer, pack_chunks
from qlinkgen.model.texts import Text
from qlinkgen.model.types import Scalar

#: What a part of a frame is for.
Role = Literal["constant", "length", "message", "address", "payload", "checksum"]


@dataclass(frozen=True, slots=True)
class Checksum:
    """How the check value is computed and sent."""

    algorithm: Algorithm | Sum
    #: The check value's wire bytes; bits in no chunk are neither sent nor compared.
    chunks: tuple[Chunk, ...]
    #: Names of the frame parts covered, in wire order.
    over: tuple[str, ...]
    confirmed: bool = True

    @property
    def mask(self) -> int:
        """The bits that are sent."""
        return sum(chunk.mask << chunk.shift for chunk in self.chunks)

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        return len(self.chunks)

    @property
    def regular(self) -> ByteOrder | None:
        """Byte order of a check value that is sent whole; None where some bits are left out or regrouped."""
        return Integer(self.algorithm.width, False, self.chunks).byteorder

    def pack(self, value: int) -> bytes:
        """The wire bytes of a check value; bits that are not sent are dropped."""
        return pack_chunks(value, self.chunks)


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A run of bytes of a frame. ``scalar`` is the integer of a length, message id or address."""

    name: str
    role: Role
    doc: Text = ""
    section: Text = ""
    confirmed: bool = True
    constant: bytes = b""
    scalar: Scalar | None = None
    checksum: Checksum | None = None
    #: Names of the parts that a length counts.
    counts: tuple[str, ...] = ()
    #: Payload only: fewest and most bytes.
    min_size: int = 0
    max_size: int = 0

    @property
    def size(self) -> int:
        """Bytes, 0 for the payload."""
        if self.scalar is not None:
            return self.scalar.size
        return len(self.checksum.chunks) if self.checksum else len(self.constant)


@dataclass(frozen=True, slots=True)
class Stuffing:
    """After each occurrence of ``after`` an ``insert`` byte is added, so that the preamble stays unique."""

    after: bytes
    insert: int
    exempt: tuple[str, ...]
    #: True: the payload is stuffed first; length and checksum cover what is sent. False: the finished frame
    #: is stuffed, all but the exempt parts.
    before_checksum: bool = False
    section: Text = ""


@dataclass(frozen=True)
class DelimitedFrame:
    """Parts in wire order; the end follows from the length, or from the message where there is none."""

    parts: tuple[Part, ...]
    stuffing: Stuffing | None = None
    doc: Text = ""
    section: Text = ""

    kind = "delimited"

    def part(self, role: Role) -> Part | None:
        """The first part of a role."""
        return next((part for part in self.parts if part.role == role), None)

    @cached_property
    def preamble(self) -> bytes:
        """Constant bytes at the front, b"" where there are none."""
        return self.parts[0].constant

    @cached_property
    def overhead(self) -> int:
        """Bytes of a frame beside its payload, before stuffing."""
        return sum(part.size for part in self.parts)

    @cached_property
    def header_size(self) -> int:
        """Bytes in front of the payload."""
        names = [part.role for part in self.parts]
        return sum(part.size for part in self.parts[: names.index("payload")])

    @cached_property
    def length_bias(self) -> int:
        """Length field = payload size + this."""
        length = self.part("length")
        return sum(part.size for part in self.parts if length and part.name in length.counts)

    @property
    def payload(self) -> Part:
        """The payload."""
        return next(part for part in self.parts if part.role == "payload")

    def offset(self, name: str) -> int:
        """Unstuffed bytes in front of a part; parts behind the payload are counted as if it were empty."""
        position = 0
        for part in self.parts:
            if part.name == name:
                return position
            position += part.size
        raise KeyError(name)


@dataclass(frozen=True)
class MarkedFrame:
    """Header and end carry a marker bit that no other byte has.

    header = marker | address << address_bits.shift | message id << id_bits.shift; the end byte is the same
    with
    ``end_id`` in place of the message id.
    """

    marker: int
    address_name: str
    address_bits: Chunk
    id_name: str
    id_bits: Chunk
    end_id: int
    payload_max: int
    checksum: Checksum | None = None
    doc: Text = ""
    section: Text = ""

    kind = "marked"


@dataclass(frozen=True)
class PacketFrame:
    """No frame at all: message id and words go out, words and a check value over both come back."""

    id_name: str
    payload_max: int
    #: Sum over the message id and every word of request and response.
    checksum_name: str = "checksum"
    checksum: Checksum | None = None
    #: Bytes that are summed as one big-endian number.
    word_size: int = 2
    #: Check value by which the slave says that it does not know the command.
    rejected: int | None = None
    doc: Text = ""
    section: Text = ""

    kind = "packet"


Frame = DelimitedFrame | MarkedFrame | PacketFrame
