"""Floating-point numbers as text, by search among all patterns of bits."""

from __future__ import annotations

import decimal
import re
from fractions import Fraction

from tests.support.whole.reference.layouts import Number


def real_text(number: Number, raw: int) -> bytes:
    """The text with the fewest digits that is read as the same bits."""
    sign = b"-" if raw >> number.bits - 1 else b""
    value = decimal.Decimal(abs(number.number(raw)))
    for digits in range(1, 18):
        context = decimal.Context(prec=digits, Emin=-9999, Emax=9999)
        rounded = context.create_decimal(value)
        shown = rounded.as_tuple().digits if value else (0,)
        exponent = rounded.adjusted() if value else 0
        if not value and digits > 1:
            break
        text = "".join(map(str, shown)).ljust(digits, "0")
        mantissa = text[0] + (f".{text[1:]}" if digits > 1 else "")
        found = sign + f"{mantissa}E{'-' if exponent < 0 else '+'}{abs(exponent):02d}".encode()
        if real_of(number, found) == raw:
            return found
    raise AssertionError(f"no text for {raw:#x}")


def real_of(number: Number, text: bytes) -> int:
    """The bits of the number nearest to a text. Raises Wrong."""
    from tests.support.whole.reference.values import Wrong  # which imports this module

    if not re.fullmatch(rb"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([Ee][+-]?[0-9]+)?", text):
        raise Wrong("range", str(text))
    sign = int(text.startswith(b"-")) << number.bits - 1
    mantissa, _, exponent = text.lstrip(b"+-").upper().partition(b"E")
    power = max(-10_000, min(10_000, int(exponent or b"0")))
    whole = Fraction(mantissa.decode().rstrip(".") or "0") if mantissa.strip(b".0") else Fraction(0)
    value = whole * Fraction(10) ** power
    # Positive numbers ascend with their bits; the last pattern is infinite.
    low, high = 0, (0xFF << 23) if number.bits == 32 else (0x7FF << 52)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if Fraction(number.number(middle)) <= value else (low, middle)
    below = Fraction(number.number(low))
    ulp = below - Fraction(number.number(low - 1)) if low else Fraction(number.number(1))
    above = below + (ulp if low == 0 or high >= (0xFF << 23 if number.bits == 32 else 0x7FF << 52)
                     else Fraction(number.number(high)) - below)  # fmt: skip
    if value - below > above - value or (value - below == above - value and low % 2):
        low = high
    if low >= (0xFF << 23 if number.bits == 32 else 0x7FF << 52):
        raise Wrong("range", str(text))
    return sign | low
