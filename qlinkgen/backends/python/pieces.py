"""Message numbers and addresses in the bits of parts, as expressions."""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen.backends.python import integers
from qlinkgen.backends.python.layout import in_hex, literal, slice_of
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.parts import AddressPart, Bits, CellPart, ConstantPart, EqualPart, Numeric, Part

#: A frame that begins anywhere in a buffer, as the source and base of these functions.
BUFFER = ("buf", "start")


def number(
    envelope: Envelope, pieces: tuple[Bits, ...], source: str, base: str = "", skipped: int = 0
) -> str:
    """The number or address in these pieces of a frame; "0" without pieces. Arguments as for `read`."""
    terms = [
        _piece(bits, read(envelope, bits.part, source, base, skipped), alone=len(pieces) == 1)
        for bits in pieces
    ]
    return " | ".join(terms) or "0"


def _piece(bits: Bits, whole: str, *, alone: bool) -> str:
    if not bits.whole:
        whole = integers.bits_of(bits.part.integer, whole, bits.shift, bits.mask.bit_length())
        whole = whole if alone else f"({whole})"
    return f"{whole} << {bits.at}" if bits.at else whole


def read(envelope: Envelope, part: Numeric, source: str, base: str = "", skipped: int = 0) -> str:
    """The integer of a part of a frame, or of its header if the part precedes the payload.

    The frame without its first ``skipped`` bytes begins at ``base``, or at the beginning of the source.
    """
    if part in envelope.front:
        start = envelope.offset(part) - skipped
        return integers.read(part.integer, source, lambda more: integers.index_of(base, start + more))
    start = -envelope.from_end(part)
    return integers.read(part.integer, source, lambda more: str(start + more) if start + more else "")


def wrong(envelope: Envelope, part: Part, source: str, base: str = "") -> Iterator[str]:
    """Conditions that hold if a constant, a derived number or a digit in an integer is wrong."""
    match part:
        case AddressPart() if part.digits:
            legal = literal(bytes(sorted(part.digits.alphabet)))
            first = envelope.offset(part) if part in envelope.front else -envelope.from_end(part)
            for at in range(first, first + part.size):
                yield f"{source}[{integers.index_of(base, at)}] not in {legal}"
        case CellPart():
            for slot in part.constants:
                seen = read(envelope, part, source, base)
                seen = integers.bits_of(part.integer, seen, slot.shift, slot.bits)
                right = ", ".join(f"0x{value:02X}" for value in slot.values)
                yield f"{seen} not in ({right})" if len(slot.values) > 1 else f"{seen} != {right}"
        case EqualPart():
            other = read(envelope, part.of, source, base)
            yield f"{read(envelope, part, source, base)} != {derived_part(part, other)}"
        case _:
            pass


def tail_tests(envelope: Envelope, part: Part) -> Iterator[str]:
    """Conditions that hold if a part after the payload is wrong."""
    if isinstance(part, ConstantPart):
        start = -envelope.from_end(part)
        yield differs(part.data, "frame", str(start), str(start + part.size or ""))
    yield from wrong(envelope, part, "frame")


def differs(data: bytes, source: str, start: str, end: str) -> str:
    """Whether other bytes are between two indexes; true or an IndexError if none are."""
    if len(data) == 1:  # numbers are compared faster
        return f"{source}[{start}] != {in_hex(data[0])}"
    return f"{slice_of(source, start, end)} != {literal(data)}"


def derived_part(part: EqualPart, other: str) -> str:
    """The value of a derived part."""
    return derived(other, inverted=part.inverted, added=part.added, mask=part.integer.mask)


def derived(other: str, *, inverted: bool, added: int, mask: int) -> str:
    """The value of a number derived from another one."""
    if not inverted and not added:
        return other
    primary = other if other.isidentifier() or other.endswith("]") or other.isdecimal() else f"({other})"
    value = f"~{primary}" if inverted else primary
    value += f" {'+' if added > 0 else '-'} {abs(added)}" if added else ""
    return f"({value if inverted and not added else f'({value})'} & 0x{mask:X})"
