"""Check values, bit by bit from the parameters of the catalogue."""

from __future__ import annotations

import csv
import functools
from collections.abc import Iterable, Mapping
from pathlib import Path

#: The only file shared with the product: published parameters, not code.
CATALOGUE = Path(__file__).parents[4] / "qlinkgen" / "model" / "crc_catalogue.csv"


@functools.cache
def catalogue() -> Mapping[str, Mapping[str, str]]:
    """The parameters of CRCs by name."""
    with CATALOGUE.open(newline="") as rows:
        return {row["name"]: row for row in csv.DictReader(rows)}


def width(name: str) -> int:
    """Bits of a check value."""
    return {"sum8": 8, "sum8-inverted": 8, "sum16": 16}.get(name) or int(catalogue()[name]["width"])


def compute(name: str, data: Iterable[int]) -> int:
    """The check value of bytes; sums take numbers of any size."""
    if name.startswith("sum"):
        total = sum(data)
        return (~total if name.endswith("inverted") else total) & (1 << width(name)) - 1
    return _crc(name, bytes(data))


@functools.lru_cache(maxsize=4096)
def _crc(name: str, data: bytes) -> int:
    row, bits = catalogue()[name], width(name)
    poly, register, top = int(row["poly"], 16), int(row["init"], 16), 1 << bits - 1
    low_first = row["refin"] == "true"
    for byte in data:
        for index in range(8):
            bit = byte >> (index if low_first else 7 - index) & 1
            register = (register << 1) ^ (poly if bool(register & top) != bool(bit) else 0)
            register &= (1 << bits) - 1
    if row["refout"] == "true":
        register = int(f"{register:0{bits}b}"[::-1], 2)
    return register ^ int(row["xorout"], 16)
