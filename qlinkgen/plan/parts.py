"""The parts of a frame: their sizes, and the numbers and bits in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from qlinkgen._dataclass import dataclass
from qlinkgen.model.digits import Digits
from qlinkgen.model.integer import Chunk, Integer
from qlinkgen.model.types import Settable
from qlinkgen.plan.check import Check
from qlinkgen.plan.payload import Member


@dataclass(frozen=True, slots=True)
class ConstantPart:
    """Constant bytes, among them a terminator."""

    name: str
    data: bytes

    @property
    def size(self) -> int:
        """Bytes before stuffing."""
        return len(self.data)

    @property
    def starts(self) -> tuple[bytes, ...]:
        """What a frame may begin with if this is its first part."""
        return (self.data,)


@dataclass(frozen=True, slots=True)
class _IntegerPart:
    """An integer with one role or several."""

    name: str
    integer: Integer

    @property
    def size(self) -> int:
        """Bytes before stuffing."""
        return self.integer.size

    @property
    def digits(self) -> Digits | None:
        """Its digits if it is sent as text, which other characters make no frame; None if it is not."""
        return self.integer.text if isinstance(self.integer.text, Digits) else None


@dataclass(frozen=True, slots=True)
class LengthPart(_IntegerPart):
    """The number of payload bytes as sent, plus ``bias``, in steps of ``scale``; ``least`` to ``most``.

    ``otherwise`` is the number where another length gives a size above that, None if this is the only one.
    """

    bias: int
    least: int
    most: int
    scale: int = 1
    otherwise: int | None = None

    def number(self, payload: int) -> int:
        """The length for a size of the payload."""
        number = (payload + self.bias) // self.scale
        return number if self.otherwise is None or number <= self.most else self.otherwise

    def holds(self, number: int) -> bool:
        """Whether a frame may have the number."""
        return self.least <= number <= self.most or number == self.otherwise

    def payload(self, number: int) -> int:
        """The size of the payload for a length."""
        return number * self.scale - self.bias


@dataclass(frozen=True, slots=True)
class LeadingPart(_IntegerPart):
    """An integer that may be the first part: ``numbers`` are those that a kind of frame begins with.

    They are () if other parts tell a frame.
    """

    numbers: tuple[int, ...] = ()

    @property
    def starts(self) -> tuple[bytes, ...]:
        """What a frame may begin with if this is its first part, () if any bytes."""
        return tuple(map(self.integer.pack, self.numbers))


@dataclass(frozen=True, slots=True)
class IdPart(LeadingPart):
    """The number of the message."""


@dataclass(frozen=True, slots=True)
class AddressPart(LeadingPart):
    """The address of the node: the recipient of a request, the sender of a response."""


@dataclass(frozen=True, slots=True)
class MarkPart:
    """A byte with the marker bit, the address and the number of the message.

    Attributes:
        end_id: the message number that marks an end byte, None in a header.
    """

    name: str
    marker: int
    address_name: str
    address: Chunk
    id_name: str
    id: Chunk
    end_id: int | None

    #: Bytes before stuffing.
    size = 1

    def byte(self, number: int, address: int) -> int:
        """The byte for a message number and an address."""
        shown = number if self.end_id is None else self.end_id
        return self.marker | address << self.address.shift | shown << self.id.shift

    def id_of(self, byte: int) -> int:
        """The message number in the byte."""
        return byte >> self.id.shift & self.id.mask

    def address_of(self, byte: int) -> int:
        """The address in the byte."""
        return byte >> self.address.shift & self.address.mask


@dataclass(frozen=True, slots=True)
class PayloadPart:
    """The payload: minimum and maximum size before stuffing, and maximum size as a length counts it.

    Attributes:
        trim: bytes that are sent at least where zeros at the end are not, None if all are sent.
        opening: name of the message id that it begins with, "" if other parts hold the id.
    """

    name: str
    least: int
    most: int
    most_sent: int
    trim: int | None = None
    opening: str = ""

    #: Size of an empty payload.
    size = 0


@dataclass(frozen=True, slots=True)
class CheckPart:
    """The check value."""

    name: str
    check: Check

    @property
    def size(self) -> int:
        """Bytes before stuffing."""
        return self.check.size


@dataclass(frozen=True, slots=True)
class BlocksPart:
    """Check values of the blocks of the payload: one follows every ``every`` bytes of it, one the rest."""

    name: str
    check: Check
    every: int

    #: Bytes for an empty payload.
    size = 0

    def blocks(self, payload: bytes) -> list[bytes]:
        """The blocks of a payload."""
        return [payload[at : at + self.every] for at in range(0, len(payload), self.every)]

    def values(self, payload: bytes) -> bytes:
        """The check values of a payload."""
        return b"".join(self.check.pack(self.check.of(block)) for block in self.blocks(payload))

    def join(self, payload: bytes, values: bytes) -> bytes:
        """A payload and its check values as sent."""
        size = self.check.size
        return b"".join(
            block + values[index * size : (index + 1) * size]
            for index, block in enumerate(self.blocks(payload))
        )

    def added(self, payload: int) -> int:
        """Bytes of the check values of a payload of so many bytes."""
        return -(-payload // self.every) * self.check.size

    def plain(self, sent: int) -> int:
        """Bytes of a payload that takes so many bytes with its check values; a cut one counts."""
        whole = self.every + self.check.size
        return sent // whole * self.every + min(self.every, sent % whole)


@dataclass(frozen=True, slots=True)
class Seed:
    """Bytes that a check value covers but that are not sent: a numeric attribute of the message."""

    attribute: str


@dataclass(frozen=True, slots=True)
class IdSlot:
    """Bits with a piece of the message number, which begins at its bit ``at``."""

    shift: int
    bits: int
    at: int


@dataclass(frozen=True, slots=True)
class AddressSlot:
    """Bits with the address of the node."""

    shift: int
    bits: int

    #: Place in the address.
    at = 0


@dataclass(frozen=True, slots=True)
class ConstantSlot:
    """Bits with one of several legal numbers, the first of which is sent."""

    shift: int
    bits: int
    values: tuple[int, ...]

    def holds(self, number: int) -> bool:
        """Whether the bits of the integer have a legal value."""
        return number >> self.shift & (1 << self.bits) - 1 in self.values


#: Bits of an integer of a frame; a member is a value of every frame.
Slot = IdSlot | AddressSlot | ConstantSlot | Member


def _fixed(slot: Slot, numbers: Mapping[str, int]) -> Slot:
    if not isinstance(slot, Member) or slot.name not in numbers:
        return slot
    value = numbers[slot.name]
    number = replace(slot.number, minimum=value, maximum=value, default=value, role=Settable())
    return replace(slot, number=number)


@dataclass(frozen=True, slots=True)
class CellPart(LeadingPart):
    """An integer whose bits have several roles; bits without one are sent as 0 and ignored when received."""

    slots: tuple[Slot, ...] = ()

    @property
    def constants(self) -> tuple[ConstantSlot, ...]:
        """The constants among its bits."""
        return tuple(slot for slot in self.slots if isinstance(slot, ConstantSlot))

    @property
    def values(self) -> tuple[Member, ...]:
        """The values among its bits."""
        return tuple(slot for slot in self.slots if isinstance(slot, Member))

    def fixing(self, numbers: Mapping[str, int]) -> CellPart:
        """The part where some of its values are always the same."""
        if numbers.keys().isdisjoint(each.name for each in self.values):
            return self
        return replace(self, slots=tuple(_fixed(each, numbers) for each in self.slots))

    @property
    def initial(self) -> int:
        """The integer with the defaults of its values, and without anything else."""
        return sum((each.number.default & each.number.integer.mask) << each.shift for each in self.values)


@dataclass(frozen=True, slots=True)
class EqualPart(_IntegerPart):
    """An integer derived from an earlier one of the same size: inverted or not, plus ``added``."""

    of: LengthPart | IdPart | AddressPart | CellPart
    inverted: bool
    added: int

    def value(self, number: int) -> int:
        """The integer for a value of the other."""
        return ((~number if self.inverted else number) + self.added) & self.integer.mask


@dataclass(frozen=True, slots=True)
class Bits:
    """Where bits of a message number or an address travel: in a part from bit ``shift`` on.

    Attributes:
        at: their first bit in the number.
    """

    part: IdPart | AddressPart | CellPart
    shift: int
    bits: int
    at: int

    @property
    def whole(self) -> bool:
        """Whether the part holds them alone."""
        return self.bits == self.part.integer.bits

    @property
    def mask(self) -> int:
        """Mask of the bits, before they are shifted into place."""
        return (1 << self.bits) - 1


def gathered(pieces: tuple[Bits, ...], cells: Mapping[str, bytes]) -> int | None:
    """The number or address in the bytes of parts; None if a piece is missing or has wrong digits."""
    number = 0
    for bits in pieces:
        data = cells.get(bits.part.name, b"")
        if len(data) < bits.part.size or (bits.part.digits and bits.part.digits.number(data) is None):
            return None
        number |= (bits.part.integer.unpack(data) >> bits.shift & bits.mask) << bits.at
    return number


Numeric = LengthPart | IdPart | AddressPart | CellPart | EqualPart
Part = ConstantPart | Numeric | MarkPart | PayloadPart | CheckPart | BlocksPart
