"""Wire layouts of integers: a pair of functions for each layout of a protocol."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.crc import field_check
from qlinkgen.backends.c.forms import Helper, decimal_helpers, row_helpers, wide_helpers
from qlinkgen.backends.c.names import storage, unsigned, unsigned_type
from qlinkgen.backends.c.text_forms import REAL, Verb, form_of, needed_with, text_helpers
from qlinkgen.backends.c.words import word_helpers
from qlinkgen.model.checksum import Checksum
from qlinkgen.model.digits import Digits
from qlinkgen.model.integer import BitOrder, Chunk, Integer, TextForm
from qlinkgen.model.scientific import Scientific
from qlinkgen.model.types import Scalar
from qlinkgen.model.words import Words

Chunks = tuple[Chunk, ...]
#: An integer with a wire layout: the Integer of a frame part, or the Scalar of a field.
AnyInteger = Integer | Scalar


@dataclass
class Layouts:
    """Collects the layouts in use, and prints the calls that read and write."""

    prefix: str
    #: Prefix of the functions and the struct of each record.
    records: Mapping[str, str] = field(default_factory=dict)
    _names: dict[tuple[int, Chunks], str] = field(default_factory=dict)
    _partial: set[tuple[int, Chunks]] = field(default_factory=set)
    _used: set[tuple[str, int, Chunks]] = field(default_factory=set)
    #: Functions of numbers of more than 64 bits, and the order.
    _wides: set[tuple[str, str]] = field(default_factory=set)
    #: Numbers in binary-coded decimal that are read, written or checked: width of the C type, and the order.
    _decimals: set[tuple[str, int, str]] = field(default_factory=set)
    #: Numbers as text that are read or written: the base, and the function.
    _texts: set[tuple[int, Verb]] = field(default_factory=set)
    #: Words that are read or written, and the function.
    _words: set[tuple[Words, Verb]] = field(default_factory=set)
    #: Rows of bits that are read or written: the width of the C type of an item, and the order.
    _rows: set[tuple[str, int, BitOrder]] = field(default_factory=set)
    #: Algorithms of check values in payloads.
    checks: list[Checksum] = field(default_factory=list)
    #: Widths of the C types that need sign extension.
    extended: set[int] = field(default_factory=set)

    def check(self, algorithm: Checksum) -> str:
        """What the names of the functions of an algorithm of check values in payloads begin with."""
        if algorithm not in self.checks:
            self.checks.append(algorithm)
        return f"{self.prefix}_{field_check(self.checks.index(algorithm) + 1)}"

    def put(self, integer: AnyInteger, place: str, index: str, value: str) -> str:
        """A statement that writes an unsigned value."""
        if integer.bits > 64:
            return f"{self._wide('put', integer)}({pointer(place, index)}, {integer.size}U, {value});"
        if integer.bcd:
            return f"{self._decimal('put', integer)}({pointer(place, index)}, {integer.size}U, {value});"
        if integer.text:
            given = pointer(place, index), f"{integer.size}U", value
            return f"{self.text('put', integer, integer.text, *given)};"
        if integer.size == 1:
            if integer.signed and integer.bits < 8:  # clear the sign extension
                value = f"(uint8_t)({value} & {unsigned(integer.chunks[0].mask, 8, hexadecimal=True)})"
            return f"{place}[{index}] = {value};"
        return f"{self._call('put', integer)}({pointer(place, index)}, {value});"

    def get(self, integer: AnyInteger, place: str, index: str) -> str:
        """An expression for the unsigned value at a place whose unused bits are known to be zero."""
        if integer.bits > 64:
            return f"{self._wide('get', integer)}({pointer(place, index)}, {integer.size}U)"
        if integer.bcd:
            return f"{self._decimal('get', integer)}({pointer(place, index)}, {integer.size}U)"
        if integer.text:
            return self.read(integer, integer.text, pointer(place, index), f"{integer.size}U")
        if integer.size == 1:
            return f"{place}[{index}]"
        return f"{self._call('get', integer)}({pointer(place, index)})"

    def peek(self, integer: AnyInteger, place: str, index: str) -> str:
        """An expression for the unsigned value at a place, unused bits masked out."""
        assert not integer.bcd
        value, mask = self.get(integer, place, index), integer.chunks[0].mask
        if integer.size > 1 or mask == 0xFF:
            return value
        return f"({value} & {unsigned(mask, 8, hexadecimal=True)})"

    def unused_bits(self, integer: AnyInteger, place: str, index: str) -> str | None:
        """A condition that holds where unused bits are set, None if all bits are used."""
        if integer.bcd:
            self._decimals.add(("check", 8, ""))
            return f"!{self.prefix}_is_bcd_({pointer(place, index)}, {integer.size}U)"
        if integer.text:
            return self.wrong(integer, integer.text, pointer(place, index), f"{integer.size}U")
        if all(chunk.bits == 8 for chunk in integer.chunks):
            return None
        if integer.size == 1:
            return (
                f"({place}[{index}] & {unsigned(integer.chunks[0].mask ^ 0xFF, 8, hexadecimal=True)}) != 0U"
            )
        self._partial.add((integer.bits, integer.chunks))
        return f"{self._call('unused_bits', integer)}({pointer(place, index)})"

    def text(self, verb: Verb, integer: AnyInteger, text: TextForm, *given: str) -> str:
        """A call that writes a number as text: to a place, its size, the value; or its size: the value."""
        if isinstance(text, Words):
            self._words.add((text, verb))
            place = given[:1] if verb == "put" else ()
            return f"{self.prefix}_{verb}_word_{text.enum}_({', '.join([*place, given[-1]])})"
        if isinstance(text, Scientific):
            self._texts |= needed_with(REAL, verb)
            wide = given[-1] if text.bits == 64 else f"(uint64_t){given[-1]}"
            return f"{self.prefix}_{verb}_real_({', '.join([*given[:-1], wide, _width(text)])})"
        key, form = form_of(text) if verb != "size" else (text.base, "hex" if text.base == 16 else "decimal")
        self._texts |= needed_with(key, verb)
        name = f"{self.prefix}_{verb}_{form}_"
        *others, value = given
        others += [f"{text.least}U", f"{text.most}U"] if verb == "size" else []
        wide = f"(uint64_t){value}" if storage(integer.bits) < 64 else value
        if text.base == 16:
            return f"{name}({', '.join([*others, wide])})"
        if integer.signed and integer.bits != storage(integer.bits):
            wide = f"({wide} & {unsigned((1 << integer.bits) - 1, 64, hexadecimal=True)})"
        sign = unsigned(1 << (integer.bits - 1) if integer.signed else 0, 64, hexadecimal=integer.signed)
        return f"{name}({', '.join([*others, f'{text.point}U', wide, sign])})"

    def read(self, integer: AnyInteger, text: TextForm, place: str, size: str) -> str:
        """An expression for the unsigned value of a text."""
        if isinstance(text, Words):
            return self._word(text, place, size)
        if isinstance(text, Scientific):
            self._texts |= needed_with(REAL, "get")
            call = f"{self.prefix}_get_real_({place}, {size}, {_width(text)})"
            return call if text.bits == 64 else f"(uint32_t){call}"
        call = self._text_call("get", integer, text, place, size)
        if integer.signed and integer.bits != storage(integer.bits):
            call = f"({call} & {unsigned((1 << integer.bits) - 1, 64, hexadecimal=True)})"
        return call if storage(integer.bits) == 64 else f"({unsigned_type(integer.bits)}){call}"

    def wrong(self, integer: AnyInteger, text: TextForm, place: str, size: str) -> str:
        """A condition that holds where a text is not a number that the integer can hold."""
        if isinstance(text, Words):
            return f"{self._word(text, place, size)} > {text.highest}U"
        if isinstance(text, Scientific):
            self._texts |= needed_with(REAL, "get")
            return f"!{self.prefix}_is_real_({place}, {size}, {_width(text)})"
        return f"!{self._text_call('is', integer, text, place, size)}"

    def _word(self, words: Words, place: str, size: str) -> str:
        self._words.add((words, "get"))
        return f"{self.prefix}_get_word_{words.enum}_({place}, {size})"

    def cells(self) -> str:
        """The prefix of the functions that divide texts at separators."""
        self._texts.add((0, "get"))
        return self.prefix

    def has_octet(self, text: str, size: str, octet: int) -> str:
        """A condition that holds where a text has a byte."""
        return f"({self.cells()}_text_size_({text}, {size}, {unsigned(octet, 8, hexadecimal=True)}) < {size})"

    def _text_call(self, verb: str, integer: AnyInteger, text: Digits, place: str, size: str) -> str:
        key, form = form_of(text)
        self._texts |= needed_with(key, "get")
        wire = integer.integer if isinstance(integer, Scalar) else integer
        most = unsigned(wire.maximum, 64)
        if text.base == 16:
            return f"{self.prefix}_{verb}_{form}_({place}, {size}, {most})"
        limits = f"{text.point}U, {unsigned(-wire.minimum, 64)}, {most}"
        return f"{self.prefix}_{verb}_{form}_({place}, {size}, {limits})"

    def _decimal(self, verb: str, integer: AnyInteger) -> str:
        width, order = storage(integer.bits), "be" if integer.byteorder == "big" else "le"
        self._decimals.add((verb, width, order))
        return f"{self.prefix}_{verb}_bcd{width}_{order}_"

    def _wide(self, verb: str, integer: AnyInteger) -> str:
        order = "be" if integer.byteorder == "big" else "le"
        self._wides.add((verb, order))
        return f"{self.prefix}_{verb}_wide_{order}_"

    def extend_wide(self, raw: str, bits: int) -> str:
        """An expression that sign-extends a number of ``bits`` bits, more than 64."""
        self._wides.add(("extend", ""))
        return f"{self.prefix}_extend_wide_({raw}, {unsigned(1 << (bits - 65), 64, hexadecimal=True)})"

    def get_row(self, item: Integer, order: BitOrder, start: str, index: str) -> str:
        """An expression for the unsigned value of an item in a row of bits."""
        width = storage(item.bits)
        self._rows.add(("get", width, order))
        return f"{self.prefix}_get_row_{order}_{width}_({start}, {_times(item.bits, index)}, {item.bits}U)"

    def put_row(self, item: Integer, order: BitOrder, start: str, index: str, value: str) -> str:
        """A statement that sets the bits of an item in a row of zero bits."""
        width = storage(item.bits)
        self._rows.add(("put", width, order))
        at = _times(item.bits, index)
        return f"{self.prefix}_put_row_{order}_{width}_({start}, {at}, {item.bits}U, {value});"

    def extend(self, raw: str, bits: int) -> str:
        """An expression that sign-extends a number of ``bits`` bits."""
        width = storage(bits)
        self.extended.add(width)
        sign = unsigned(1 << (bits - 1), bits, hexadecimal=True)
        return f"{self.prefix}_extend_{width}_({raw}, {sign})"

    def helpers(self) -> list[Helper]:
        """The functions of all layouts in use."""
        whole = [self._helper(bits, chunks, name) for (bits, chunks), name in self._names.items()]
        return [
            *whole,
            *wide_helpers(self.prefix, self._wides),
            *decimal_helpers(self.prefix, self._decimals),
            *text_helpers(self.prefix, self._texts),
            *word_helpers(self.prefix, self._words),
            *row_helpers(self.prefix, self._rows),
        ]

    def _call(self, verb: str, integer: AnyInteger) -> str:
        key = (integer.bits, integer.chunks)
        self._used.add((verb, *key))
        if key not in self._names:
            self._names[key] = self._name(integer)
        return f"{self.prefix}_{verb}_{self._names[key]}_"

    def _name(self, integer: AnyInteger) -> str:
        if integer.byteorder:
            return f"u{integer.bits}_{'be' if integer.byteorder == 'big' else 'le'}"
        known = sum(1 for name in self._names.values() if name.startswith(f"u{integer.bits}_groups"))
        return f"u{integer.bits}_groups{known or ''}"

    def _helper(self, bits: int, chunks: Chunks, name: str) -> Helper:
        lines: list[str] = []
        if ("put", bits, chunks) in self._used:
            lines += self._putter(bits, chunks, name)
        if ("get", bits, chunks) in self._used:
            lines += self._getter(bits, chunks, name)
        if (bits, chunks) in self._partial:
            lines += self._checker(chunks, name)
        places = ", ".join(f"{c.shift}..{c.shift + c.bits - 1}" for c in chunks)
        return Helper(f"{bits} bits in {len(chunks)} bytes: bits {places}", tuple(lines))

    def _putter(self, bits: int, chunks: Chunks, name: str) -> list[str]:
        kind = unsigned_type(bits)
        body = [f"    at[{index}] = {_taken(chunk)};" for index, chunk in enumerate(chunks)]
        return [f"static inline void {self.prefix}_put_{name}_(uint8_t *at, {kind} value)", "{", *body, "}"]

    def _getter(self, bits: int, chunks: Chunks, name: str) -> list[str]:
        kind = unsigned_type(bits)
        terms = [_placed(index, chunk, kind) for index, chunk in enumerate(chunks)]
        head = f"static inline {kind} {self.prefix}_get_{name}_(const uint8_t *at)"
        joined = " |\n        ".join(terms)
        return [head, "{", f"    return ({kind})(\n        {joined});", "}"]

    def _checker(self, chunks: Chunks, name: str) -> list[str]:
        masks = [(index, chunk.mask ^ 0xFF) for index, chunk in enumerate(chunks) if chunk.bits < 8]
        terms = " | ".join(f"(at[{index}] & {unsigned(mask, 8, hexadecimal=True)})" for index, mask in masks)
        return [
            f"static inline bool {self.prefix}_unused_bits_{name}_(const uint8_t *at)",
            "{",
            f"    return ({terms}) != 0U;",
            "}",
        ]


def _times(factor: int, index: str) -> str:
    return index if factor == 1 else f"{factor}U * {index}"


def pointer(place: str, index: str) -> str:
    """The address of a byte."""
    return place if index == "0" else f"&{place}[{index}]"


def _taken(chunk: Chunk) -> str:
    shifted = f"value >> {chunk.shift}" if chunk.shift else "value"
    if chunk.bits == 8:
        return f"(uint8_t)({shifted})"
    return f"(uint8_t)(({shifted}) & {unsigned(chunk.mask, 8, hexadecimal=True)})"


def _placed(index: int, chunk: Chunk, kind: str) -> str:
    byte = (
        f"at[{index}]" if chunk.bits == 8 else f"(at[{index}] & {unsigned(chunk.mask, 8, hexadecimal=True)})"
    )
    return f"({kind})(({kind}){byte} << {chunk.shift})" if chunk.shift else f"({kind}){byte}"


def _width(text: Scientific) -> str:
    """Bits of the significand of a floating-point number, the hidden one included."""
    return "53U" if text.bits == 64 else "24U"
