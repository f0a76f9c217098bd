"""Second pass, forms of numbers: binary-coded decimal, and text."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING

from qlinkgen.model.digits import Digits
from qlinkgen.model.scientific import Scientific
from qlinkgen.model.types import Float, Scalar
from qlinkgen.schema.constants import MAX_BITS, MAX_CHARACTERS
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import did_you_mean

if TYPE_CHECKING:
    from qlinkgen.schema.file_fields import FieldSpec
    from qlinkgen.schema.location import Location

_TEXT = re.compile(
    r"(?P<name>decimal|hex)(?:\[\s*(?P<least>[0-9]{1,3})\s*(?:\.\.\s*(?P<most>[0-9]{1,3})\s*)?\])?\Z",
    re.ASCII,
)


#: The form of floating-point numbers.
SCIENTIFIC = "scientific"
#: The bits of the greatest number of a width.
_GREATEST = {32: 0x7F7F_FFFF, 64: 0x7FEF_FFFF_FFFF_FFFF}


def formed(scalar: Scalar, spec: FieldSpec, base: str, location: Location, *, grouped: bool) -> Scalar:
    """Apply the form of a field to a scalar; ``grouped``: the file has groups of bits."""
    if spec.as_ is None:
        return scalar
    if spec.pad is not None and (spec.pad != b" " or not spec.as_.startswith("decimal[")):
        what = "only spaces (pad: 20) fill up a number, one of as: decimal[6]"
        location.key_fault("bad-digits", "pad", what, "remove it, or write pad: 20")
    if spec.groups or grouped or (spec.counts is not None and not spec.as_.startswith(("decimal", "hex"))):
        location.reject(spec, ("as",), "a count" if spec.counts else "groups of bits")
    elif spec.packed is not None:
        pass  # reported with the bits in a row
    elif spec.as_ == "bcd":
        if scalar.meaning is None and scalar.scaling is None and not scalar.signed:
            return replace(scalar, bcd=True, maximum=int("9" * (scalar.bits // 4)))
        location.reject(spec, ("as",), base, "use an unsigned integer")
    else:
        return _text(scalar, spec, base, location)
    return scalar


def _text(scalar: Scalar, spec: FieldSpec, base: str, location: Location) -> Scalar:
    """A number that is sent as text."""
    assert spec.as_ is not None
    if spec.as_.strip() == SCIENTIFIC:
        return _scientific(scalar, spec, base, location)
    match = _TEXT.match(spec.as_.strip())
    if match is None:
        known = ["bcd", "decimal", "hex", SCIENTIFIC]
        hint = did_you_mean(spec.as_, known, "use bcd, decimal, decimal[1..6], hex[2] or scientific")
        location.fault("bad-value", "as", f"{shown(spec.as_)} is not a form of a number", hint)
        return scalar
    if isinstance(scalar.meaning, Float) or scalar.bits > MAX_BITS:
        hint = f"use an integer of up to {MAX_BITS} bits, with a scale such as 1/100"
        if isinstance(scalar.meaning, Float):
            hint = f"{hint}, or as: {SCIENTIFIC}"
        location.reject(spec, ("as",), base, hint)
        return scalar
    location.reject(spec, ("byteorder",), "text")
    hexadecimal = match["name"] == "hex"
    if hexadecimal and scalar.signed:
        location.reject(spec, ("as",), base, "use an unsigned integer")
        return scalar
    point = 0 if hexadecimal else _point(scalar, spec, location)
    if point is None:
        return scalar
    digits = _digits(scalar, match, point, location)
    if digits is None:
        return scalar
    digits = replace(digits, spaced=spec.pad is not None)
    text = replace(scalar, chunks=(), text=digits)
    natural = text.natural_minimum, text.natural_maximum
    low, high = (scalar.minimum, scalar.maximum) if scalar.meaning == "bool" else natural
    return replace(text, minimum=low, maximum=high)


def _scientific(scalar: Scalar, spec: FieldSpec, base: str, location: Location) -> Scalar:
    """A floating-point number with a decimal exponent; infinities and NaN have no such text."""
    kind = scalar.meaning
    if not isinstance(kind, Float) or scalar.bits not in _GREATEST:
        location.reject(spec, ("as",), base, "use f32 or f64, or as: decimal")
        return scalar
    location.reject(spec, ("byteorder",), "text")
    location.reject(spec, ("const", "reserved"), "a floating-point number as text")
    most = kind.value(_GREATEST[scalar.bits])
    finite = replace(kind, bounds=(-most, most))
    return replace(scalar, chunks=(), text=Scientific(scalar.bits), meaning=finite)


def _point(scalar: Scalar, spec: FieldSpec, location: Location) -> int | None:
    """The number of digits after the decimal point, None if the steps have no such digits."""
    scale = spec.scale or (scalar.scaling.scale if scalar.scaling else Fraction(1))
    point = len(str(scale.denominator)) - 1
    if scale != Fraction(1, 10**point) or spec.offset:
        what = f"{spec.type} in steps of {scale}" + (f" from {spec.offset}" if spec.offset else "")
        hint = "use a scale such as 1/100 without an offset"
        location.fault(
            "bad-digits", "offset" if spec.offset else "as", f"decimal digits do not show {what}", hint
        )
        return None
    return point


def _digits(scalar: Scalar, match: re.Match[str], point: int, location: Location) -> Digits | None:
    base = 10 if match["name"] == "decimal" else 16
    whole = Digits(base, 1, MAX_CHARACTERS, point)  # type: ignore[arg-type]
    widest = max(
        len(whole.text(each))
        for each in (scalar.natural_minimum, scalar.natural_maximum)
        if base == 10 or each >= 0
    )
    if match["least"] is None:
        return replace(whole, most=widest)
    least = int(match["least"])
    most = int(match["most"] or least)
    needed = point + 2 if point else 1
    if not needed <= most <= MAX_CHARACTERS or not 1 <= least <= most:
        what = (
            f"{match[0]} has no room for a number" if most < needed else f"{match[0]} ends before it begins"
        )
        hint = f"use {needed} to {MAX_CHARACTERS} characters, the decimal point included"
        location.fault("bad-digits", "as", what, hint)
        return None
    return Digits(base, least, most, point)  # type: ignore[arg-type]
