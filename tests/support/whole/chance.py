"""Random values, frames with one error, and damaged streams."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice

from tests.support.whole.reference import Raw, Reference
from tests.support.whole.reference.frames import Frame
from tests.support.whole.reference.layouts import (
    Kind,
    Message,
    Number,
    Packed,
    Record,
    Records,
    Run,
    Slot,
    Value,
)
from tests.support.whole.reference.special import Packets
from tests.support.whole.reference.values import (
    Wrong,
    default_record,
    encode,
    holds,
    meets,
    met,
    takes_rest,
)


def mark(reference: Reference) -> int:
    """The byte after which others are inserted; any without stuffing."""
    frame = reference.frame
    if isinstance(frame, Frame) and frame.terminator:
        return frame.terminator.constant[-1]
    return frame.stuffing.after[0] if isinstance(frame, Frame) and frame.stuffing else 0xA5


def request(reference: Reference, message: Message, rng: random.Random) -> bytes:
    """The frame of a request, if the response depends on it."""
    if told := reference.asking(message):
        asked = reference.by_name[rng.choice([*told])]
        given = values(asked, rng, mark(reference))
        return reference.encode(asked.name, given, address(asked, rng))[1]
    if not isinstance(reference.frame, Packets) or message.direction != "response":
        return b""
    asked = reference.by_name[message.name.replace(".response", ".request")]
    return reference.encode(asked.name, values(asked, rng, mark(reference)))[1]


def values(message: Message, rng: random.Random, mark: int) -> dict[str, Raw]:
    """Legal values, often bounds and the stuffed byte."""
    found: dict[str, Raw] = {name: _value(kind, rng, mark) for name, kind in message.beside}
    for name, tests in message.depending:
        if not met(tests, {each: raw for each, raw in found.items() if isinstance(raw, int)}):
            found[name] = dict(message.beside)[name].default
    for attempt in range(12):
        inner = _of_slots(
            message.slots, rng, mark, short=attempt > 1, shortest=attempt > 5, message=message, beside=found
        )
        inner = {name: _between(raw, message.barred) for name, raw in inner.items()}
        try:
            encode(message, found | inner)
        except Wrong:  # records of variable size can be too many together
            continue
        return found | inner
    decided = {name: kind.default for name, kind in message.beside if name in message.decided_by}
    return found | decided | default_record(Record(message.slots))


def _of_slots(
    slots: Sequence[Slot],
    rng: random.Random,
    mark: int,
    *,
    short: bool = False,
    shortest: bool = False,
    message: Message | None = None,
    beside: Mapping[str, Raw] | None = None,
) -> dict[str, Raw]:
    separated = message is not None and bool(message.separator)
    found: dict[str, Raw] = {}
    left_out = False
    for slot in slots:
        known = {**(beside or {}), **found}
        sent = holds(slot, {name: raw for name, raw in known.items() if isinstance(raw, int)})
        if slot.optional:
            left_out = (left_out and not separated) or rng.random() < 0.3
            sent = not left_out
        for name, kind in slot.values():
            found[name] = _value(_shorter(kind, short, shortest), rng, mark) if sent else None
    return found


def _between(raw: Raw, barred: bytes) -> Raw:
    """A text without the bytes that it does not have."""
    if not barred or not isinstance(raw, bytes):
        return raw
    other = next(each for each in b"~0x_" if each not in barred)
    return bytes(other if each in barred else each for each in raw)


def _shorter(kind: Value, short: bool, shortest: bool) -> Value:
    """The same with fewer records, or items, where they may be few."""
    if isinstance(kind, Records) and short:
        most = kind.low if shortest else min(kind.most, kind.low + 1)
        slots = [replace(each, kind=_shorter_slot(each, shortest)) for each in kind.record.slots]
        return replace(kind, high=most, record=Record(tuple(slots)))
    if isinstance(kind, Run) and shortest and not kind.pad:
        return replace(kind, high=kind.low)
    return kind


def _shorter_slot(slot: Slot, shortest: bool) -> Kind:
    return slot.kind if isinstance(slot.kind, Packed) else _shorter(slot.kind, True, shortest)


def _value(kind: Value, rng: random.Random, mark: int) -> Raw:
    if isinstance(kind, Number):
        return _number(kind, rng, mark)
    if isinstance(kind, Record):
        return _record(kind, rng, mark)
    count = rng.choice((kind.low, kind.most, rng.randint(kind.low, kind.most), min(kind.most, kind.low + 2)))
    if isinstance(kind, Records):
        records = [_record(kind.record, rng, mark) for _ in range(count)]
        return _ended(kind, records, rng, mark) if kind.last else _closed(kind, records, rng, mark)
    if kind.item:
        return [_number(kind.item, rng, mark) for _ in range(count)]
    limit = 0x7F if kind.text else 0xFF
    count = rng.randint(0, kind.most) if kind.pad else count
    value = bytes(rng.choice((rng.randint(0, limit), mark & limit, 0, limit)) for _ in range(count))
    if kind.end:
        value = value.replace(kind.end, bytes([kind.end[0] ^ 1]))
    return value.rstrip(kind.pad) if kind.pad else value


def _record(kind: Record, rng: random.Random, mark: int) -> dict[str, Raw]:
    return _of_slots(kind.slots, rng, mark)


def _ended(
    kind: Records, records: list[dict[str, Raw]], rng: random.Random, mark: int
) -> list[dict[str, Raw]]:
    """The records, of which only the last one ends the array; a default record ends it."""
    others: list[dict[str, Raw]] = []
    for record in records[:-1]:
        tries = _tries(kind, record, rng, mark)
        fit = (each for each in tries if not meets(kind, each) and not takes_rest(kind, each))
        others += islice(fit, 1)
    return [*others, records[-1] if meets(kind, records[-1]) else default_record(kind.record)]


def _closed(
    kind: Records, records: list[dict[str, Raw]], rng: random.Random, mark: int
) -> list[dict[str, Raw]]:
    """The records, of which only the last one takes all bytes that are left; a default record does not."""
    others: list[dict[str, Raw]] = []
    for record in records[:-1]:
        tries = chain(_tries(kind, record, rng, mark), [default_record(kind.record)])
        others += islice((each for each in tries if not takes_rest(kind, each)), 1)
    return [*others, *records[-1:]]


def _tries(kind: Records, record: dict[str, Raw], rng: random.Random, mark: int) -> Iterator[dict[str, Raw]]:
    """A record, then others, which are drawn when they are asked for."""
    yield record
    for _ in range(20):
        yield _record(kind.record, rng, mark)


def _number(kind: Number, rng: random.Random, mark: int) -> int:
    if kind.real:
        return _real(kind, rng)
    low, high = kind.low, kind.high
    if kind.without is not None:
        text = bytes(rng.choice((rng.randrange(0x80), mark & 0x7F, 0, 0x7F)) for _ in range(kind.bits // 8))
        return int.from_bytes(bytes(0x41 if each in kind.without else each for each in text), "big")
    number = rng.choice(
        (low, high, rng.randint(low, high), rng.randint(low, high), min(high, max(low, mark)))
    )
    return number & ~kind.forbidden if kind.forbidden else number


def _real(kind: Number, rng: random.Random) -> int:
    """The bits of a legal floating-point number."""
    raws = [
        kind.pattern(each)
        for each in (0.0, -0.0, 1.0, 0.1, -2.5, math.inf, -math.inf, math.nan, *(kind.bounds or ()))
    ]
    raws += [1, kind.pattern(math.inf) - 1, kind.default, *(rng.randint(0, kind.high) for _ in range(4))]
    low, high = kind.bounds or (-math.inf, math.inf)
    legal = [raw for raw in map(kind.told, raws) if kind.bounds is None or low <= kind.number(raw) <= high]
    return rng.choice(legal)


def address(message: Message, rng: random.Random) -> int:
    """A legal address of the message."""
    if not message.addresses:
        return 0
    low, high = rng.choice(message.addresses)
    return rng.choice((low, high, rng.randint(low, high)))


def wrong_frames(
    reference: Reference, message: Message, payload: bytes, wire: bytes, rng: random.Random, *, request: bytes
) -> list[bytes]:
    """Frames with a byte changed, lost or added, and valid frames around wrong payloads."""
    place = rng.choice(message.addresses)[0] if message.addresses else 0
    found = [_spoilt(wire, rng) for _ in range(3)]
    found += [wire[: rng.randrange(len(wire) + 1)], wire + bytes([rng.randrange(256)])]
    for _ in range(4):
        found += wrapped(reference, message, payload, place, rng, request=request)
    return found


def wrapped(
    reference: Reference,
    message: Message,
    payload: bytes,
    place: int,
    rng: random.Random,
    *,
    request: bytes = b"",
) -> list[bytes]:
    """A valid frame around a payload that may be wrong, if a frame can hold it."""
    spoilt = _spoilt(payload, rng)
    return [reference.wrap(message.name, spoilt, place, request)] if fits(reference, spoilt) else []


def fits(reference: Reference, payload: bytes) -> bool:
    """Whether a frame can hold the payload, valid or not."""
    most = getattr(reference.frame, "most", None)
    return most is None or len(payload) <= most


def _spoilt(data: bytes, rng: random.Random) -> bytes:
    spoilt, at = bytearray(data), rng.randrange(len(data) + 1)
    noise = rng.choice((rng.randrange(256), 0, 0xFF, 0x80, 1, rng.choice(b"+-.,;0af")))
    action = rng.choice(("change", "change", "lose", "add"))
    if action == "add" or not data:
        spoilt.insert(at, noise)
    elif action == "lose":
        del spoilt[at : at + rng.choice((1, 1, 2))]
    else:
        spoilt[at % len(data)] = rng.choice((noise, spoilt[at % len(data)] ^ 1 << rng.randrange(8)))
    return bytes(spoilt)


def stream(frames: Sequence[bytes], alphabet: bytes, rng: random.Random) -> bytes:
    """Frames, pieces of them and noise, damaged."""
    data = bytearray()
    for _ in range(rng.randint(1, 6)):
        frame = rng.choice(frames)
        data += rng.choice(
            (frame, frame, frame, frame[: rng.randrange(len(frame) + 1)], _noise(alphabet, rng))
        )
    return damaged(bytes(data), alphabet, rng)


def between(frames: Sequence[bytes], alphabet: bytes, rng: random.Random) -> bytes:
    """What lies between two silences: one frame, usually damaged."""
    return damaged(rng.choice(frames), alphabet, rng)


def damaged(stream: bytes, alphabet: bytes, rng: random.Random) -> bytes:
    """A stream with noise in a few places or none."""
    data = bytearray(stream)
    for _ in range(rng.choice((0, 1, 1, 2, 4))):
        at = rng.randrange(len(data) + 1)
        action = rng.choice(("change", "lose", "double", "add"))
        if action == "add":
            data[at:at] = _noise(alphabet, rng)
        elif action == "change":
            data[at : at + 1] = _noise(alphabet, rng)[:1]
        elif action == "lose":
            del data[at : at + rng.choice((1, 1, 2, 9))]
        else:
            data[at:at] = data[max(0, at - 4) : at]
    return bytes(data)


def _noise(alphabet: bytes, rng: random.Random) -> bytes:
    return bytes(
        rng.choice((rng.randrange(256), rng.choice(alphabet))) for _ in range(rng.choice((1, 1, 2, 5)))
    )


def pieces(data: bytes, rng: random.Random) -> list[bytes]:
    """The data in pieces of any size."""
    cuts = sorted(rng.randrange(len(data) + 1) for _ in range(rng.randint(0, 5)))
    return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]


def smallest(data: bytes, fails: Callable[[bytes], bool], tries: int = 80) -> bytes:
    """The data reduced to the minimum that reproduces a failure."""
    size = max(1, len(data) // 2)
    while size:
        at = 0
        while at < len(data) and tries:
            shorter = data[:at] + data[at + size :]
            tries -= 1
            if fails(shorter):
                data = shorter
            else:
                at += size
        size //= 2
    return data
