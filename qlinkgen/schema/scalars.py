"""Second pass, scalars: integers, with or without a meaning."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from typing import Literal, assert_never

from qlinkgen.model.types import (
    Chunk,
    Constant,
    Count,
    Enum,
    Flags,
    Float,
    Reserved,
    Scalar,
    Scaling,
    byte_chunks,
    group_chunks,
)
from qlinkgen.schema.constants import (
    INTEGER,
    MAX_BITS,
    MAX_WIDE_BITS,
    carrier,
    integer_range,
    repeated_constant,
)
from qlinkgen.schema.file_fields import FieldSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.filled import is_filled
from qlinkgen.schema.forms import formed
from qlinkgen.schema.location import Location
from qlinkgen.schema.notation import shown
from qlinkgen.schema.numbers import defaulted, quantified
from qlinkgen.schema.report import did_you_mean
from qlinkgen.schema.synonyms import type_hint

FIXED = re.compile(r"(?P<sign>u?)fixed(?P<whole>[0-9]{1,2})\.(?P<fraction>[0-9]{1,2})\Z", re.ASCII)
FLOAT = re.compile(r"f(?P<bits>16|32|64)\Z", re.ASCII)
#: Keys of numbers that neither check values nor derived ones have.
_NUMBER_KEYS = ("scale", "offset", "unit", "range", "raw_range", "default", "const", "reserved", "as", "echo")
#: Keys of the bytes of a number.
_LAYOUT_KEYS = ("byteorder", "groups", "parts", "packed", "as")
#: Keys of the steps of a number.
_QUANTITY_KEYS = ("scale", "offset", "unit", "range", "raw_range")
#: Built-in types other than integers.
KEYWORDS = ("bool", "bytes", "text")

Meaning = Enum | Flags | Float | Literal["bool"] | None


@dataclass(frozen=True, slots=True)
class Plain:
    """The properties of an integer type by its name alone."""

    bits: int
    signed: bool
    meaning: Meaning = None
    scaling: Scaling | None = None

    @property
    def what(self) -> str:
        """Its kind, for messages."""
        match self.meaning:
            case Enum() | Flags():
                return f"{self.meaning.kind} {self.meaning.name}"
            case Float():
                return self.meaning.name
            case "bool":
                return "bool"
            case None:
                return "a number"
            case _:
                assert_never(self.meaning)

    def fits(self, width: int) -> bool:
        """Whether every named value fits ``width`` bits."""
        if not isinstance(self.meaning, Enum | Flags):
            return self.bits <= width
        limit = 1 << width if isinstance(self.meaning, Enum) else width
        return all(0 <= member.value < limit for member in self.meaning.members)


class ScalarBuilder:
    """Builds the scalars of one file."""

    def __init__(self, file: SchemaFile, enums: Mapping[str, Enum], flags: Mapping[str, Flags]) -> None:
        """``enums`` and ``flags`` are the named constants by name."""
        self._file = file
        self._enums = enums
        self._flags = flags
        #: Whether groups can make up for a width of no whole bytes.
        self._grouped = True
        #: Names of types in use.
        self.used: set[str] = set()

    def in_bytes(self, file: SchemaFile) -> ScalarBuilder:
        """The same for parts of a frame, in a file without groups."""
        found = ScalarBuilder(file, self._enums, self._flags)
        found._grouped = False
        found.used = self.used
        return found

    def named(self, base: str, location: Location, count: str | None = None) -> Plain | None:
        """The type with a name; an unknown one is reported. ``count`` is the text of its brackets."""
        self.used.add(base)
        plain = self.plain(base)
        if plain is None:
            known = [
                *self._file.types,
                *self._enums,
                *self._flags,
                "u8",
                "u16",
                "u32",
                "i8",
                "i16",
                "i32",
                *KEYWORDS,
            ]
            written = base if count is None else f"{base}[{count}]"
            hint = type_hint(written) or did_you_mean(base, known, "define it under types, enums or flags")
            places = [(group, base) for group in ("types", "enums", "flags")]
            what = f"unknown type {shown(base)}"
            location.report.error(
                "unknown-type", location.place("type"), what, hint, needs=(location.path, *places)
            )
        elif isinstance(plain.meaning, Enum | Flags):
            group = "enums" if isinstance(plain.meaning, Enum) else "flags"
            if location.report.touched((group, base)):
                location.report.taint(location.path)
        return plain

    def plain(self, base: str) -> Plain | None:
        """The type with a name; None if it is unknown."""
        if base == "bool":
            # In groups of seven bits, a bool is a full group.
            return Plain(self._file.groups.bits if self._file.groups else 8, signed=False, meaning="bool")
        if enum := self._enums.get(base):
            found = carrier(self._file.enums[base].type)
            return Plain(enum.bits, signed=found is not None and found[1], meaning=enum)
        if flags := self._flags.get(base):
            return Plain(flags.bits, signed=False, meaning=flags)
        if match := FIXED.match(base):
            scaling = Scaling(Fraction(1, 1 << int(match["fraction"])))
            return Plain(
                int(match["whole"]) + int(match["fraction"]), signed=not match["sign"], scaling=scaling
            )
        if match := FLOAT.match(base):
            return Plain(int(match["bits"]), signed=False, meaning=Float(int(match["bits"])))
        if match := INTEGER.match(base):
            return Plain(int(match["bits"]), signed=match["sign"] == "i")
        return None

    def build(self, spec: FieldSpec, base: str, plain: Plain, location: Location) -> Scalar | None:
        """The scalar of a field; None if its layout is unknown."""
        if isinstance(plain.meaning, Enum) and plain.meaning.words is not None:
            return self._worded(spec, plain, plain.meaning, location)
        if spec.packed and plain.meaning == "bool":
            plain = replace(plain, bits=1)
        chunks = self._chunks(spec, plain.bits, base, location)
        if chunks is None:
            return None
        low, high = (0, 1) if plain.meaning == "bool" else integer_range(plain.bits, signed=plain.signed)
        scalar = Scalar(
            bits=plain.bits, signed=plain.signed, chunks=chunks, minimum=low, maximum=high,
            scaling=plain.scaling, meaning=plain.meaning, unit=spec.unit or "",
        )  # fmt: skip
        scalar = formed(scalar, spec, base, location, grouped=self._file.groups is not None)
        _check_keys(spec, plain, location)
        if plain.bits > MAX_BITS:
            what = f"an integer of more than {MAX_BITS} bits"
            location.reject(spec, ("scale", "offset", "counts", "groups", "as"), what)
            if self._file.groups:
                location.fault(
                    "bad-width", "type", f"{base} has {plain.bits} bits", f"use 1 to {MAX_BITS} in groups"
                )
        if spec.counts is not None:
            return replace(scalar, role=_count(spec, location))
        if is_filled(spec):
            return _placed(scalar, spec, plain, location)
        return _valued(quantified(scalar, spec, plain.what, location), spec, location)

    def _worded(self, spec: FieldSpec, plain: Plain, enum: Enum, location: Location) -> Scalar | None:
        """A word of an enum."""
        location.reject(spec, (*_LAYOUT_KEYS, *_QUANTITY_KEYS, "counts", "algorithm", "equals"), plain.what)
        if self._file.groups is not None:
            what = f"words are not sent in groups of {self._file.groups.bits} bits"
            location.fault("bad-width", "type", what, "use an enum of numbers")
        words = enum.words
        assert words is not None
        _check_keys(spec, plain, location)
        scalar = Scalar(
            bits=enum.bits, chunks=(), text=words, minimum=words.lowest, maximum=words.highest, meaning=enum
        )
        return _valued(scalar, spec, location)

    def _in_a_row(
        self, spec: FieldSpec, bits: int, base: str, location: Location
    ) -> tuple[Chunk, ...] | None:
        """Items of a packed array have bits, but not bytes."""
        if FLOAT.match(base):
            location.fault("not-applicable", "packed", f"'packed' has no effect on {base}", "remove it")
            return None
        if not 1 <= bits <= MAX_BITS:
            location.fault("bad-width", "type", f"{base} has {bits} bits", f"use 1 to {MAX_BITS}")
            return None
        if self._file.groups is not None:
            what = f"bits in a row cannot be sent in groups of {self._file.groups.bits} bits"
            location.fault("bad-width", "packed", what, "remove it")
        location.reject(spec, ("byteorder", "groups", "parts", "as"), "bits in a row")
        return ()

    def _chunks(self, spec: FieldSpec, bits: int, base: str, location: Location) -> tuple[Chunk, ...] | None:
        if spec.packed is not None:
            return self._in_a_row(spec, bits, base, location)
        most = MAX_BITS if FIXED.match(base) else MAX_WIDE_BITS
        if not 1 <= bits <= most:
            location.fault("bad-width", "type", f"{base} has {bits} bits", f"use 1 to {most}")
            return None
        groups = spec.groups or self._file.groups
        if groups is not None and FLOAT.match(base):
            hint = "use an integer, or whole bytes"
            location.fault(
                "bad-width", "type", f"{base} cannot be sent in groups of {groups.bits} bits", hint
            )
            return None
        if groups is not None:
            parts = tuple(spec.parts or [(0, bits - 1)])
            if not _covered(parts, bits):
                hint = f"list every bit from 0 to {bits - 1} once"
                location.fault(
                    "bad-width", "parts", f"the parts do not cover the {bits} bits of {base}", hint
                )
                return None
            return group_chunks(parts, groups.bits, least_first=groups.first == "least")
        if bits % 8:
            hint = "use u8, u16, u24 ... u128, bits inside an integer, or groups"
            hint = hint if self._grouped else "use u8, u16, u24 ... u128, or bits inside an integer"
            location.fault("bad-width", "type", f"{base} has {bits} bits, not whole bytes", hint)
            return None
        if spec.parts:
            location.key_fault(
                "not-applicable", "parts", "'parts' has no effect without groups", "add groups, or remove it"
            )
        return byte_chunks(bits // 8, spec.byteorder or self._file.byteorder)


def _valued(scalar: Scalar, spec: FieldSpec, location: Location) -> Scalar:
    """A scalar with the default or constant of a field."""
    if isinstance(spec.const, list):
        return _constants(scalar, spec.const, location)
    key = "const" if spec.const is not None else "default"
    scalar = defaulted(scalar, getattr(spec, key), key, location)
    if spec.reserved:
        return replace(scalar, role=Reserved())
    return scalar if spec.const is None else replace(scalar, role=Constant())


def _placed(scalar: Scalar, spec: FieldSpec, plain: Plain, location: Location) -> Scalar:
    """The place of a number that follows from other fields, which `filled` adds later."""
    key = "algorithm" if spec.algorithm is not None else "equals"
    what = "a check value" if spec.algorithm is not None else "a derived number"
    others = ("equals",) if spec.algorithm is not None else ()
    location.reject(spec, (*_NUMBER_KEYS, *others), what)
    if plain.meaning is not None or plain.scaling is not None or plain.signed or plain.bits > MAX_BITS:
        hint = f"use an unsigned integer of up to {MAX_BITS} bits"
        location.fault("bad-derivation", key, f"{spec.type} cannot hold {what}", hint)
    elif scalar.byteorder is None:
        location.fault(
            "bad-derivation", key, f"{what} is not sent in groups", "use an integer of whole bytes"
        )
    return replace(scalar, role=Reserved())


def _constants(scalar: Scalar, values: list[int | bool | Decimal | str], location: Location) -> Scalar:
    """A constant of which a receiver accepts several values."""
    if isinstance(scalar.meaning, Float) or scalar.bits > MAX_BITS or not values:
        what = "the list of constants is empty" if not values else "such a number has one constant"
        location.fault("bad-value", "const", what, "write one number")
        return replace(scalar, role=Constant())
    sent, *others = (defaulted(scalar, each, "const", location) for each in values)
    numbers = [sent.default, *(each.default for each in others)]
    if repeated := repeated_constant(numbers):
        location.fault("duplicate-value", "const", *repeated)
    accepted = dict.fromkeys(numbers[1:])
    return replace(sent, role=Constant(tuple(accepted)))


def _covered(parts: tuple[tuple[int, int], ...], bits: int) -> bool:
    if any(last >= bits for _, last in parts):
        return False
    return sorted(bit for first, last in parts for bit in range(first, last + 1)) == list(range(bits))


def _count(spec: FieldSpec, location: Location) -> Count:
    """The role of a count."""
    assert spec.counts is not None
    role = Count(spec.counts[0], _count_unit(spec), tuple(spec.counts[1:]))
    scale, offset = spec.scale or Fraction(1), spec.offset or Fraction(0)
    if scale.denominator != 1 or scale < 1 or offset.denominator != 1:
        key = "scale" if scale.denominator != 1 or scale < 1 else "offset"
        location.fault("bad-count", key, f"the {key} of a count is not a whole number", "use one, like 4")
        return role
    return replace(role, scale=int(scale), offset=int(offset))


def _count_unit(spec: FieldSpec) -> Literal["items", "bytes"]:
    """A count of several fields counts bytes."""
    return spec.counts_in if len(spec.counts or ()) == 1 else "bytes"


def _check_keys(spec: FieldSpec, plain: Plain, location: Location) -> None:
    """Report contradictory keys."""
    if spec.counts is not None:
        keys = (
            "range",
            "raw_range",
            "default",
            "const",
            "reserved",
            "algorithm",
            "equals",
        )
        location.reject(spec, keys, "a count")
        if plain.meaning is not None or plain.scaling is not None:
            location.fault("bad-count", "counts", f"{plain.what} cannot count", "use an unsigned integer")
        if len(spec.counts) > 1 and "counts_in" in location.written and spec.counts_in == "items":
            what = "a count of several fields is a number of bytes"
            location.key_fault("not-applicable", "counts_in", what, "remove it")
    elif "counts_in" in location.written:
        location.key_fault(
            "not-applicable", "counts_in", "'counts_in' has no effect without counts", "remove it"
        )
    if spec.const is not None:
        location.reject(spec, ("default",), "a constant")
    elif spec.reserved:
        location.reject(spec, ("default",), "reserved bytes", "use const for the value sent")
    if spec.range is not None and spec.raw_range is not None:
        location.key_fault(
            "not-applicable", "raw_range", "'raw_range' has no effect with range", "keep one of them"
        )
    if plain.meaning == "bool" or isinstance(plain.meaning, Flags):
        location.reject(spec, ("range", "raw_range"), plain.what)
    if isinstance(plain.meaning, Float):
        location.reject(spec, ("raw_range",), plain.what, "use range")
