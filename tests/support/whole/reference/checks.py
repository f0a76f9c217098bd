"""Check values, bit by bit from the parameters of the catalogue."""

from __future__ import annotations

import csv
import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

#: The only file shared with the product: published parameters, not code.
CATALOGUE = Path(__file__).parents[4] / "qlinkgen" / "model" / "crc_catalogue.csv"


@functools.cache
def catalogue() -> Mapping[str, Mapping[str, str]]:
    """The parameters of CRCs by name."""
    with CATALOGUE.open(newline="") as rows:
        return {row["name"]: row for row in csv.DictReader(rows)}


#: Bits of the check values that are not CRCs.
_SUMS = {
    "sum8": 8, "sum8-inverted": 8, "sum8-zero": 8, "xor8": 8,
    "sum8-carry": 8, "sum8-carry-inverted": 8,
    "xor16": 16, "sum16": 16, "sum16-inverted": 16, "sum16-zero": 16, "sum32": 32,
    "fletcher-8": 16, "fletcher-16": 16, "adler-32": 32,
}  # fmt: skip
_MODULUS = {"fletcher-8": 256, "fletcher-16": 255, "adler-32": 65521}
#: The algorithm of a schema: a name, or the parameters of a CRC.
Algorithm = str | Mapping[str, Any]


def sums(bits: int) -> list[str]:
    """The names of check values that are not CRCs."""
    return [name for name, width in _SUMS.items() if width == bits]


def width(algorithm: Algorithm) -> int:
    """Bits of a check value."""
    if not isinstance(algorithm, str):
        return int(algorithm["width"])
    return _SUMS.get(algorithm) or int(catalogue()[algorithm]["width"])


def compute(algorithm: Algorithm, data: Sequence[int], init: int | None = None) -> int:
    """The check value of bytes; sums take numbers of any size. `init` replaces the initial register."""
    if not isinstance(algorithm, str):
        stated = {"init": 0, "refin": False, "xorout": 0} | dict(algorithm)
        stated |= {} if init is None else {"init": init}
        return _crc(bytes(data), **{"refout": stated["refin"]} | stated)
    if algorithm.startswith("sum"):
        total = (init or 0) + sum(data)
        while "carry" in algorithm and total > 0xFF:
            total = (total & 0xFF) + (total >> 8)
        signed = ~total if algorithm.endswith("inverted") else -total if algorithm.endswith("zero") else total
        return signed & (1 << width(algorithm)) - 1
    if algorithm == "xor8":
        every = [*data, init or 0]
        return sum((sum(byte >> bit & 1 for byte in every) & 1) << bit for bit in range(8))
    if algorithm == "xor16":
        # The start is a pair before the others; a single first byte is the lower one of a pair.
        start = (init or 0).to_bytes(2, "big")
        every = [*start, *data] if len(data) % 2 == 0 else [start[1], start[0], 0, *data]
        pairs = [every[at] << 8 | every[at + 1] for at in range(0, len(every), 2)]
        return functools.reduce(lambda one, other: one ^ other, pairs)
    if algorithm in _MODULUS:
        first = int(algorithm == "adler-32") if init is None else init
        return _two_sums(list(data), first, _MODULUS[algorithm], width(algorithm) // 2)
    return _named(algorithm, bytes(data), init)


def _two_sums(data: list[int], first: int, modulus: int, half: int) -> int:
    above, first = divmod(first, 1 << half)
    low = first + sum(data)
    high = above + first * len(data) + sum((len(data) - index) * byte for index, byte in enumerate(data))
    return (high % modulus << half) + low % modulus


@functools.lru_cache(maxsize=4096)
def _named(name: str, data: bytes, init: int | None) -> int:
    row = catalogue()[name]
    numbers = {key: int(row[key], 16) for key in ("poly", "init", "xorout")}
    numbers |= {} if init is None else {"init": init}
    refin, refout = (row[key] == "true" for key in ("refin", "refout"))
    return _crc(data, width=int(row["width"]), **numbers, refin=refin, refout=refout)


def _crc(data: bytes, *, width: int, poly: int, init: int, refin: bool, refout: bool, xorout: int) -> int:
    register, top = init, 1 << width - 1
    for byte in data:
        for index in range(8):
            bit = byte >> (index if refin else 7 - index) & 1
            register = (register << 1) ^ (poly if bool(register & top) != bool(bit) else 0)
            register &= (1 << width) - 1
    if refout:
        register = int(f"{register:0{width}b}"[::-1], 2)
    return register ^ xorout
