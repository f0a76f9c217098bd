"""The expressions that a schema can state: references to earlier fields, and conditions on them."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from qlinkgen.importers import cells
from qlinkgen.importers.document import Notation, Value
from qlinkgen.importers.names import schema_name

_NAME = r"[a-z][a-z0-9_]*(?:\.[a-z][a-z0-9_]*)*"
_COUNT = re.compile(rf"\(?\s*(?P<name>{_NAME})\s*(?:(?P<sign>[-+*/])\s*(?P<number>\w+)\s*)?\)?(?:\.as<\w+>)?")
_TERM = re.compile(
    rf"\(?\s*(?P<not>not\s+)?(?P<name>_|{_NAME}|_\.{_NAME})\s*(?:(?P<sign>==|!=|>=|<=|>|<)\s*(?P<value>[\w:.]+))?\s*\)?"
)
_LONGEST = 500


@dataclass(frozen=True, slots=True)
class Count:
    """A number of bytes or items: ``scale`` times a field, plus ``offset``."""

    name: str
    scale: int = 1
    offset: int = 0


def count(text: str) -> Count | int | None:
    """A number, ``NAME``, ``NAME + N``, ``NAME - N`` or ``NAME * N``; None for other expressions."""
    text = text.strip()
    if (whole := _whole(text)) is not None:
        return whole
    found = _COUNT.fullmatch(text[:_LONGEST])
    if found is None:
        return None
    if not found["sign"]:
        return Count(found["name"])
    number = _whole(found["number"])
    match (found["sign"], number):
        case ("+", int()):
            return Count(found["name"], offset=number or 0)
        case ("-", int()):
            return Count(found["name"], offset=-(number or 0))
        case ("*", int()) if number:
            return Count(found["name"], scale=number)
        case _:
            return None


def _whole(text: str) -> int | None:
    found = cells.integer(text)
    return found if found is not None and re.fullmatch(r"0[xX][0-9a-fA-F_]+|0b[01_]+|[0-9_]+", text) else None


#: Gives the number of a value such as ``kind::data`` for a field; None if it is not known.
Constant = Callable[[str, str], int | None]
#: Gives least and greatest value of a field; None if it is not a whole number.
Limits = Callable[[str], tuple[int, int] | None]


def condition(text: str, constant: Constant, limits: Limits) -> Value | None:
    """A condition in the notation of schemas; None for other expressions.

    Args:
        text: Comparisons of a field with a constant, joined by `and`.
        constant: Looks up the names of enums.
        limits: Looks up the range of a field.
    """
    terms = re.split(r"\s+and\s+", text.strip()[:_LONGEST])
    found: dict[str, Value] = {}
    for each in terms:
        match = _TERM.fullmatch(each.strip())
        if match is None or each.count("(") != each.count(")"):
            return None
        name = match["name"].removeprefix("_.")
        if name in found:
            return None
        if not match["sign"]:
            if len(terms) == 1 and not match["not"]:
                return name
            found[name] = not match["not"]
            continue
        value = None if match["not"] else _compared(match, name, constant, limits)
        if value is None:
            return None
        found[name] = value
    return found


def _compared(match: re.Match[str], name: str, constant: Constant, limits: Limits) -> Value | None:
    if match["value"] in ("true", "false"):
        return (
            (match["value"] == "true") is (match["sign"] == "==") if match["sign"] in ("==", "!=") else None
        )
    number = _whole(match["value"])
    named = "" if number is not None else schema_name(match["value"].rpartition("::")[2])
    number = constant(name, match["value"]) if number is None else number
    if number is None:
        return None
    ends = limits(name)
    match match["sign"]:
        case "==":
            return named or number
        case "!=":
            return Notation(f"not {named or number}")
        case sign if ends is None:
            del sign
            return None
        case ">":
            return _range(number + 1, ends[1])
        case ">=":
            return _range(number, ends[1])
        case "<":
            return _range(ends[0], number - 1)
        case _:
            return _range(ends[0], number)


def _range(first: int, last: int) -> Value | None:
    return Notation(f"{first}..{last}") if first < last else first if first == last else None
