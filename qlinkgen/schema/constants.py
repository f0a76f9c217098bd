"""Second pass, named constants: enums and flags."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from qlinkgen.model.types import Enum, Flags, NamedValue
from qlinkgen.model.words import Words
from qlinkgen.schema.file_fields import EnumSpec, FlagsSpec
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path
from qlinkgen.schema.synonyms import type_hint

#: Maximum width of an integer with a meaning, a scale, bits or groups, and of an item of an array.
MAX_BITS = 64
#: Maximum number of characters of a number or a word.
MAX_CHARACTERS = 40
#: Bits of the numbers of words, one of which is left for all other texts.
_WORD_BITS = 8
_MAX_WORDS = 255
#: Maximum width of a plain integer.
MAX_WIDE_BITS = 128
INTEGER = re.compile(r"(?P<sign>[ui])(?P<bits>[1-9][0-9]{0,2})\Z", re.ASCII)


def integer_range(bits: int, *, signed: bool) -> tuple[int, int]:
    """Minimum and maximum of an integer type."""
    return (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)


def carrier(text: str) -> tuple[int, bool] | None:
    """Bits and sign of an integer type, None for other text."""
    match = INTEGER.match(text)
    if not match or int(match["bits"]) > MAX_BITS:
        return None
    return int(match["bits"]), match["sign"] == "i"


def repeated_constant(numbers: Sequence[int]) -> tuple[str, str] | None:
    """What is wrong with a list of constants that has one of them twice, and the fix."""
    again = next((each for at, each in enumerate(numbers) if each in numbers[:at]), None)
    if again is None:
        return None
    return f"{again} is twice in the list of constants", "write each number once, first the one that is sent"


def build_enum(name: str, spec: EnumSpec, report: Reporter) -> Enum:
    """The enum described by a mapping."""
    path: Path = ("enums", name)
    if spec.type == "text":
        return _worded(name, spec, path, report)
    if spec.ignore_case:
        what = f"{name} has numbers, not words"
        report.error("not-applicable", (*path, "ignore_case"), what, "remove ignore_case", of_key=True)
    bits, signed = _carrier(spec.type, path, report, signed=True)
    members = {}
    for key, value in spec.values.items():
        if isinstance(value.value, int):
            members[key] = value.value
        else:
            what = f"{shown(value.value)} is not a whole number"
            report.error(
                "wrong-type",
                (*path, "values", key),
                what,
                "write one, or type: text",
                needs=((*path, "type"),),
            )
            report.taint(path)
    limits = integer_range(bits, signed=signed)
    _check_members(members, limits, f"does not fit {spec.type}", path, report)
    constants = tuple(NamedValue(key, number, spec.values[key].doc) for key, number in members.items())
    return Enum(name, bits, constants, spec.doc, spec.section)


def _worded(name: str, spec: EnumSpec, path: Path, report: Reporter) -> Enum:
    """An enum of words; their places are its numbers."""
    words: dict[str, str] = {}

    def same(one: str, other: str) -> bool:
        return one.upper() == other.upper() if spec.ignore_case else one == other

    for key, value in spec.values.items():
        word, place = value.value, (*path, "values", key)
        if not isinstance(word, str):
            report.error("wrong-type", place, f"{word} is not a text", f'quote it: "{word}"', needs=(place,))
            report.taint(path)
        elif not (word.isascii() and word.isprintable() and 0 < len(word) <= MAX_CHARACTERS):
            what = f"{shown(word)} is not a word of 1 to {MAX_CHARACTERS} printable ASCII characters"
            report.error("value-does-not-fit", place, what, "use other characters", needs=(place,))
            report.taint(path)
        elif other := next((other for other, known in words.items() if same(known, word)), None):
            what = f"{key} and {other} are both {shown(word)}"
            report.error("duplicate-value", place, what, "give each a different word", needs=(place,))
        else:
            words[key] = word
    if len(spec.values) > _MAX_WORDS:
        what = f"{name} has {len(spec.values)} words"
        report.error("value-does-not-fit", (*path, "values"), what, f"use at most {_MAX_WORDS}", needs=())
    members = tuple(NamedValue(key, at, spec.values[key].doc) for at, key in enumerate(words))
    found = Words(name, tuple(each.encode() for each in words.values()) or (b"?",), spec.ignore_case)
    return Enum(name, _WORD_BITS, members, spec.doc, spec.section, found)


def build_flags(name: str, spec: FlagsSpec, report: Reporter) -> Flags:
    """The flags described by a mapping."""
    path: Path = ("flags", name)
    bits, _ = _carrier(spec.type, path, report, signed=False)
    members = {key: value.bit for key, value in spec.values.items()}
    _check_members(members, (0, bits - 1), f"is not a bit of {spec.type}", path, report)
    constants = tuple(NamedValue(key, value.bit, value.doc) for key, value in spec.values.items())
    return Flags(name, bits, constants, spec.reserved == "zero", spec.doc, spec.section)


def _carrier(text: str, path: Path, report: Reporter, *, signed: bool) -> tuple[int, bool]:
    found = carrier(text)
    if found is None or (found[1] and not signed):
        kind = "an integer" if signed else "an unsigned integer"
        hint = "use u8, u16, i32 and so on" if signed else "use u8, u16, u24 and so on"
        hint = type_hint(text) or hint
        report.error("unknown-type", (*path, "type"), f"'{text}' is not {kind} type", hint, needs=(path,))
        report.taint(path)
        return MAX_BITS, False
    return found


def _check_members(
    members: Mapping[str, int], limits: tuple[int, int], complaint: str, path: Path, report: Reporter
) -> None:
    seen: dict[int, str] = {}
    for key, value in members.items():
        place = (*path, "values", key)
        intact = ((*path, "type"), place)
        if not limits[0] <= value <= limits[1]:
            hint = f"use {limits[0]}..{limits[1]}, or a wider type"
            report.error("value-does-not-fit", place, f"{key} = {value} {complaint}", hint, needs=intact)
        if value in seen:
            what = f"{key} and {seen[value]} are both {value}"
            report.error("duplicate-value", place, what, "give each a different number", needs=intact)
        seen.setdefault(value, key)
