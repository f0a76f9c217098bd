"""Reads numbers, ranges and named values as people write them in cells."""

from __future__ import annotations

import re
from fractions import Fraction

_INTEGER = re.compile(
    r"(?:(?P<hex>[-+]?0x[0-9a-f]{1,16})|(?P<suffixed>[0-9][0-9a-f]{0,15})h|(?P<binary>0b[01]{1,64})"
    r"|(?P<decimal>[-+]?[0-9]{1,20})(?:\.0+)?)(?![0-9a-z.,])",
    re.IGNORECASE,
)
_NUMBER = re.compile(
    r"(?P<sign>[-+\u2212])?\s*(?P<top>[0-9]{1,20}(?:[.,][0-9]{1,20})?)(?:e(?P<exponent>[-+]?[0-9]{1,2}))?"
    r"(?:\s*/\s*(?P<below>[0-9]{1,20})|\s*\^\s*(?P<power>-?[0-9]{1,2}))?",
    re.IGNORECASE,
)
_LONG = re.compile(r"[0-9]{21}")
_TIMES = re.compile(r"^[\s*x\u00d7]+(?=[0-9.])", re.IGNORECASE)
_RANGE = re.compile(
    r"^[\[(]?\s*(?P<first>\S.*?)\s*(?:\.\.\.?|\u2026|\u2013|\bto\b|,|;|(?<=[0-9a-z])\s*-)\s*(?P<last>[^\]]+?)\s*[\])]?$",
    re.IGNORECASE,
)
_VALUE = re.compile(
    r"\s*(?P<number>0x[0-9a-f]{1,16}|[0-9]{1,20})\s*[:=\u2013\u2192-]+>?\s*(?P<label>\S.*?)\s*",
    re.IGNORECASE | re.DOTALL,
)
_BETWEEN = re.compile(r"[;\n|]+|,(?=\s*(?:0x[0-9a-fA-F]+|[0-9]+)\s*[:=\u2013\u2192-])")
_BITS = re.compile(
    r"(?:bits?\s*|b)?(?P<first>[0-9]{1,3})(?:\s*(?:\.\.|-|:|\u2013|to)\s*(?P<last>[0-9]{1,3}))?",
    re.IGNORECASE,
)
_NOTHING = frozenset({"", "-", "--", "n/a", "na", "none", "\u2013", "\u2014", "."})


def is_nothing(text: str) -> bool:
    """Whether a cell says that there is nothing."""
    return text.strip().lower() in _NOTHING


def integer(text: str) -> int | None:
    """``16``, ``0x10``, ``10h``, ``0b1`` or ``16.0`` at the beginning of a text."""
    found = _INTEGER.match(text.strip().replace("_", ""))
    if found is None:
        return None
    if found["suffixed"]:
        return int(found["suffixed"], 16)
    return int(found["hex"] or found["binary"] or found["decimal"], 10 if found["decimal"] else 0)


def number(text: str) -> Fraction | None:
    """A number at the beginning of a text: ``0.1``, ``0,1``, ``1/10``, ``10^-2``, ``1e-3``, ``x0.1``."""
    text = _TIMES.sub("", text.strip())
    if _LONG.search(text):
        return None
    whole = integer(text)
    found = _NUMBER.match(text)
    if whole is not None and (found is None or text.lower().startswith(("0x", "0b", "-0x"))):
        return Fraction(whole)
    if found is None:
        return None
    value = Fraction(found["top"].replace(",", "."))
    if found["exponent"]:
        value *= Fraction(10) ** int(found["exponent"])
    if found["below"]:
        if int(found["below"]) == 0:
            return None
        value /= int(found["below"])
    if found["power"]:
        if value == 0:
            return None
        value **= int(found["power"])
    return -value if found["sign"] in ("-", "\u2212") else value


def bounds(text: str) -> tuple[Fraction, Fraction] | None:
    """``0..100``, ``0 - 100``, ``-40 to 85`` or ``[0, 100]``."""
    found = _RANGE.match(text.strip())
    if found is None:
        return None
    first, last = number(found["first"]), number(found["last"])
    return (first, last) if first is not None and last is not None and first <= last else None


def named_values(text: str) -> list[tuple[int, str]]:
    """``0=off, 1=on``, with other signs, or one in each line; empty if the text is something else."""
    found: list[tuple[int, str]] = []
    for part in _BETWEEN.split(text):
        if not part.strip():
            continue
        match = _VALUE.fullmatch(part)
        if match is None:
            return []
        found.append((int(match["number"], 0 if match["number"][:2].lower() == "0x" else 10), match["label"]))
    return found


def bit_range(text: str) -> tuple[int, int] | None:
    """``3``, ``0..3``, ``3:0`` or ``bit 7``: first and last bit."""
    found = _BITS.fullmatch(text.strip())
    if found is None:
        return None
    first, last = int(found["first"]), int(found["last"] or found["first"])
    return min(first, last), max(first, last)


def spelt(value: Fraction) -> str:
    """A number in the notation of schemas: ``10``, ``1/10``, ``2.5``, ``2/3``."""
    if value.denominator == 1:
        return str(value.numerator)
    if value.numerator == 1:
        return f"1/{value.denominator}"
    below = value.denominator
    digits = 0
    while below % 10 == 0 or below % 5 == 0 or below % 2 == 0:
        below //= 10 if below % 10 == 0 else 5 if below % 5 == 0 else 2
        digits += 1
    if below != 1 or digits > 20:
        return f"{value.numerator}/{value.denominator}"
    return f"{decimal(value)}"


def decimal(value: Fraction) -> str:
    """A number with a finite decimal expansion, as decimal number."""
    digits = 0
    scaled = value
    while scaled.denominator != 1:
        scaled *= 10
        digits += 1
    text = f"{abs(scaled.numerator):0{digits + 1}d}"
    whole, rest = (text[:-digits], text[-digits:]) if digits else (text, "")
    return f"{'-' if value < 0 else ''}{whole}{'.' if rest else ''}{rest}"


def has_decimals(value: Fraction) -> bool:
    """Whether a number has a finite decimal expansion."""
    below = value.denominator
    for prime in (2, 5):
        while below % prime == 0:
            below //= prime
    return below == 1
