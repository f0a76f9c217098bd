"""Checks that the terminator of a frame cannot occur before it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import assert_never

from qlinkgen.model.coding import ALL_BYTES, Alphabet
from qlinkgen.model.fields import Field, Record, Records
from qlinkgen.model.frame import DelimitedFrame, Frame, FrameKinds, Part, PartBits
from qlinkgen.model.message import Message
from qlinkgen.model.types import Array, Bits, Blob, Characters, Chunk, Constant, Reserved, Scalar
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path


def check_terminator_part(frame: DelimitedFrame, path: Path, report: Reporter) -> None:
    """Check the place of a terminator, and what a shared one needs."""
    end = frame.part("terminator")
    if end is None:
        return
    place = (*path, end.name)
    names = [part.name for part in frame.parts]
    if names.index(end.name) < names.index(frame.payload.name):
        what = f"{end.name} precedes the payload"
        report.error("bad-frame", place, what, "move it after the payload", of_key=True)
    if not end.shared:
        return
    if frame.parts[0].constant != end.constant:
        what = f"{end.name} cannot begin a frame: frames do not begin with {end.constant.hex(' ').upper()}"
        hint = "let the frame begin with a constant of the same bytes, or remove shared"
        report.error("bad-frame", (*place, "shared"), what, hint, of_key=True, needs=(place,))
    elif frame.parts[-1] is not end:
        what = f"{end.name} cannot begin the next frame: {frame.parts[-1].name} follows it"
        hint = f"move {frame.parts[-1].name} before it, or remove shared"
        report.error("bad-frame", (*place, "shared"), what, hint, of_key=True, needs=(place,))


def check_terminator(frame: Frame | None, messages: Sequence[Message], report: Reporter) -> None:
    """Check that some byte of the terminator does not occur between the first part and it."""
    if report.failed:
        return
    if isinstance(frame, FrameKinds):
        for kind in frame.kinds:
            carried = [each for each in messages if kind in frame.carrying(each.id)]
            if kind.frame.part("terminator"):
                _check_way(kind.frame, carried, ("frames", kind.name, "parts"), report)
    if not isinstance(frame, DelimitedFrame) or frame.part("terminator") is None:
        return
    for way in frame.ways:
        sent = [each for each in messages if not frame.directed or each.direction == way]
        _check_way(frame.towards(way), sent, ("frame", "parts"), report)


def _check_way(frame: DelimitedFrame, messages: Sequence[Message], path: Path, report: Reporter) -> None:
    end = frame.part("terminator")
    assert end is not None
    inner = frame.parts[: frame.parts.index(end)]
    if inner[0].role == "constant":
        inner = inner[1:]
    plain = {part.name: _bytes_of(part, frame, messages) for part in inner}
    coded = _joined(found for name, found in plain.items() if name in frame.coded)
    for coding in frame.coding:
        coded = coding.alphabet(coded)
    sent = coded | _joined(found for name, found in plain.items() if name not in frame.coded)
    if frame.paired is not None or not sent.issuperset(end.constant):
        return
    held = [name for name, found in plain.items() if found & {*end.constant}]
    culprits = ["coded bytes"] if frame.coding else held
    what = f"{end.constant.hex(' ').upper()}, which ends a frame, can occur in {culprits[-1]}"
    hint = "add a coding such as {escape: 7D, xor: 20, of: [7E, 7D]}, or limit what the parts can hold"
    report.error("terminator-in-frame", (*path, end.name), what, hint, of_key=True, needs=(path[:1],))


def _joined(alphabets: Iterable[Alphabet]) -> Alphabet:
    return frozenset().union(*alphabets)


def _bytes_of(part: Part, frame: DelimitedFrame, messages: Sequence[Message]) -> Alphabet:
    """The bytes that can occur in a part of a valid frame."""
    match part.role:
        case "constant" | "terminator":
            return frozenset(part.constant)
        case "payload":
            separators = _joined(frozenset(message.separator) for message in messages)
            return separators | _joined(bytes_in(field) for message in messages for field in message.fields)
        case "checksum":
            assert part.checksum is not None
            if part.checksum.base:
                return frozenset(b"0123456789" if part.checksum.base == 10 else b"0123456789ABCDEFabcdef")
            return _joined(frozenset(range(chunk.mask + 1)) for chunk in part.checksum.chunks)
        case "length":
            assert part.scalar is not None
            bias, step = frame.length_bias, frame.length_scale
            ranges = [((bias + low) // step, (bias + high) // step) for low, high in _sizes(messages)]
            return _joined(
                values_of(chunk, low, high) for low, high in ranges for chunk in part.scalar.chunks
            )
        case "message" | "address" | "bits":
            assert part.scalar is not None
            if part.scalar.text:
                return part.scalar.text.alphabet
            return _joined(_bytes_of_pieces(part, chunk, messages) for chunk in part.scalar.chunks)
        case "derived":
            return ALL_BYTES
        case _:
            assert_never(part.role)


def _sizes(messages: Sequence[Message]) -> Iterator[tuple[int, int]]:
    """The sizes of payloads."""
    for message in messages:
        yield 0 if message.empty_is_default else message.min_size, message.max_size


def _bytes_of_pieces(part: Part, chunk: Chunk, messages: Sequence[Message]) -> Alphabet:
    """The values of a wire byte of a part whose bits have roles."""
    found: set[int] = {0}
    for bits in part.bits:
        own = {
            (number >> bits.at << bits.shift & bits.mask) >> chunk.shift & chunk.mask
            for number in _numbers(bits, chunk, messages)
        }
        found = {one | other for one in found for other in own}
    return frozenset(found)


def _numbers(bits: PartBits, chunk: Chunk, messages: Sequence[Message]) -> Iterable[int]:
    """Numbers that bits can have, enough for every value of a wire byte."""
    if bits.is_id:
        return {message.id for message in messages}
    if bits.role == "constant":
        return bits.constants
    if bits.type is not None and isinstance(text := bits.type.meaning, Characters):
        return {each << chunk.shift for each in range(0x80) if each not in text.excluded}
    ranges = [each for message in messages for each in message.addresses]
    if bits.type is not None:
        ranges = [(bits.type.minimum, bits.type.maximum)]
    # Of each range, a number for every value of the bits in this byte.
    step = 1 << max(0, chunk.shift - bits.shift)
    return {
        min(number, high) & (1 << bits.bits) - 1
        for low, high in ranges
        for number in range(low, min(high, low + 0x100 * step) + step, step)
    }


def values_of(chunk: Chunk, low: int, high: int) -> Alphabet:
    """The values of a wire byte that carries some bits of a number from low to high."""
    first, last = low >> chunk.shift, high >> chunk.shift
    if last - first >= chunk.mask:
        return frozenset(range(chunk.mask + 1))
    return frozenset(value & chunk.mask for value in range(first, last + 1))


def bytes_in(field: Field) -> Alphabet:
    """The bytes that can occur in a field of a valid message."""
    kind = field.type
    match kind:
        case Blob():
            return frozenset(range(0x80)) - {*kind.excluded} | {*kind.terminator} if kind.text else ALL_BYTES
        case Array():
            return ALL_BYTES if kind.packed else _bytes_of_number(kind.item)
        case Bits():
            return _joined(_bytes_of_bits(kind, chunk) for chunk in kind.container.chunks)
        case Scalar():
            return _bytes_of_number(kind)
        case Record() | Records():
            return _joined(map(bytes_in, kind.layout.fields))
        case _:
            assert_never(kind)


def _bytes_of_number(number: Scalar) -> Alphabet:
    if isinstance(number.role, Constant):
        return _joined(_bytes_between(number, each, each) for each in (number.default, *number.role.accepted))
    low, high = number.minimum, number.maximum
    # A receiver ignores reserved bytes, so another sender may fill them.
    if isinstance(number.role, Reserved):
        low, high = number.natural_minimum, number.natural_maximum
    return _bytes_between(number, low, high)


def _bytes_between(number: Scalar, low: int, high: int) -> Alphabet:
    if number.text:
        return number.text.alphabet
    if number.bcd:
        low, high = int(str(low), 16), int(str(high), 16)
    return _joined(values_of(chunk, low, high) for chunk in number.chunks)


def _bytes_of_bits(kind: Bits, chunk: Chunk) -> Alphabet:
    """Values of a byte whose other bits are sent as 0."""
    used = sum(member.mask for member in kind.members) >> chunk.shift & chunk.mask
    return frozenset(value for value in range(chunk.mask + 1) if not value & ~used)
