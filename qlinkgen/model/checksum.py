"""Checksums by name: the catalogue of CRC algorithms, 3 to 64 bits wide, sums and others.

The parameters of a CRC are those of the RevEng catalogue: `init` and `poly` describe a register that shifts
towards its high bit, regardless of `refin`. Implementations keep the register of a reflected CRC reflected,
which saves reflecting each byte. Here this is called the *register form*: `start`, `feedback` and
the arguments and results of `register` and `before` have it, so that back-ends can print them directly.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import ClassVar, Literal

from qlinkgen._dataclass import dataclass
from qlinkgen.errors import QlinkgenError
from qlinkgen.model.spelling import similar
from qlinkgen.model.sums import SUMS, Fletcher, Sum, Xor

__all__ = [
    "SUMS",
    "Algorithm",
    "Checksum",
    "Fletcher",
    "Sum",
    "UnknownAlgorithm",
    "Xor",
    "begun",
    "candidates",
    "catalogue",
    "find",
    "of_width",
    "stated",
]


class UnknownAlgorithm(QlinkgenError, LookupError):
    """The name of an algorithm is unknown or ambiguous.

    Attributes:
        name: the name.
        suggestions: similar known names, the likeliest first.
    """

    def __init__(self, name: str, suggestions: tuple[str, ...] = ()) -> None:
        """Compose the error text with the suggestions."""
        self.name = name
        self.suggestions = suggestions
        hint = f"; did you mean {' or '.join(suggestions)}?" if suggestions else ""
        super().__init__(f"unknown checksum algorithm {name!r}{hint}")

    def __reduce__(self) -> tuple[type[UnknownAlgorithm], tuple[str, tuple[str, ...]]]:
        """Pickle by the arguments, not by the message."""
        return type(self), (self.name, self.suggestions)


@dataclass(frozen=True, slots=True)
class Algorithm:
    """A CRC algorithm.

    Attributes:
        name: name in the catalogue, in lower case.
        width: bits of the CRC.
        poly: polynomial without its highest term.
        init: initial register, not reflected.
        refin: bytes are processed low bit first.
        refout: the final register is reflected.
        xorout: XORed with the result.
        check: CRC of the nine characters 123456789.
        aliases: other names in use.
    """

    kind: ClassVar[Literal["crc"]] = "crc"

    name: str
    width: int
    poly: int
    init: int
    refin: bool
    refout: bool
    xorout: int
    check: int
    aliases: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Reject parameters that do not describe a CRC."""
        if not 3 <= self.width <= 64:
            raise ValueError(f"{self.name}: width is {self.width}; use 3 to 64 bits")
        for parameter in ("poly", "init", "xorout", "check"):
            if not 0 <= getattr(self, parameter) <= self.mask:
                raise ValueError(f"{self.name}: {parameter} does not fit into {self.width} bits")
        # Without the constant term a step loses a bit: some errors go undetected, and `before` is undefined.
        if not self.poly & 1:
            raise ValueError(f"{self.name}: poly must be odd")

    @property
    def names(self) -> tuple[str, ...]:
        """The name and the aliases."""
        return (self.name, *self.aliases)

    @property
    def mask(self) -> int:
        """All bits of the register set."""
        return (1 << self.width) - 1

    @property
    def start(self) -> int:
        """The initial register, in register form."""
        return _reflect(self.init, self.width) if self.refin else self.init

    @property
    def feedback(self) -> int:
        """The polynomial for a bit-by-bit loop, in register form."""
        return _reflect(self.poly, self.width) if self.refin else self.poly

    def compute(self, data: Iterable[int]) -> int:
        """Return the CRC of the bytes."""
        return self.finish(self.register(data, self.start))

    def step(self, register: int, byte: int) -> int:
        """Return the register after one more byte."""
        return self.register((byte,), register)

    def finish(self, register: int) -> int:
        """Return the CRC of the final register."""
        return (_reflect(register, self.width) if self.refin != self.refout else register) ^ self.xorout

    def register(self, data: Iterable[int], start: int) -> int:
        """Return the register after the bytes, beginning with `start`."""
        table, register, shift, mask = self.table(), start, self.width - 8, self.mask
        if self.refin:
            for byte in data:
                register = (register >> 8) ^ table[(register ^ byte) & 0xFF]
        elif shift >= 0:
            for byte in data:
                register = (register << 8) & mask ^ table[(register >> shift) ^ byte]
        else:
            for byte in data:
                register = table[(register << -shift) ^ byte]
        return register

    def before(self, prefix: bytes, value: int) -> int:
        """Return the register from which `prefix` leads to `value`: `register` run backwards.

        It allows a checksum that excludes a constant preamble to be computed over the whole frame: beginning
        with `before(preamble, start)` the register is `start` after the preamble.
        """
        order = range(8) if not self.refin else range(7, -1, -1)
        for byte in reversed(prefix):
            for bit in order:
                value = self._unclock(value, byte >> bit & 1)
        return value

    def table(self, bits: int = 8) -> tuple[int, ...]:
        """Return the table for `bits` bits of input per step (8, or 4 for a small table).

        A reflected step is `register >> bits ^ table[(register ^ input) & (1 << bits) - 1]`, low bits first;
        otherwise `register << bits & mask ^ table[register >> width - bits ^ input]`, high bits first.
        """
        return _table(self, bits)

    def _clock(self, register: int, bit: int) -> int:
        if self.refin:
            return register >> 1 ^ (self.feedback if (register ^ bit) & 1 else 0)
        return register << 1 & self.mask ^ (self.feedback if register >> self.width - 1 ^ bit else 0)

    def _unclock(self, register: int, bit: int) -> int:
        # The polynomial is odd, so the bit shifted in shows whether the polynomial was applied.
        if self.refin:
            out = register >> self.width - 1
            return (register ^ (self.feedback if out else 0)) << 1 | out ^ bit
        out = register & 1
        return (register ^ (self.feedback if out else 0)) >> 1 | (out ^ bit) << self.width - 1


Checksum = Algorithm | Sum | Xor | Fletcher


def catalogue(width: int | None = None) -> tuple[Algorithm, ...]:
    """Return the CRC algorithms, of one width or all, ordered by width and name."""
    return tuple(algorithm for algorithm in _catalogue() if width in (None, algorithm.width))


def of_width(width: int) -> tuple[Checksum, ...]:
    """Return every algorithm with a name whose value has so many bits, CRCs first."""
    return (*catalogue(width), *(each for each in SUMS if each.width == width))


def stated(width: int, poly: int, init: int, *, refin: bool, refout: bool, xorout: int) -> Algorithm:
    """Return the CRC with these parameters; the one of the catalogue if it has them.

    Raises:
        ValueError: they do not describe a CRC.
    """
    wanted = (poly, init, refin, refout, xorout)
    for each in catalogue(width):
        if (each.poly, each.init, each.refin, each.refout, each.xorout) == wanted:
            return each
    name = f"crc-{width}/poly-{poly:x}"
    unchecked = Algorithm(name, width, poly, init, refin, refout, xorout, check=0)
    return replace(unchecked, check=unchecked.compute(b"123456789"))


def begun(algorithm: Checksum, init: int) -> Checksum:
    """Return the algorithm with another initial register.

    Raises:
        ValueError: the register does not fit.
    """
    if not 0 <= init <= algorithm.mask:
        raise ValueError(f"init does not fit into {algorithm.width} bits")
    if isinstance(algorithm, Fletcher):
        init = algorithm.reduced(init)
    if init == algorithm.init:
        return algorithm
    name = f"{algorithm.name}/init-{init:x}"
    if not isinstance(algorithm, Algorithm):
        return replace(algorithm, name=name, init=init, aliases=())
    stated_so = stated(
        algorithm.width,
        algorithm.poly,
        init,
        refin=algorithm.refin,
        refout=algorithm.refout,
        xorout=algorithm.xorout,
    )
    return stated_so if stated_so in catalogue(algorithm.width) else replace(stated_so, name=name)


def find(name: str) -> Checksum:
    """Return the algorithm with a name or alias.

    Case and punctuation are ignored, and the part before the slash may be omitted if the rest is unambiguous:
    `crc-16/ibm-3740`, `CRC16_CCITT_FALSE` and `ccitt-false` are one algorithm.

    Raises:
        UnknownAlgorithm: the name is unknown or ambiguous.
    """
    key = _key(name)
    if found := _by_name().get(key):
        return found
    candidates = _by_short_name().get(key, ())
    if len(candidates) == 1:
        return candidates[0]
    meant = _UNNAMED.get(key) or tuple(each.name for each in candidates)
    raise UnknownAlgorithm(name, meant or _similar(key))


#: Names that documents and libraries use for several algorithms, and these algorithms. The catalogue assigns
#: each name to one of them for historical reasons, not always the likeliest. "CRC-CCITT" is KERMIT by the
#: standard, IBM-3740 ("FALSE") in most code, and XMODEM in many bootloaders.
_CCITT = ("crc-16/ibm-3740", "crc-16/kermit", "crc-16/xmodem", "crc-16/ibm-sdlc", "crc-16/spi-fujitsu")
_IBM = ("crc-16/modbus", "crc-16/arc", "crc-16/usb")
_AMBIGUOUS = {
    "ccitt": _CCITT,
    "crcccitt": _CCITT,
    "crc16ccitt": _CCITT,
    "crcibm": _IBM,
    "crc16": (*_IBM, "crc-16/ibm-3740", "crc-16/xmodem", "crc-16/kermit"),
    "crc8": ("crc-8/smbus", "crc-8/maxim-dow", "crc-8/sae-j1850", "crc-8/autosar"),
    "crc24": ("crc-24/openpgp", "crc-24/ble", "crc-24/flexray-a"),
    "crc32": ("crc-32/iso-hdlc", "crc-32/mpeg-2", "crc-32/bzip2", "crc-32/iscsi"),
    "crc64": ("crc-64/ecma-182", "crc-64/xz", "crc-64/go-iso"),
}
#: Names that documents use for several algorithms, none of which is likelier than the others.
_UNNAMED = {
    "lrc": ("xor8", "sum8-zero"),
    "lrc8": ("xor8", "sum8-zero"),
    "bcc": ("xor8", "sum8"),
    "checksum": ("sum8", "sum8-zero", "sum8-inverted", "xor8"),
    "checksum8": ("sum8", "sum8-zero", "sum8-inverted", "xor8"),
    "sum": ("sum8", "sum16", "sum32"),
    "checksum16": ("sum16", "sum16-zero", "fletcher-16"),
    "fletcher": ("fletcher-8", "fletcher-16"),
}


def candidates(name: str) -> tuple[Checksum, ...]:
    """Return the algorithms that an ambiguous name may mean, the likeliest first; () for other names."""
    key = _key(name)
    return tuple(find(each) for each in _AMBIGUOUS.get(key) or _UNNAMED.get(key, ()))


def _similar(key: str) -> tuple[str, ...]:
    known = {_key(name): name for each in _by_name().values() for name in each.names}
    return tuple(known[match] for match in similar(key, known, most=3))


def _key(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _reflect(value: int, width: int) -> int:
    return int(f"{value:0{width}b}"[::-1], 2)


@functools.cache
def _table(algorithm: Algorithm, bits: int) -> tuple[int, ...]:
    table = [0] * (1 << bits)
    order = range(bits) if algorithm.refin else range(bits - 1, -1, -1)
    for index in range(1, len(table)):
        if low := index & (index - 1):
            # The step is linear: the entry of two combined inputs is the XOR of their entries.
            table[index] = table[low] ^ table[index ^ low]
            continue
        for bit in order:
            table[index] = algorithm._clock(table[index], index >> bit & 1)  # noqa: SLF001 - part of the class
    return tuple(table)


@functools.cache
def _catalogue() -> tuple[Algorithm, ...]:
    lines = Path(__file__).with_name("crc_catalogue.csv").read_text("ascii").splitlines()
    return tuple(_algorithm(*line.split(",")) for line in lines[1:])


def _algorithm(name: str, width: str, *parameters: str) -> Algorithm:
    poly, init, refin, refout, xorout, check, aliases = parameters
    return Algorithm(
        name=name,
        width=int(width),
        poly=int(poly, 16),
        init=int(init, 16),
        refin=refin == "true",
        refout=refout == "true",
        xorout=int(xorout, 16),
        check=int(check, 16),
        aliases=tuple(aliases.split()),
    )


@functools.cache
def _by_name() -> dict[str, Checksum]:
    everything: tuple[Checksum, ...] = (*SUMS, *_catalogue())
    return {_key(name): each for each in everything for name in each.names}


@functools.cache
def _by_short_name() -> dict[str, tuple[Algorithm, ...]]:
    found: dict[str, tuple[Algorithm, ...]] = {}
    for algorithm in _catalogue():
        for short in {_key(name.split("/")[1]) for name in algorithm.names if "/" in name}:
            found[short] = (*found.get(short, ()), algorithm)
    return found
