"""Second pass, parts of a frame that are sent as digits."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

from qlinkgen.model.digits import Digits
from qlinkgen.model.types import Scalar
from qlinkgen.schema.file_frames import PartSpec
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path

#: Digits of a constant number: hex[2] or decimal[3].
FORM = re.compile(r"\s*(?P<name>decimal|hex)\s*\[\s*(?P<size>[1-9]|1[0-9]|20)\s*\]\s*", re.ASCII)
_WIDEST = 64


def in_digits(scalar: Scalar, spec: PartSpec, path: Path, report: Reporter) -> Scalar:
    """The integer of a part that is sent as digits; it holds every number of as many digits."""
    assert spec.as_ is not None
    found = FORM.fullmatch(spec.as_)
    if found is None:
        what = f"{shown(spec.as_)} is not a constant number of digits"
        report.error("bad-digits", (*path, "as"), what, "write hex[2] or decimal[3]", needs=(path,))
        return scalar
    base: Literal[10, 16] = 10 if found["name"] == "decimal" else 16
    size = int(found["size"])
    text = Digits(base, size, size, plain=True)
    if text.highest > scalar.maximum:
        wide = 1 << max(3, (text.highest.bit_length() - 1).bit_length())
        what = f"{spec.type} does not hold each number of {text}"
        hint = f"use type: u{wide}, or fewer digits" if wide <= _WIDEST else "use fewer digits"
        report.error("bad-digits", (*path, "as"), what, hint, needs=(path,))
        return scalar
    return replace(scalar, chunks=(), text=text, maximum=text.highest)


def check_source(name: str, spec: PartSpec, path: Path, report: Reporter) -> None:
    """Report a part that follows from one in digits, which has a name."""
    if spec.as_ is not None:
        what = f"{path[-1]} follows from {name}, which is sent as digits"
        hint = f"send {name} as bytes, or let a check value cover it"
        report.error("bad-digits", (*path, "equals"), what, hint, needs=(path,))


def check_kind(specs: Mapping[str, PartSpec], path: Path, report: Reporter) -> None:
    """Report addresses in digits in one of several kinds of frame."""
    for name, spec in specs.items():
        if spec.told == "address" and spec.as_ is not None:
            what = f"{name} is sent as digits in one of several kinds of frame"
            hint = "send it as bytes, or let text that is a value of every frame hold the digits"
            report.error("bad-digits", (*path, name, "as"), what, hint, of_key=True, needs=(path,))
