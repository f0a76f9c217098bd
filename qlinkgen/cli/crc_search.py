"""Why a check value does not fit: other algorithms, byte orders and coverages, or a single wrong bit."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from qlinkgen.model.checksum import SUMS, Algorithm, Sum, catalogue
from qlinkgen.model.frame import Checksum

#: Answers that are shown at most; further ones are as likely to be coincidences.
SHOWN = 3
#: A check of fewer bits fits by chance too often for wide searches to mean anything.
CHANCE_BITS = 16


@dataclass(frozen=True, slots=True)
class Coverage:
    """Bytes that a check value may have been taken over. ``steps``: how far this is from the schema."""

    data: bytes
    text: str
    steps: int


@dataclass(frozen=True, slots=True)
class Fit:
    """A reading under which the check value is right."""

    text: str
    steps: int


def coverages(
    parts: Mapping[str, bytes], over: Sequence[str], wire: Mapping[str, bytes] | None
) -> list[Coverage]:
    """Every subset of the parts, as they are and as they were sent (stuffed), nearest to the schema first."""
    found: dict[bytes, Coverage] = {}
    forms = [("", parts, 0)] + ([(" with the stuffing", wire, 1)] if wire and wire != parts else [])
    for (suffix, form, extra), size in itertools.product(forms, range(1, len(parts) + 1)):
        for names in itertools.combinations(parts, size):
            steps = len(set(names) ^ set(over)) + extra
            text = ("" if steps == extra else f" over {', '.join(names)}") + suffix
            each = Coverage(b"".join(form[name] for name in names), text, steps)
            if each.data not in found or found[each.data].steps > steps:
                found[each.data] = each
    return sorted(found.values(), key=lambda each: each.steps)


def search(checksum: Checksum, received: int, covers: Sequence[Coverage]) -> list[Fit]:
    """Readings under which the received value fits, the nearest to the schema first."""
    limit = 2 if checksum.algorithm.width >= CHANCE_BITS else 1
    fits = [fit for fit in _fits(checksum, received, covers, limit) if fit.steps]
    nearest = min((fit.steps for fit in fits), default=0)
    return sorted((fit for fit in fits if fit.steps == nearest), key=lambda fit: fit.text)[:SHOWN]


def _fits(checksum: Checksum, received: int, covers: Sequence[Coverage], limit: int) -> Iterator[Fit]:
    algorithms = _algorithms(checksum.algorithm)
    orders = [("", received, 0)]
    if (swapped := _swapped(checksum, received)) != received:
        orders.append((" with its bytes the other way round", swapped, 1))
    for each, algorithm in itertools.product(covers, algorithms):
        steps = each.steps + (algorithm is not algorithms[0])
        if steps > limit:
            continue
        value = algorithm.compute(each.data) & checksum.mask
        for suffix, wanted, extra in orders:
            if value == wanted and steps + extra <= limit:
                yield Fit(f"{algorithm.name}{each.text}{suffix}", steps + extra)


def _algorithms(own: Algorithm | Sum) -> list[Algorithm | Sum]:
    others: list[Algorithm | Sum] = [
        *catalogue(own.width),
        *(each for each in SUMS if each.width == own.width),
    ]
    return [own, *(each for each in others if each.name != own.name)]


def _swapped(checksum: Checksum, value: int) -> int:
    """The value if its wire bytes had come in the opposite order."""
    raw = [(value >> chunk.shift) & chunk.mask for chunk in checksum.chunks]
    pairs = zip(reversed(raw), checksum.chunks, strict=True)
    return sum((byte & chunk.mask) << chunk.shift for byte, chunk in pairs)


def flipped_bit(checksum: Checksum, received: int, data: bytes) -> tuple[int, int] | None:
    """Index of a covered byte, and what it should have been, if one flipped bit explains the difference."""
    if checksum.algorithm.width < CHANCE_BITS:
        return None
    for index, bit in itertools.product(range(len(data)), range(8)):
        repaired = bytearray(data)
        repaired[index] ^= 1 << bit
        if checksum.algorithm.compute(repaired) & checksum.mask == received:
            return index, repaired[index]
    return None


def explain_mismatch(
    checksum: Checksum, received: int, covers: Sequence[Coverage], own: Sequence[tuple[int, int]]
) -> str:
    """The likely cause of a check value that does not fit.

    Args:
        checksum: What the schema says.
        received: The value that came.
        covers: Coverages to try.
        own: The covered bytes, as the schema has it: wire offset and value.
    """
    if fits := search(checksum, received, covers):
        return f"it would fit as {', or as '.join(fit.text for fit in fits)}: the sender may compute it so"
    data = bytes(value for _, value in own)
    expected = checksum.algorithm.compute(data) & checksum.mask
    if (expected ^ received).bit_count() == 1:
        return "one bit of the check value itself was flipped on the wire"
    if flipped := flipped_bit(checksum, received, data):
        index, value = flipped
        return f"one bit was flipped on the wire: {value:02x} at offset {own[index][0]} would fit"
    tried = "algorithm of the catalogue, byte order or coverage near the schema's"
    return f"no {tried} fits: bytes were corrupted on the wire"
