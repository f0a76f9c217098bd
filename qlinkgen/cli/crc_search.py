"""Finds the cause of a wrong check value: other algorithms, byte orders and coverages, or a flipped bit."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence

from qlinkgen._dataclass import dataclass
from qlinkgen.model.checksum import Checksum, of_width
from qlinkgen.plan.check import Check

#: Most matches to show; further ones are probably coincidences.
SHOWN = 3
#: A shorter check value matches by chance too often for a wide search.
CHANCE_BITS = 16


@dataclass(frozen=True, slots=True)
class Coverage:
    """Bytes that a check value may have been taken over. ``steps``: how far this is from the schema."""

    data: bytes
    text: str
    steps: int


@dataclass(frozen=True, slots=True)
class Fit:
    """An algorithm, byte order and coverage for which the check value is correct."""

    text: str
    steps: int


def coverages(
    parts: Mapping[str, bytes], over: Sequence[str], others: Mapping[str, bytes], other: str
) -> list[Coverage]:
    """Return every subset of the parts, nearest to the schema first.

    Args:
        parts: bytes of each part as covered by the schema, with or without stuffing.
        over: names of the parts that the schema covers.
        others: their bytes without or with stuffing, respectively.
        other: text for the latter.
    """
    found: dict[bytes, Coverage] = {}
    forms = [("", parts, 0)] + ([(other, others, 1)] if others != parts else [])
    for (suffix, form, extra), size in itertools.product(forms, range(1, len(parts) + 1)):
        for names in itertools.combinations(parts, size):
            steps = len(set(names) ^ set(over)) + extra
            text = ("" if steps == extra else f" over {', '.join(names)}") + suffix
            each = Coverage(b"".join(form[name] for name in names), text, steps)
            if each.data not in found or found[each.data].steps > steps:
                found[each.data] = each
    return sorted(found.values(), key=lambda each: each.steps)


def search(check: Check, received: int, covers: Sequence[Coverage]) -> list[Fit]:
    """Return the matches of the received value, the nearest to the schema first."""
    limit = 2 if check.algorithm.width >= CHANCE_BITS else 1
    fits = [fit for fit in _fits(check, received, covers, limit) if fit.steps]
    nearest = min((fit.steps for fit in fits), default=0)
    return sorted((fit for fit in fits if fit.steps == nearest), key=lambda fit: fit.text)[:SHOWN]


def _fits(check: Check, received: int, covers: Sequence[Coverage], limit: int) -> Iterator[Fit]:
    algorithms = _algorithms(check.algorithm)
    orders = [("", received, 0)]
    if (swapped := _swapped(check, received)) != received:
        orders.append((" with its bytes swapped", swapped, 1))
    for each, algorithm in itertools.product(covers, algorithms):
        steps = each.steps + (algorithm is not algorithms[0])
        if steps > limit:
            continue
        value = check.sent(algorithm.compute(each.data))
        for suffix, wanted, extra in orders:
            if value == wanted and steps + extra <= limit:
                yield Fit(f"{algorithm.name}{each.text}{suffix}", steps + extra)


def _algorithms(own: Checksum) -> list[Checksum]:
    return [own, *(each for each in of_width(own.width) if each.name != own.name)]


def _swapped(check: Check, value: int) -> int:
    """Return the value with its wire bytes in the opposite order."""
    return check.unpack(check.pack(value)[::-1])


def flipped_bit(check: Check, received: int, data: bytes) -> tuple[int, int] | None:
    """Return index and correct value of a covered byte, if one flipped bit explains the difference."""
    if check.algorithm.width < CHANCE_BITS:
        return None
    for index, bit in itertools.product(range(len(data)), range(8)):
        repaired = bytearray(data)
        repaired[index] ^= 1 << bit
        if check.sent(check.algorithm.compute(repaired)) == received:
            return index, repaired[index]
    return None


def explain_mismatch(
    check: Check, received: int, covers: Sequence[Coverage], own: Sequence[tuple[int, int]]
) -> str:
    """Return the likely cause of a wrong check value.

    Args:
        check: Check value of the schema.
        received: The received value.
        covers: Coverages to try.
        own: The bytes covered by the schema: wire offset and value.
    """
    if fits := search(check, received, covers):
        return f"it matches {', or '.join(fit.text for fit in fits)}: the sender may use that"
    data = bytes(value for _, value in own)
    expected = check.sent(check.algorithm.compute(data))
    if (expected ^ received).bit_count() == 1:
        return "one bit of the check value itself was flipped on the wire"
    if (flipped := flipped_bit(check, received, data)) and own[flipped[0]][0] >= 0:
        index, value = flipped
        return f"one bit was flipped on the wire: {value:02x} at offset {own[index][0]} would match"
    tried = "algorithm of the catalogue, byte order or coverage near the schema's"
    return f"no {tried} matches: bytes were corrupted on the wire"


def explain_sum(check: Check, id_name: str, request: bytes, answer: bytes, received: int) -> str:
    """Return the likely cause of a wrong check value over a request and its response.

    Args:
        check: Check value of the schema.
        id_name: The name of the first byte of the request.
        request: The request packet.
        answer: The payload of the response.
        received: The value that was received.
    """
    start, words = request[0], request[1:]
    expected = check.sent(check.of(words, answer, start=start))
    if check.unpack(check.pack(received)[::-1]) == expected:
        return "its bytes are swapped"
    readings = {
        f"the sum of the words without {id_name}": check.of(words, answer),
        "the sum of only the response's words": check.of(answer),
        "the sum of only the request": check.of(words, start=start),
        "the sum of single bytes": sum(request + answer),
    }
    fitting = [text for text, value in readings.items() if check.sent(value) == received]
    if fitting:
        return f"it matches {fitting[0]}: the device may use that"
    if (received ^ expected).bit_count() == 1:
        return "one bit was flipped on the wire"
    return "bytes were corrupted or lost, or the response belongs to another request"
