"""Reproducible random messages as raw values, and random damage to a stream."""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Mapping
from typing import TypeAlias, assert_never

from qlinkgen.model.fields import Layout, Record, Records, Value, applies
from qlinkgen.model.frame import DelimitedFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Array, Blob, Flags, Float, Length, Scalar
from qlinkgen.plan import Plan
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import Unsendable

Raw: TypeAlias = "int | list[int] | bytes | Mapping[str, Raw] | list[Mapping[str, Raw]] | None"


def random_values(message: Message, rng: random.Random) -> list[Raw]:
    """Legal raw values of a message, often bounds."""
    return [_random(value, rng) for value in message.values]


def random_present(values: Iterable[Value], rng: random.Random, *, most: int | None = None) -> dict[str, Raw]:
    """Legal raw values by name; those that are absent are None, of a choice that of its case.

    ``most`` limits the number of records and of bytes, where they may be as few.
    """
    found: dict[str, Raw] = {}
    for value in values:
        sent = applies(value.field.when, found.get)
        if sent or found.get(value.name) is None:
            found[value.name] = _random(value, rng, most) if sent else None
    return found


def random_beside(protocol: Protocol, message: Message, rng: random.Random) -> dict[str, Raw]:
    """Legal raw values of the frame of a message."""
    drawn = {value.name: _random(value, rng) for value in protocol.beside(message)}
    found: dict[str, Raw] = {
        name: int.from_bytes(raw, "big") if isinstance(raw, bytes) else raw for name, raw in drawn.items()
    }
    numbers = {name: raw for name, raw in found.items() if isinstance(raw, int)}
    for part in protocol.frame.conditional if isinstance(protocol.frame, DelimitedFrame) else ():
        if part.role != "length" and not all(test.holds(numbers[test.value]) for test in part.when):
            found |= {bits.name: bits.type.default for bits in part.bits if bits.type}
    return found


def random_address(message: Message, rng: random.Random) -> int:
    """A legal address of the message, 0 if the frame has none."""
    if not message.addresses:
        return 0
    first, last = rng.choice(message.addresses)
    return rng.choice((first, last, rng.randint(first, last)))


def random_frame(plan: Plan, message: Message, rng: random.Random) -> bytes:
    """A frame of legal values, made by the interpreter."""
    for attempt in range(200):
        drawn = random_present(message.values, rng, most=8 if attempt else None)
        values = drawn | random_beside(plan.protocol, message, rng)
        try:
            return Codec(plan).encode(message.name, values, random_address(message, rng))
        except Unsendable:  # records of variable size can be too many together
            continue
    raise AssertionError(f"no {message.name} that fits its frame")


def damaged(stream: bytes, rng: random.Random, alphabet: bytes) -> bytes:
    """The stream with a few bytes changed, lost, duplicated or added."""
    data = bytearray(stream)
    for _ in range(rng.randint(1, 6)):
        at = rng.randrange(len(data) + 1)
        noise = bytes(
            rng.choice((rng.randrange(256), rng.choice(alphabet))) for _ in range(rng.choice((1, 1, 2, 5)))
        )
        action = rng.choice(("change", "lose", "double", "add"))
        if action == "add":
            data[at:at] = noise
        elif action == "change":
            data[at : at + len(noise)] = noise
        elif action == "lose":
            del data[at : at + rng.choice((1, 1, 2, 9))]
        else:
            data[at:at] = data[max(0, at - 4) : at]
    return bytes(data)


def _random(value: Value, rng: random.Random, most: int | None = None) -> Raw:
    kind = value.type
    match kind:
        case Scalar():
            return _number(kind, rng)
        case Array():
            return [_number(kind.item, rng) for _ in range(_size(kind.length, rng, most))]
        case Blob():
            if kind.excluded:  # between separators
                plain = [each for each in range(0x21, 0x7F) if each not in kind.excluded]
                return bytes(rng.choice(plain) for _ in range(_size(kind.length, rng, most)))
            size = rng.randint(0, kind.length.maximum) if kind.pad else _size(kind.length, rng, most)
            data = bytes(
                rng.choice((rng.randrange(256), 0xA5, 0x00, 0xFF, 0xFD)) & (0x7F if kind.text else 0xFF)
                for _ in range(size)
            )
            data = data.replace(kind.terminator, b"_") if kind.terminator else data
            return data.rstrip(kind.pad) if kind.pad else data
        case Record():
            return _record(kind.layout, rng, most)
        case Records():
            records = [_record(kind.layout, rng, most) for _ in range(_size(kind.length, rng, most))]
            closed = [_closed(kind, each, rng, most) for each in records[:-1]] + records[-1:]
            return _ended(kind, closed, rng, most) if kind.last else closed
        case _:
            assert_never(kind)


def _record(layout: Layout, rng: random.Random, most: int | None) -> Mapping[str, Raw]:
    return random_present(layout.values, rng, most=most)


def _closed(
    kind: Records, record: Mapping[str, Raw], rng: random.Random, most: int | None
) -> Mapping[str, Raw]:
    """The record, or another one that leaves bytes for those after it."""
    while kind.layout.takes_rest(record):
        record = _record(kind.layout, rng, most)
    return record


def _ended(
    kind: Records, records: list[Mapping[str, Raw]], rng: random.Random, most: int | None
) -> list[Mapping[str, Raw]]:
    """Records of which the last one alone meets the condition of a last one."""
    for index in range(len(records)):
        final = index == len(records) - 1
        while all(test.holds(_raw(records[index][test.value])) for test in kind.last) != final:
            new = _record(kind.layout, rng, most)
            records[index] = new if final else _closed(kind, new, rng, most)
    return records


def _raw(number: Raw) -> int:
    assert isinstance(number, int)
    return number


def _size(length: Length, rng: random.Random, most: int | None) -> int:
    low, high = length.minimum, length.maximum
    high = high if most is None else max(low, min(high, most))
    return rng.choice((low, high, rng.randint(low, high), min(high, low + rng.randint(0, 4))))


def _number(kind: Scalar, rng: random.Random) -> int:
    if kind.meaning == "bool":
        return rng.randrange(2)
    if isinstance(kind.meaning, Float):
        raw = rng.randint(*rng.choice(kind.meaning.legal))
        return kind.default if math.isnan(kind.physical(raw)) else raw
    low, high = kind.minimum, kind.maximum
    number = rng.choice(
        (low, high, rng.randint(low, high), rng.randint(low, high), min(high, max(low, 0xA5)))
    )
    flags = kind.meaning
    return number & flags.mask if isinstance(flags, Flags) and flags.reserved_zero else number
