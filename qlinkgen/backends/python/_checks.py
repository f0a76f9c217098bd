"""Check values of generated modules: CRCs, sums, and the catalogue that names them.

Copied next to those that have one.
"""

from __future__ import annotations

from binascii import crc_hqx
from struct import Struct

from ._support import DecodeError

TYPE_CHECKING = False  # as typing.TYPE_CHECKING; importing `typing` costs 5 ms
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Literal

    #: Checksum of data, beginning with a register.
    Crc = Callable[[bytes, int], int]

#: The 16-bit algorithms of the CRC catalogue: names, poly, init, refin, refout, xorout.
CATALOGUE: tuple[tuple[str, int, int, bool, bool, int], ...] = (
    ("crc-16/arc arc crc-16 crc-16/lha crc-ibm", 0x8005, 0x0000, True, True, 0x0000),
    ("crc-16/cdma2000", 0xC867, 0xFFFF, False, False, 0x0000),
    ("crc-16/cms", 0x8005, 0xFFFF, False, False, 0x0000),
    ("crc-16/dds-110", 0x8005, 0x800D, False, False, 0x0000),
    ("crc-16/dect-r r-crc-16", 0x0589, 0x0000, False, False, 0x0001),
    ("crc-16/dect-x x-crc-16", 0x0589, 0x0000, False, False, 0x0000),
    ("crc-16/dnp", 0x3D65, 0x0000, True, True, 0xFFFF),
    ("crc-16/en-13757", 0x3D65, 0x0000, False, False, 0xFFFF),
    (
        "crc-16/genibus crc-16/darc crc-16/epc crc-16/epc-c1g2 crc-16/i-code",
        0x1021,
        0xFFFF,
        False,
        False,
        0xFFFF,
    ),
    ("crc-16/gsm", 0x1021, 0x0000, False, False, 0xFFFF),
    (
        "crc-16/ibm-3740 crc-16/autosar crc-16/ccitt-false",
        0x1021,
        0xFFFF,
        False,
        False,
        0x0000,
    ),
    (
        "crc-16/ibm-sdlc crc-16/iso-hdlc crc-16/iso-iec-14443-3-b crc-16/x-25 crc-b x-25",
        0x1021,
        0xFFFF,
        True,
        True,
        0xFFFF,
    ),
    ("crc-16/iso-iec-14443-3-a crc-a", 0x1021, 0xC6C6, True, True, 0x0000),
    (
        "crc-16/kermit crc-16/bluetooth crc-16/ccitt crc-16/ccitt-true crc-16/v-41-lsb crc-ccitt kermit",
        0x1021,
        0x0000,
        True,
        True,
        0x0000,
    ),
    ("crc-16/lj1200", 0x6F63, 0x0000, False, False, 0x0000),
    ("crc-16/m17", 0x5935, 0xFFFF, False, False, 0x0000),
    ("crc-16/maxim-dow crc-16/maxim", 0x8005, 0x0000, True, True, 0xFFFF),
    ("crc-16/mcrf4xx", 0x1021, 0xFFFF, True, True, 0x0000),
    ("crc-16/modbus modbus", 0x8005, 0xFFFF, True, True, 0x0000),
    ("crc-16/nrsc-5", 0x080B, 0xFFFF, True, True, 0x0000),
    ("crc-16/opensafety-a", 0x5935, 0x0000, False, False, 0x0000),
    ("crc-16/opensafety-b", 0x755B, 0x0000, False, False, 0x0000),
    ("crc-16/profibus crc-16/iec-61158-2", 0x1DCF, 0xFFFF, False, False, 0xFFFF),
    ("crc-16/riello", 0x1021, 0xB2AA, True, True, 0x0000),
    ("crc-16/spi-fujitsu crc-16/aug-ccitt", 0x1021, 0x1D0F, False, False, 0x0000),
    ("crc-16/t10-dif", 0x8BB7, 0x0000, False, False, 0x0000),
    ("crc-16/teledisk", 0xA097, 0x0000, False, False, 0x0000),
    ("crc-16/tms37157", 0x1021, 0x89EC, True, True, 0x0000),
    (
        "crc-16/umts crc-16/buypass crc-16/verifone",
        0x8005,
        0x0000,
        False,
        False,
        0x0000,
    ),
    ("crc-16/usb", 0x8005, 0xFFFF, True, True, 0xFFFF),
    (
        "crc-16/xmodem crc-16/acorn crc-16/lte crc-16/v-41-msb xmodem zmodem",
        0x1021,
        0x0000,
        False,
        False,
        0x0000,
    ),
)


class Checksum:
    """A checksum algorithm.

    Attributes:
        name: name in the catalogue.
        start: initial register for `compute`.
        compute: function of data and initial register.
    """

    __slots__ = ("compute", "name", "start")

    def __init__(self, name: str, compute: Crc, start: int = 0) -> None:
        self.name = name
        self.compute = compute
        self.start = start

    def verifier(self, size: int, order: Literal["big", "little"] = "big") -> Crc:
        """A function of data with its checksum at the end, and of a register; it returns 0 if they match."""
        compute = self.compute
        if compute is crc_hqx and order == "big":
            return crc_hqx  # the CRC of data and its CRC is 0
        return lambda data, start: (
            compute(bytes(data[:-size]), start) ^ int.from_bytes(data[-size:], order)
        )


def wrong_check(
    seen: bytes, right: bytes, checksum: Checksum, frame: bytes
) -> DecodeError:
    """The error for a wrong check value."""
    text = f"received checksum {seen.hex(' ')}, expected {right.hex(' ')} ({checksum.name})"
    return DecodeError(text, "crc", data=frame)


def crc(
    name: str,
    *,
    width: int,
    poly: int,
    init: int,
    refin: bool,
    refout: bool,
    xorout: int,
) -> Checksum:
    """A CRC with the parameters of the catalogue."""
    if (width, poly, refin, refout, xorout) == (16, 0x1021, False, False, 0):
        return Checksum(name, crc_hqx, init)  # in the standard library, 20 times faster
    if (width, poly, refin, refout) == (16, 0x1021, True, True):
        return Checksum(name, _mirrored_crc(xorout), init)
    if refin:
        return Checksum(
            name, _reflected_crc(width, poly, refout, xorout), _reflect(init, width)
        )
    spare = max(
        0, 8 - width
    )  # a register of less than 8 bits is left-aligned in a byte
    return Checksum(
        name,
        _plain_crc(width + spare, poly << spare, spare, refout, xorout),
        init << spare,
    )


def _mirrored_crc(xorout: int) -> Crc:
    """The function of the standard library for mirrored bytes; its register is mirrored, too."""
    mirror = bytes(_reflect(byte, 8) for byte in range(256))
    low = [each ^ xorout & 0xFF for each in mirror]
    high = [each << 8 ^ xorout & 0xFF00 for each in mirror]

    def compute(data: bytes, register: int) -> int:
        crc = crc_hqx(data.translate(mirror), register)
        return high[crc & 0xFF] | low[crc >> 8]

    return compute


def _plain_crc(width: int, poly: int, spare: int, refout: bool, xorout: int) -> Crc:
    mask, shift, high = (1 << width) - 1, width - 8, 1 << (width - 1)
    table = _table(
        high, lambda value: (value << 1 ^ (poly if value & high else 0)) & mask
    )
    if width == 16:
        return _plain_pairs(table, refout, xorout)

    def compute(data: bytes, register: int) -> int:
        for byte in data:
            register = (register << 8 & mask) ^ table[register >> shift ^ byte]
        register >>= spare
        return (_reflect(register, width - spare) if refout else register) ^ xorout

    return compute


def _reflected_crc(width: int, poly: int, refout: bool, xorout: int) -> Crc:
    feedback = _reflect(poly, width)
    table = _table(
        1, lambda value: value >> 1 ^ (feedback if value & 1 else 0), up=False
    )
    if width == 16:
        return _reflected_pairs(table, refout, xorout)

    def compute(data: bytes, register: int) -> int:
        for byte in data:
            register = register >> 8 ^ table[(register ^ byte) & 0xFF]
        return (register if refout else _reflect(register, width)) ^ xorout

    return compute


class _Split(dict[int, "Callable[[bytes], tuple[int, ...]]"]):
    """By the size of data, the function that splits it into pairs of bytes and an odd one.

    A CRC of 16 bits from the changes by every pair is twice as fast as from those by single bytes.
    """

    def __init__(self, form: str) -> None:
        super().__init__()
        self._form = form

    def __missing__(self, size: int) -> Callable[[bytes], tuple[int, ...]]:
        form = self._form.format(pairs=size >> 1, odd=size & 1)
        self[size] = unpack = Struct(form).unpack
        return unpack


def _plain_pairs(table: list[int], refout: bool, xorout: int) -> Crc:
    earlier = [(each << 8 & 0xFFFF) ^ table[each >> 8] for each in table]
    pairs = [first ^ last for first in earlier for last in table]
    tops = {each & 0xFF: top for top, each in enumerate(table)}
    split = _Split(">{odd}B{pairs}H")

    def compute(data: bytes, register: int) -> int:
        size = len(data)
        if size & 1 and register:
            # The odd byte is the first one, like a pair with a zero: begin before that.
            top = tops[register & 0xFF]
            register = top << 8 | (register ^ table[top]) >> 8
        for pair in split[size](data):
            register = pairs[register ^ pair]
        return (_reflect(register, 16) if refout else register) ^ xorout

    return compute


def _reflected_pairs(table: list[int], refout: bool, xorout: int) -> Crc:
    earlier = [each >> 8 ^ table[each & 0xFF] for each in table]
    pairs = [first ^ last for last in table for first in earlier]
    split = _Split("<{pairs}H{odd}x")

    def compute(data: bytes, register: int) -> int:
        size = len(data)
        for pair in split[size](data):
            register = pairs[register ^ pair]
        if size & 1:
            register = register >> 8 ^ table[(register ^ data[-1]) & 0xFF]
        return (register if refout else _reflect(register, 16)) ^ xorout

    return compute


def _table(seed: int, clock: Callable[[int], int], *, up: bool = True) -> list[int]:
    """The change of the register by each byte; it is linear, so eight entries give all 256."""
    table = [0] * 256
    value, bits = seed, range(8) if up else range(7, -1, -1)
    for bit in bits:
        value = clock(value)
        table[1 << bit] = value
    for byte in range(3, 256):
        low = byte & -byte
        table[byte] = table[low] ^ table[byte ^ low]
    return table


def _reflect(value: int, width: int) -> int:
    return int(f"{value:0{width}b}"[::-1], 2)


def find_crc(name: str) -> Checksum:
    """The 16-bit algorithm with a name or alias of the catalogue; case and punctuation are ignored.

    Raises:
        ValueError: the name is unknown.
    """
    key = _key(name)
    for names, *parameters in CATALOGUE:
        known = names.split()
        if key in {
            _key(part)
            for each in known
            for part in (each, each.partition("/")[2] or each)
        }:
            poly, init, refin, refout, xorout = parameters
            return crc(
                known[0],
                width=16,
                poly=poly,
                init=init,
                refin=bool(refin),
                refout=bool(refout),
                xorout=xorout,
            )
    choices = ", ".join(row[0].split()[0].partition("/")[2] for row in CATALOGUE)
    raise ValueError(f"unknown 16-bit CRC {name!r}; use one of {choices}")


def _key(name: str) -> str:
    return "".join(filter(str.isalnum, name.lower()))


def sum_of(name: str, width: int, form: str = "plain", *, init: int = 0) -> Checksum:
    """The sum of the bytes; "inverted", or the number that makes the sum "zero"."""
    mask = (1 << width) - 1
    if form == "inverted":
        return Checksum(name, lambda data, start: ~(start + sum(data)) & mask, init)
    if form == "zero":
        return Checksum(name, lambda data, start: -(start + sum(data)) & mask, init)
    return Checksum(name, lambda data, start: (start + sum(data)) & mask, init)


def carried(name: str, form: str = "plain", *, init: int = 0) -> Checksum:
    """The sum of the bytes in eight bits, to which every carry is added again; or "inverted"."""
    flip = 0xFF if form == "inverted" else 0
    return Checksum(name, lambda data, start: _folded(start + sum(data)) ^ flip, init)


def _folded(total: int) -> int:
    return (total - 1) % 0xFF + 1 if total else 0


def xor_of(name: str, width: int = 8, *, init: int = 0) -> Checksum:
    """The exclusive or of the bytes, or of pairs of them."""
    return Checksum(name, _xor if width == 8 else _xor_pairs, init)


def _xor_pairs(data: bytes, register: int) -> int:
    for byte in data:
        register = (register << 8 & 0xFF00 | register >> 8) ^ byte
    return register


def _xor(data: bytes, register: int) -> int:
    if len(data) < 32:
        for byte in data:
            register ^= byte
        return register
    number, shift = int.from_bytes(data, "big"), 4 << len(data).bit_length()
    while shift >= 8:  # folding halves onto each other is faster than single bytes
        number ^= number >> shift
        shift >>= 1
    return number & 0xFF ^ register


def fletcher(name: str, half: int, modulus: int, *, init: int = 0) -> Checksum:
    """The sum of the bytes, and above it the sum of all intermediate sums."""
    from itertools import accumulate

    mask = (1 << half) - 1

    def compute(data: bytes, start: int) -> int:
        low = start & mask
        high = (start >> half) + len(data) * low + sum(accumulate(data))
        return high % modulus << half | (low + sum(data)) % modulus

    return Checksum(name, compute, init)


def adler(name: str, *, init: int = 1) -> Checksum:
    """The checksum of zlib."""
    from zlib import adler32

    return Checksum(name, adler32, init)
