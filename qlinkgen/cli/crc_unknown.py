"""Finds the parameters of a CRC from frames, without any list of algorithms.

A frame and its CRC are one polynomial over GF(2) that the generator P divides, except for what `init` and
`xorout` add. Of two frames of one length both add the same, so P divides the sum of the frames: the greatest
common divisor of several sums is P, or a small multiple of it. Then each frame gives equations for the bits
of `init` and `xorout`; frames of at least two lengths tell the two apart, and a third length confirms them.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Literal

from qlinkgen._dataclass import dataclass
from qlinkgen.model.checksum import Algorithm

Order = Literal["big", "little"]

#: Bits of a common divisor beyond the width that are tried as a factor of it.
_EXTRA = 12
#: Most solutions of the equations that are looked at for a usual one.
_SOLUTIONS = 8


@dataclass(frozen=True, slots=True)
class Place:
    """Where the check value is, and what it covers."""

    size: int
    order: Order
    lead: int
    end: int

    def split(self, frame: bytes) -> tuple[bytes, int] | None:
        """Return the covered bytes and the check value, None for a frame that is too short."""
        at = len(frame) - self.end - self.size
        if at <= self.lead:
            return None
        return frame[self.lead : at], int.from_bytes(frame[at : at + self.size], self.order)


@dataclass(frozen=True, slots=True)
class Recovered:
    """A CRC that all frames have.

    Attributes:
        algorithm: its parameters; several of them fit if `open_bits` is not 0.
        open_bits: bits of init and xorout that frames of other lengths would determine.
    """

    place: Place
    algorithm: Algorithm
    open_bits: int


def recover(frames: Sequence[bytes], sizes: Sequence[int]) -> Recovered | None:
    """Return the CRC of frames, the simplest place first; None if there is none, or the frames are too few.

    At least three frames of one length, or two pairs of frames of one length each, are needed for P.
    """
    orders: tuple[Order, ...] = ("big", "little")
    for end, lead, size in itertools.product(range(3), range(9), sizes):
        for order, reflected in itertools.product(orders if size > 1 else orders[:1], (False, True)):
            place = Place(size, order, lead, end)
            parts = [place.split(each) for each in frames]
            whole = [each for each in parts if each is not None]
            if len(whole) == len(parts) and (found := _recovered(place, whole, reflected)) is not None:
                return found
    return None


def _recovered(place: Place, parts: Sequence[tuple[bytes, int]], reflected: bool) -> Recovered | None:
    width = 8 * place.size
    rows = [
        (_polynomial(data, reflected), 8 * len(data), _bits(check, width, reflected)) for data, check in parts
    ]
    for poly in _generators(rows, width):
        solved = _solve(rows, poly, width)
        if solved is None:
            continue
        init, xorout, open_bits = solved
        mask = (1 << width) - 1
        algorithm = Algorithm(
            "own", width, poly & mask, init, reflected, reflected, _bits(xorout, width, reflected), 0
        )
        if all(algorithm.compute(data) == check for data, check in parts):
            return Recovered(place, algorithm, open_bits)
    return None


def _polynomial(data: bytes, reflected: bool) -> int:
    """Return bytes as a polynomial, the first bit with the highest power."""
    if reflected:
        data = bytes(_reverse(each, 8) for each in data)
    return int.from_bytes(data, "big")


def _bits(value: int, width: int, reflected: bool) -> int:
    return _reverse(value, width) if reflected else value


def _reverse(value: int, width: int) -> int:
    return int(f"{value:0{width}b}"[::-1], 2)


def _generators(rows: Sequence[tuple[int, int, int]], width: int) -> Iterator[int]:
    """Return polynomials of this degree that divide the sums of frames of one length."""
    by_length = defaultdict[int, list[int]](list)
    for data, size, check in rows:
        by_length[size].append(data << width ^ check)
    divisor, sums = 0, 0
    for wholes in by_length.values():
        for each in wholes[1:]:
            if each != wholes[0]:
                divisor = _gcd(divisor, each ^ wholes[0])
                sums += 1
    while divisor and not divisor & 1:
        divisor >>= 1  # P is odd
    extra = divisor.bit_length() - 1 - width
    if sums < 2 or not 0 <= extra <= _EXTRA:
        return
    for factor in range(1 << extra, 2 << extra):
        quotient, rest = _divide(divisor, factor)
        if not rest:
            yield quotient


def _gcd(one: int, other: int) -> int:
    while other:
        one, other = other, _divide(one, other)[1]
    return one


def _divide(one: int, by: int) -> tuple[int, int]:
    quotient, size = 0, by.bit_length()
    while (shift := one.bit_length() - size) >= 0:
        one ^= by << shift
        quotient |= 1 << shift
    return quotient, one


def _solve(rows: Sequence[tuple[int, int, int]], poly: int, width: int) -> tuple[int, int, int] | None:
    """Return init, xorout in the order of the polynomial, and the number of bits that stay open."""
    equations: list[int] = []
    for data, size, check in rows:
        equations += _equations(size, poly, width, _divide(data << width, poly)[1] ^ check)
    pivots = _eliminated(equations, 2 * width)
    if pivots is None:
        return None
    free = [bit for bit in range(2 * width) if bit not in pivots]
    best = min(_solutions(pivots, free, width), key=lambda found: _oddity(found, width))
    return (*best, _determined(poly, width) - len(pivots))


def _equations(size: int, poly: int, width: int, known: int) -> Iterator[int]:
    """Return an equation for each bit of a CRC: bits of init, of xorout above them, then the right side."""
    columns = [_divide(1 << each + size, poly)[1] for each in range(width)]
    for bit in range(width):
        row = sum((column >> bit & 1) << index for index, column in enumerate(columns))
        yield row | 1 << width + bit | (known >> bit & 1) << 2 * width


def _determined(poly: int, width: int) -> int:
    """Return the number of bits of init and xorout that frames of all lengths determine.

    Others make no difference: with a factor x + 1 in P, a bit of xorout does the same as one of init.
    """
    every = (each for size in range(1, width + 2) for each in _equations(8 * size, poly, width, 0))
    return len(_eliminated(list(every), 2 * width) or {})


def _eliminated(equations: Sequence[int], unknown: int) -> dict[int, int] | None:
    """Return the reduced equation of each bit that is determined, None if they contradict one another."""
    pivots: dict[int, int] = {}
    for equation in equations:
        for bit, pivot in pivots.items():
            if equation >> bit & 1:
                equation ^= pivot  # noqa: PLW2901  # reduced step by step
        left = equation & (1 << unknown) - 1
        if not left:
            if equation:
                return None
            continue
        low = (left & -left).bit_length() - 1
        for bit, pivot in pivots.items():
            if pivot >> low & 1:
                pivots[bit] = pivot ^ equation
        pivots[low] = equation
    return pivots


def _solutions(pivots: dict[int, int], open_bits: Sequence[int], width: int) -> Iterator[tuple[int, int]]:
    """Return some init and xorout: open bits all 0 or 1, as usual values have them, and single ones."""
    mask = (1 << width) - 1
    every = sum(1 << bit for bit in open_bits)
    choices = [0, every, every & mask, every & mask << width, *(1 << bit for bit in open_bits[:_SOLUTIONS])]
    for usual in (0, mask):  # init or xorout as usual, as far as their bits are open
        choices += [usual & every, usual << width & every]
    for choice in dict.fromkeys(choices):
        found = choice
        for bit, equation in pivots.items():
            rest = (equation & ~(1 << bit) & every & choice).bit_count() & 1
            if (equation >> 2 * width & 1) ^ rest:
                found |= 1 << bit
        yield found & mask, found >> width & mask


def _oddity(found: tuple[int, int], width: int) -> tuple[int, int, int]:
    """Return less for usual parameters: 0 and all ones."""
    mask = (1 << width) - 1
    init, xorout = found
    return (xorout not in {0, mask}) + (init not in {0, mask}), xorout, init
