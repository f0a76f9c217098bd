"""Floating-point numbers of IEEE 754. Their raw integer is their bits."""

from __future__ import annotations

import struct
from typing import ClassVar

from qlinkgen._dataclass import dataclass

_FORMATS = {16: ">e", 32: ">f", 64: ">d"}


@dataclass(frozen=True, slots=True)
class Float:
    """A floating-point number of 16, 32 or 64 bits.

    Without ``bounds`` every bit pattern is legal, also infinities and NaN. With them a number is legal if it
    is between the two, so NaN is not.
    """

    kind: ClassVar = "float"
    bits: int
    bounds: tuple[float, float] | None = None

    @property
    def name(self) -> str:
        """Its type in a schema."""
        return f"f{self.bits}"

    def value(self, raw: int) -> float:
        """The number with these bits. The sign and the payload of a NaN may be lost."""
        return float(struct.unpack(_FORMATS[self.bits], raw.to_bytes(self.bits // 8, "big"))[0])

    def raw(self, value: float) -> int:
        """The bits of the nearest number, ties to even. Raises OverflowError if it is too large."""
        return int.from_bytes(struct.pack(_FORMATS[self.bits], value), "big")

    def allows(self, value: float) -> bool:
        """Whether the number is legal."""
        return self.bounds is None or self.bounds[0] <= value <= self.bounds[1]

    @property
    def legal(self) -> tuple[tuple[int, int], ...]:
        """The bits of all legal numbers, as ranges in ascending order."""
        if self.bounds is None:
            return ((0, (1 << self.bits) - 1),)
        low, high = self.bounds
        sign = 1 << self.bits - 1
        ranges = []
        if high >= 0:
            ranges.append((self.raw(max(0.0, low)), self.raw(high)))
        if low <= 0:
            # Numbers of sign and magnitude: bits ascend away from zero. -0.0 equals 0.0.
            ranges.append((sign | self.raw(-min(high, 0.0)), sign | self.raw(-low)))
        return tuple(ranges)
