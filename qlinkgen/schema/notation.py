"""Notations inside YAML values: ranges, rationals, byte strings, durations, types."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

_RANGE = re.compile(r"\s*(?P<first>[^.\s]\S*?)\s*\.\.\s*(?P<last>\S+)\s*\Z")
_RATIONAL = re.compile(
    r"""\s*(?P<sign>[-+]?)(?P<top>[0-9]{1,40}(?:\.[0-9]{1,40})?(?:e[-+]?[0-9]{1,3})?)\s*
    (?:/\s*(?:(?P<base>[0-9]{1,10})\^(?P<power>[0-9]{1,4})|(?P<below>[0-9]{1,40})))?\s*\Z""",
    re.ASCII | re.VERBOSE,
)
_HEX_NUMBER = re.compile(r"\s*[-+]?0x[0-9a-fA-F]{1,40}\s*\Z", re.ASCII)
_HEX = re.compile(r"\s*(?:[0-9a-fA-F]{2}\s*)+\Z", re.ASCII)
_ANSWER_ID = re.compile(
    r"\s*request\.id\s*(?:(?P<sign>[+-])\s*(?P<number>0x[0-9A-Fa-f]+|0|[1-9][0-9]*)\s*)?\Z", re.ASCII
)
_TEXT_ID = re.compile(r"[!-~]{0,40}\Z", re.ASCII)
_DURATION = re.compile(
    r"\s*(?P<number>[0-9]{1,12}(?:\.[0-9]{1,12})?)\s*(?P<unit>bytes?|us|ms|s)\s*\Z", re.ASCII
)
_TYPE = re.compile(r"\s*(?P<base>[A-Za-z_][\w.]*)\s*(?:\[(?P<count>[^\]]*)\])?\s*\Z", re.ASCII)
_VERSION = re.compile(r"[0-9]{1,9}(?:\.[0-9]{1,9}){0,5}\Z", re.ASCII)
#: A number derived from another one: NAME, ~NAME, NAME + 1.
DERIVED = re.compile(
    r"\s*(?P<not>~?)\s*(?P<name>[a-z][a-z0-9_]*)\s*(?P<added>[-+]\s*[0-9]{1,20})?\s*\Z", re.ASCII
)


def beyond(added: int, name: str, bits: int) -> tuple[str, str] | None:
    """What is wrong with a number that is added to, or taken from, one of so many bits, and the fix."""
    most = (1 << bits) - 1
    if abs(added) <= most:
        return None
    what = f"{abs(added)} is beyond the range of {name}, 0..{most}"
    same = abs(added) & most
    sign = "-" if added < 0 else "+"
    return what, f"write {sign} {same}, which gives the same number" if same else "add nothing"


#: What a field of an answer repeats of its request: request.NAME.
REPEATED = re.compile(r"\s*request\s*\.\s*(?P<name>[a-z][a-z0-9_]*)\s*\Z", re.ASCII)
_SECONDS = {"us": Fraction(1, 10**6), "ms": Fraction(1, 1000), "s": Fraction(1)}
_MAX_POWER = 128
_MAX_SHOWN = 60


@dataclass(frozen=True, slots=True)
class Range:
    """First and last value, both included."""

    first: Fraction
    last: Fraction


@dataclass(frozen=True, slots=True)
class Divider:
    """The byte of a separator, b"" for none; it may precede each field, the first one included."""

    byte: bytes = b""
    before: bool = False


@dataclass(frozen=True, slots=True)
class Duration:
    """Byte times or seconds, one of them zero."""

    byte_times: Fraction = Fraction(0)
    seconds: Fraction = Fraction(0)


@dataclass(frozen=True, slots=True)
class Version:
    """A version of a protocol: numbers with dots between them; 2 is 2.0."""

    numbers: tuple[int, ...]

    def __str__(self) -> str:
        return ".".join(map(str, self.numbers))

    def __lt__(self, other: Version) -> bool:
        return self.key < other.key

    def __le__(self, other: Version) -> bool:
        return self.key <= other.key

    @property
    def key(self) -> tuple[int, ...]:
        """Its numbers without zeros at the end, for comparison."""
        numbers = self.numbers
        while numbers and numbers[-1] == 0:
            numbers = numbers[:-1]
        return numbers

    @property
    def next(self) -> Version:
        """The version just after it."""
        return Version((*self.numbers, 1))


@dataclass(frozen=True, slots=True)
class TypeText:
    """``base[count]``; count is None without brackets, "" for empty ones."""

    base: str
    count: str | None


class DecimalNumber(int):
    """A number of two decimal digits or more; pairs of digits are hex where bytes are expected."""


def shown(value: object) -> str:
    """A value of the file for a message."""
    if isinstance(value, dict | list):
        return "a mapping" if isinstance(value, dict) else "a list"
    if value is None:
        return "nothing"
    text = str(value).lower() if isinstance(value, bool) else str(value)
    return f"'{text}'" if len(text) <= _MAX_SHOWN else f"'{text[: _MAX_SHOWN - 3]}...'"


def rational(value: object) -> Fraction:
    """``10``, ``0.1``, ``1/10`` or ``1/2^16``, exactly. Raises ValueError."""
    if isinstance(value, bool) or not isinstance(value, int | Decimal | str):
        raise ValueError(  # noqa: TRY004 - a wrong value of the file, not of a caller
            f"{shown(value)} is not a number; write 10, 0.1, 1/10 or 1/2^16"
        )
    if not isinstance(value, str):
        return Fraction(value)
    if not (match := _RATIONAL.match(value)):
        if _HEX_NUMBER.match(value):
            return Fraction(int(value, 16))
        raise ValueError(f"{shown(value)} is not a number; write 10, 0.1, 1/10 or 1/2^16")
    if match["power"] and int(match["power"]) > _MAX_POWER:
        raise ValueError(f"{shown(value)} has a power above {_MAX_POWER}; use a smaller one")
    below = int(match["base"]) ** int(match["power"]) if match["base"] else int(match["below"] or 1)
    if below == 0:
        raise ValueError(f"{shown(value)} divides by zero; write another number")
    number = Fraction(match["top"]) / below
    return -number if match["sign"] == "-" else number


def range_of(value: object) -> Range:
    """``1..16`` or a single number. Raises ValueError."""
    if isinstance(value, str) and (match := _RANGE.match(value)):
        found = Range(rational(match["first"]), rational(match["last"]))
    else:
        try:
            found = Range(rational(value), rational(value))
        except ValueError:
            raise ValueError(f"{shown(value)} is not a range; write first..last, like 1..16") from None
    if found.first > found.last:
        raise ValueError(f"{shown(value)} ends before it begins; write the smaller number first")
    return found


def whole_range(value: object) -> tuple[int, int]:
    """A range of non-negative whole numbers. Raises ValueError."""
    found = range_of(value)
    if found.first.denominator != 1 or found.last.denominator != 1 or found.first < 0:
        raise ValueError(f"{shown(value)} is not a range of non-negative whole numbers; write one like 0..26")
    return int(found.first), int(found.last)


def byte_count(value: object) -> int:
    """A positive number of bytes like ``16 bytes``. Raises ValueError."""
    match = re.fullmatch(r"([1-9][0-9]{0,4}) bytes?", value, re.ASCII) if isinstance(value, str) else None
    if match is None:
        raise ValueError(f"{shown(value)} is not a number of bytes; write it like 16 bytes")
    return int(match[1])


def byte_string(value: object) -> bytes:
    """Pairs of hex digits like ``A5 A5``, or one number like ``0xA5``. Raises ValueError.

    To YAML a plain ``10`` is a number, while ``1A`` and ``10 10`` are text; all three are read as hex here.
    """
    if isinstance(value, DecimalNumber) and len(str(int(value))) % 2 == 0:
        return bytes.fromhex(str(int(value)))
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= 0xFF:
        return bytes([value])
    if isinstance(value, str) and _HEX.match(value):
        return bytes.fromhex(value)
    raise ValueError(
        f"{shown(value)} is not a byte string; write one number like 0xA5, or hex pairs like A5 A5"
    )


def version(value: object) -> Version:
    """``2``, ``2.1`` or ``1.0.3``. Raises ValueError."""
    if isinstance(value, int | Decimal | str) and not isinstance(value, bool) and _VERSION.match(str(value)):
        return Version(tuple(map(int, str(value).split("."))))
    raise ValueError(f"{shown(value)} is not a version; write numbers with dots between them, like 2.1")


def duration(value: object) -> Duration:
    """``3 bytes``, ``260 us``, ``10 ms`` or ``1 s``. Raises ValueError."""
    if isinstance(value, str) and (match := _DURATION.match(value)):
        number = Fraction(match["number"])
        if match["unit"].startswith("byte"):
            return Duration(byte_times=number)
        return Duration(seconds=number * _SECONDS[match["unit"]])
    raise ValueError(f"{shown(value)} is not a time; write 3 bytes, 260 us, 10 ms or 1 s")


#: The number of a message as written: one, or one for each part that it consists of.
Given = int | str | Mapping[str, int | str] | None


@dataclass(frozen=True, slots=True)
class StatedId:
    """The number of a message as written, and what is added to it.

    It is ``own`` unless it is that of the request.
    """

    given: Given
    added: int = 0
    own: bool = True


#: The id of a message in a frame without one.
NO_ID = "none"


@dataclass(frozen=True, slots=True)
class AnswerId:
    """The number of an answer, or what is added to that of the request."""

    number: int | str | Mapping[str, int | str]
    relative: bool = False

    def of(self, request: Given) -> StatedId:
        """The number of the answer to a request, which may not fit the frame."""
        if self.relative:
            assert isinstance(self.number, int)
            return StatedId(request, self.number, own=False)
        return StatedId(self.number)


def answer_id(value: object) -> AnswerId:
    """A number, or ``request.id``, ``request.id + 0x80``, ``request.id - 1``. Raises ValueError."""
    if isinstance(value, AnswerId):
        return value
    if isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return AnswerId(int(value))
    if (
        isinstance(value, dict)
        and value
        and all(type(each) in (int, DecimalNumber, str) for each in value.values())
    ):
        each = {str(name): text if isinstance(text, str) else int(text) for name, text in value.items()}
        return AnswerId(each)
    if isinstance(value, str) and (match := _ANSWER_ID.match(value)):
        number = int(match["number"] or "0", 0)
        return AnswerId(-number if match["sign"] == "-" else number, relative=True)
    if isinstance(value, str) and _TEXT_ID.match(value):
        return AnswerId(value)
    raise ValueError(f"{shown(value)} is not the number of an answer; write 0x85 or request.id + 0x80")


def type_text(text: str) -> TypeText:
    """Split ``u16[0..12]`` into base and count. Raises ValueError."""
    if match := _TYPE.match(text):
        return TypeText(match["base"], match["count"])
    raise ValueError(
        f"{shown(text)} is not a type; write u16, i32, bytes[0..25], u16[4] or the name of a type"
    )


@dataclass(frozen=True, slots=True)
class Wanted:
    """A value, or a range of them; a name is a member of an enum.

    Attributes:
        text: for messages.
        name: name of a member of an enum.
        first: first number.
        last: last number.
        truth: it is true or false.
    """

    text: str
    name: str = ""
    first: int = 0
    last: int = 0
    truth: bool = False


@dataclass(frozen=True, slots=True)
class TestText:
    """What a condition asks of one field."""

    field: str
    wanted: tuple[Wanted, ...]
    negated: bool


def condition(value: object) -> tuple[TestText, ...]:
    """``{kind: 3}``, ``{kind: not 1..5, mode: [auto, 7]}``, or the name of a bool. Raises ValueError."""
    if isinstance(value, str) and value:
        return (TestText(value, (Wanted("'true'", first=1, last=1, truth=True),), negated=False),)
    if not isinstance(value, dict) or not value:
        what = f"{shown(value)} is not a condition"
        raise ValueError(f"{what}; write {{FIELD: value}}, or the name of a bool")
    return tuple(_test(str(name), wanted) for name, wanted in value.items())


def _test(name: str, value: object) -> TestText:
    negated = isinstance(value, str) and value.startswith("not ")
    given = value.removeprefix("not ").strip() if isinstance(value, str) else value
    items = given if isinstance(given, list) else [given]
    if not items:
        raise ValueError(f"{name} has no values; write at least one")
    return TestText(name, tuple(map(wanted, items)), negated)


def wanted(value: object) -> Wanted:
    """``3``, ``1..5``, ``true``, or the name of a member of an enum. Raises ValueError."""
    if isinstance(value, bool):
        return Wanted(shown(value), first=int(value), last=int(value), truth=True)
    if isinstance(value, str) and value in ("true", "false"):
        return wanted(value == "true")
    try:
        found = range_of(value)
    except ValueError:
        if isinstance(value, str) and re.fullmatch(r"[A-Za-z_]\w*", value, re.ASCII):
            return Wanted(shown(value), name=value)
        raise
    if found.first.denominator != 1 or found.last.denominator != 1:
        raise ValueError(f"{shown(value)} is not a whole number; conditions compare numbers on the wire")
    return Wanted(shown(value), first=int(found.first), last=int(found.last))
