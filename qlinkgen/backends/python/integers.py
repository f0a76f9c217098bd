"""Integers in Python: packing, unpacking and conditions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python.layout import slice_of
from qlinkgen.model import naming
from qlinkgen.model.integer import ByteOrder, Chunk, Integer
from qlinkgen.model.scientific import Scientific
from qlinkgen.model.words import Words
from qlinkgen.plan.expr import Clear, Condition, Legible, OneOf, Size, Term, Within
from qlinkgen.plan.payload import CountStep

#: Format letters of struct for integers by size; lower case is signed.
_LETTERS = {1: "B", 2: "H", 4: "I", 8: "Q"}


@dataclass(frozen=True)
class Get:
    """The code that unpacks an integer.

    Attributes:
        code: format of its bytes.
        targets: variables that the struct is unpacked to; ``local`` is the number itself.
        terms: terms of the number over the targets, () if the only target is the number.
        stray: targets that must not exceed a mask.
    """

    code: str
    targets: tuple[str, ...]
    terms: tuple[str, ...] = ()
    stray: tuple[tuple[tuple[str, ...], int], ...] = ()


def letter(integer: Integer, byteorder: ByteOrder) -> str:
    """The format letter, "" if struct has none for this integer in this byte order."""
    known = _LETTERS.get(integer.size, "")
    if (
        not known
        or integer.bcd
        or integer.text
        or integer.byteorder is None
        or (integer.size > 1 and integer.byteorder != byteorder)
    ):
        return ""
    return known.lower() if integer.signed else known


def put(integer: Integer, number: str, byteorder: ByteOrder) -> tuple[str, tuple[str, ...]]:
    """Format and arguments that pack a number, which must be a plain name because groups repeat it."""
    if code := letter(integer, byteorder):
        return code, (number,)
    if integer.text or integer.byteorder is not None:
        return f"{integer.size}s", (to_bytes(integer, number),)
    return "B" * integer.size, tuple(group_out(number, chunk) for chunk in integer.chunks)


def to_bytes(integer: Integer, number: str) -> str:
    """The bytes of an integer; raises OverflowError if it does not fit. ``number`` must be a primary."""
    if integer.text:
        return text_of(integer, number)
    if integer.bcd:
        back = "[::-1]" if integer.byteorder == "little" else ""
        return f'bytes.fromhex(f"{{{number}:0{2 * integer.size}d}}"){back}'
    return f'{number}.to_bytes({integer.size}, "{integer.byteorder}"{_signed(integer)})'


def words_of(words: Words) -> str:
    """Name of the table of the words of an enum."""
    return f"_WORDS_{naming.upper(words.enum)}"


def numbers_of(words: Words) -> str:
    """Name of the table of the numbers of these words."""
    return f"_NUMBERS_{naming.upper(words.enum)}"


def text_of(integer: Integer, number: str) -> str:
    """The text of a number."""
    text = integer.text
    assert text is not None
    if isinstance(text, Words):
        return f"{words_of(text)}[{number}]"
    assert not isinstance(text, Scientific)  # floats, not integers, are written
    if text.point and text.spaced:
        return f"decimal({number}, 1, {text.point}).rjust({text.least})"
    if text.point and integer.minimum < 0:
        return f"decimal({number}, {text.least}, {text.point})"
    if text.point:
        whole = _width(text.least - text.point - 1)
        return f'b"%{whole}d.%{_width(text.point)}d" % divmod({number}, {10**text.point})'
    if text.spaced:
        return f'b"%{text.least if text.least > 1 else ""}d" % {number}'
    letter = "d" if text.base == 10 else "X"
    return f'b"%{_width(text.least)}{letter}" % {number}'


def _width(least: int) -> str:
    """The width of a format with at least so many digits."""
    return f"0{least}" if least > 1 else ""


def number_in(integer: Integer, text: str) -> str:
    """The number of a text, or one above the maximum of the integer; of digits alone, the number."""
    assert integer.text
    if isinstance(integer.text, Words):
        text = f"{text}.upper()" if integer.text.folded else text
        return f"{numbers_of(integer.text)}.get({text}, {integer.maximum + 1})"
    assert not isinstance(integer.text, Scientific)  # floats, not integers, are read
    if integer.text.plain:  # its digits have been checked
        return f"int({text})" if integer.text.base == 10 else f"int({text}, 16)"
    text = f'{text}.lstrip(b" ")' if integer.text.spaced else text
    if integer.text.base == 16:
        return f"read_hexadecimal({text}, {integer.maximum})"
    return f"read_decimal({text}, {integer.text.point}, {integer.minimum}, {integer.maximum})"


def digits(integer: Integer, data: str) -> str:
    """The digits of a byte string in binary-coded decimal; letters among them are illegal."""
    return f"{data}[::-1].hex()" if integer.byteorder == "little" else f"{data}.hex()"


def from_bytes(integer: Integer, data: str) -> str:
    """The integer of a byte string."""
    if integer.text:
        return number_in(integer, data)
    if integer.bcd:
        return f"int({digits(integer, data)})"
    return f'int.from_bytes({data}, "{integer.byteorder}"{_signed(integer)})'


def _signed(integer: Integer) -> str:
    return ", signed=True" if integer.signed else ""


def get(integer: Integer, local: str, byteorder: ByteOrder) -> Get:
    """The code that unpacks a number; names of its variables begin with ``local``."""
    if code := letter(integer, byteorder):
        return Get(code, (local,))
    if integer.text or integer.byteorder is not None:
        return Get(f"{integer.size}s", (local,), (from_bytes(integer, local),))
    targets = tuple(f"{local}_{index}" for index in range(integer.size))
    return Get("B" * integer.size, targets, group_terms(integer, targets), stray(integer, targets))


def read(integer: Integer, data: str, at: Callable[[int], str]) -> str:
    """The integer at an offset; ``at`` prints the offset plus a number of bytes.

    Too few bytes result in a wrong number or an IndexError.
    """
    if integer.size == 1 and not integer.text:
        return f"{data}[{at(0)}]"
    if integer.text or integer.byteorder is not None:
        return from_bytes(integer, slice_of(data, at(0), at(integer.size)))
    sources = tuple(f"{data}[{at(index)}]" for index in range(integer.size))
    return " | ".join(group_terms(integer, own_bits(integer, sources)))


def index_of(base: str, place: int) -> str:
    """The index of a place after a base, "" for the beginning of the data."""
    return plus(base, place) if base else str(place)


def read_bytewise(integer: Integer, data: str, start: int, base: str = "") -> str:
    """The same for two or three bytes, which is faster; an IndexError if there are too few."""
    if not _joins(integer) or integer.byteorder is None:
        return read(integer, data, lambda more: index_of(base, start + more))
    return joined(data, range(start, start + integer.size), integer.byteorder, base)


def is_sliced(integer: Integer) -> bool:
    """Whether `read_bytewise` takes a slice, so that too few bytes result in a wrong number."""
    return not (integer.size == 1 or integer.byteorder is None or _joins(integer))


def _joins(integer: Integer) -> bool:
    """Whether the bytes of an integer that is not in groups are read one by one."""
    return integer.size in {2, 3} and not (integer.signed or integer.bcd)


def joined(data: str, places: range, byteorder: str, base: str = "") -> str:
    """The number in bytes at these places."""
    terms = [
        f"{data}[{index_of(base, place)}]{f' << {8 * index}' if index else ''}"
        for index, place in enumerate(places if byteorder == "little" else reversed(places))
    ]
    return " | ".join(terms)


def own_bits(integer: Integer, sources: Sequence[str]) -> tuple[str, ...]:
    """The sources with unused bits masked out."""
    pairs = zip(sources, integer.chunks, strict=True)
    return tuple(f"({source} & 0x{chunk.mask:02X})" if chunk.bits < 8 else source for source, chunk in pairs)


def stray(integer: Integer, sources: Sequence[str]) -> tuple[tuple[tuple[str, ...], int], ...]:
    """Sources grouped by the mask that they exceed if unused bits are set."""
    by_mask: dict[int, list[str]] = {}
    for source, chunk in zip(sources, integer.chunks, strict=True):
        if chunk.bits < 8:
            by_mask.setdefault(chunk.mask, []).append(source)
    return tuple((tuple(group), mask) for mask, group in by_mask.items())


def group_terms(integer: Integer, sources: Sequence[str]) -> tuple[str, ...]:
    """The groups of an integer, each shifted into place; the caller masks unused bits."""
    pairs = zip(sources, integer.chunks, strict=True)
    return tuple(f"{source} << {chunk.shift}" if chunk.shift else source for source, chunk in pairs)


def bits_of(integer: Integer, whole: str, shift: int, bits: int) -> str:
    """Some bits of an integer, which is an expression."""
    if bits == integer.bits and not integer.signed:
        return whole
    primary = f"({whole})" if " | " in whole else whole
    shifted = f"{primary} >> {shift}" if shift else primary
    highest = shift + bits == integer.bits == 8 * integer.size and not integer.signed
    return shifted if highest else f"{shifted} & 0x{(1 << bits) - 1:X}"


def sign_extended(number: str, bits: int) -> str:
    """The two's complement of a number of ``bits`` bits; ``number`` must be a primary."""
    sign = f"0x{1 << (bits - 1):X}"
    return f"({number} ^ {sign}) - {sign}"


def group_out(number: str, chunk: Chunk) -> str:
    """The bits of a chunk."""
    shifted = f"{number} >> {chunk.shift}" if chunk.shift else number
    return f"{shifted} & 0x{chunk.mask:02X}"


# Conditions and sizes


def holds(condition: Condition, number: str) -> str:
    """The expression that is true if a condition holds."""
    match condition:
        case Within() if condition.low == condition.high:
            return f"{number} == {condition.low}"
        case Within():
            return f"{condition.low} <= {number} <= {condition.high}"
        case Clear():
            return f"{number} & 0x{condition.mask:X} == 0"
        case OneOf():
            terms = [holds(each, number) for each in condition.ranges]
            return f"({' or '.join(terms)})" if len(terms) > 1 else terms[0]
        case Legible():
            raise AssertionError("the characters of a text are compared, not its number")
        case _:
            assert_never(condition)


def broken(condition: Condition, number: str) -> str:
    """The expression that is true if a condition does not hold."""
    match condition:
        case Within() if condition.low == condition.high:
            return f"{number} != {condition.low}"
        case Clear():
            return f"{number} & 0x{condition.mask:X}"
        case OneOf(ranges=(only,)):
            return broken(only, number)
        case Within() | OneOf():
            return f"not {holds(condition, number)}"
        case Legible():
            raise AssertionError("the characters of a text are compared, not its number")
        case _:
            assert_never(condition)


def size_terms(size: Size) -> list[str]:
    """The terms of a size over the local variables of counts."""
    terms = [str(size.fixed)] if size.fixed or not size.terms else []
    return [*terms, *map(term_text, size.terms)]


def term_text(term: Term) -> str:
    """The size of a run over the local variable of its count."""
    count = f"{term.run}_count"
    product = f"{term.factor} * {count}" if term.factor > 1 else count
    product = f"({product} + 7) // 8" if term.packed else product
    return plus(product, term.more)


def plus(number: str, more: int) -> str:
    """A number plus a constant."""
    return f"{number} {'+' if more > 0 else '-'} {abs(more)}" if more else number


def count_text(step: CountStep) -> str:
    """What a count tells over the local variables of its run."""
    if not step.sized:
        return term_text(step.term)
    size = bytes_of(step.run)
    return f"{size} + {step.term.more}" if step.term.more else size


def own_bytes(term: Term, number: str) -> str:
    """What a count says without the bytes that it counts beside the run."""
    number = f"({number})" if term.more and " | " in number else number
    return plus(number, -term.more)


def items_text(term: Term, size: str) -> str:
    """The number of items of a row in so many bytes."""
    times, by = term.per_byte
    size = own_bytes(term, size)
    number = f"({size})" if " " in size else size
    return f"{number}{f' * {times}' if times > 1 else ''}{f' // {by}' if by > 1 else ''}"


def size_text(size: Size) -> str:
    """A size as an expression."""
    return " + ".join(size_terms(size))


def bytes_of(name: str) -> str:
    """The local with the number of bytes of a choice, a row or records; `as_bytes` is a function."""
    return f"{name}_bytes" if name != "as" else "as__bytes"
