"""Check values that are not CRCs: sums, XORs, and the two sums of Fletcher and Adler.

Each is a register that takes the bytes one after the other: ``start``, ``step`` and ``finish``.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import ClassVar, Literal

from qlinkgen._dataclass import dataclass

__all__ = ["SUMS", "Fletcher", "Sum", "Xor"]

#: The value sent for a sum: the sum, its bits inverted, or the number that makes the sum zero.
Form = Literal["plain", "inverted", "zero"]


class _Register:
    """A register of ``width`` bits that begins with ``init`` and takes the covered bytes in wire order."""

    __slots__ = ()

    name: str
    width: int
    init: int
    aliases: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The name and the aliases."""
        return (self.name, *self.aliases)

    @property
    def mask(self) -> int:
        """All bits of the value set."""
        return (1 << self.width) - 1

    @property
    def start(self) -> int:
        """The initial register."""
        return self.init

    @property
    def check(self) -> int:
        """The value of the nine characters 123456789."""
        return self.compute(b"123456789")

    def compute(self, data: Iterable[int]) -> int:
        """Return the value of the bytes."""
        return self.finish(functools.reduce(self.step, data, self.start))

    def step(self, register: int, byte: int) -> int:
        """Return the register after one more byte."""
        raise NotImplementedError

    def finish(self, register: int) -> int:
        """Return the value of the final register."""
        return register


@dataclass(frozen=True, slots=True)
class Sum(_Register):
    """A sum of units, bytes or words, modulo a power of two.

    Attributes:
        name: name in schema files.
        width: bits of the sum.
        form: the value for a sum.
        init: start of the sum.
        aliases: other names in use.
        carry: every carry is added again.
    """

    kind: ClassVar[Literal["sum"]] = "sum"

    name: str
    width: int
    form: Form = "plain"
    init: int = 0
    aliases: tuple[str, ...] = ()
    carry: bool = False

    def step(self, register: int, byte: int) -> int:
        """Return the sum with one more unit."""
        total = register + byte
        return (total & self.mask) + (total >> self.width if self.carry else 0)

    def finish(self, register: int) -> int:
        """Return the value for the sum of all units."""
        signed = {"plain": register, "inverted": ~register, "zero": -register}[self.form]
        return signed & self.mask


@dataclass(frozen=True, slots=True)
class Xor(_Register):
    """The exclusive or of the bytes, or of pairs of bytes: the last byte is the lower one of a pair.

    Attributes:
        name: name in schema files.
        width: bits of the value.
        init: start of the value.
        aliases: other names in use.
    """

    kind: ClassVar[Literal["xor"]] = "xor"

    name: str
    width: int = 8
    init: int = 0
    aliases: tuple[str, ...] = ()

    def step(self, register: int, byte: int) -> int:
        """Return the register after one more byte."""
        if self.width == 16:
            register = (register << 8 | register >> 8) & self.mask
        return register ^ byte


@dataclass(frozen=True, slots=True)
class Fletcher(_Register):
    """The sum of the bytes, and above it the sum of all intermediate sums, both modulo one number.

    Attributes:
        name: name in schema files.
        width: bits of both sums.
        modulus: what both sums are taken modulo; at least 255.
        init: start of both sums.
        aliases: other names in use.
    """

    kind: ClassVar[Literal["fletcher"]] = "fletcher"

    name: str
    width: int
    modulus: int
    init: int = 0
    aliases: tuple[str, ...] = ()

    @property
    def half(self) -> int:
        """Bits of each sum."""
        return self.width // 2

    def step(self, register: int, byte: int) -> int:
        """Return both sums with one more byte."""
        low = ((register & (1 << self.half) - 1) + byte) % self.modulus
        return ((register >> self.half) + low) % self.modulus << self.half | low

    def reduced(self, register: int) -> int:
        """Return both sums modulo their number, as they are after any byte."""
        low = register & (1 << self.half) - 1
        return (register >> self.half) % self.modulus << self.half | low % self.modulus


#: Every check value that `find` knows and that is not a CRC.
SUMS: tuple[Sum | Xor | Fletcher, ...] = (
    Sum("sum8", 8),
    Sum("sum8-inverted", 8, "inverted", aliases=("sum8-ones-complement",)),
    Sum("sum8-zero", 8, "zero", aliases=("sum8-twos-complement", "lrc-modbus-ascii")),
    Sum("sum8-carry", 8, carry=True),
    Sum("sum8-carry-inverted", 8, "inverted", carry=True),
    Sum("sum16", 16),
    Sum("sum16-inverted", 16, "inverted"),
    Sum("sum16-zero", 16, "zero"),
    Sum("sum32", 32),
    Xor("xor8", aliases=("xor",)),
    Xor("xor16", 16),
    Fletcher("fletcher-8", 16, 256),
    Fletcher("fletcher-16", 16, 255),
    Fletcher("adler-32", 32, 65521, init=1, aliases=("adler",)),
)
