"""The values of a message as native Python objects, as raw integers, and in JSON.

Native values are those of generated Python and construct: int, bool, float or Decimal in the field's unit, an
int for enums and flags, bytes, str, a list of the values of its items; a record is a mapping of its values.
In JSON, bytes are hex strings, enums their name (a number if unknown), flags an integer, scaled values
numbers in the unit with all their digits, infinities and NaN the texts "inf", "-inf" and "nan", records
objects.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from typing import SupportsInt, TypeAlias, assert_never

from qlinkgen.model.fields import Layout, Record, Records, Value, applies, chosen
from qlinkgen.model.spelling import similar
from qlinkgen.model.types import Array, Blob, Enum, Flags, Float, Scalar

#: A JSON value; numbers with a decimal point are read as Decimal.
Json: TypeAlias = "str | int | float | Decimal | Sequence[Json] | Mapping[str, Json] | None"
Item = int | bool | float | Decimal
Native: TypeAlias = (
    "Item | bytes | str | list[Item] | list[int]"
    " | Mapping[str, Native] | Sequence[Mapping[str, Native]] | None"
)


#: No number of a protocol is nearly as long; Python refuses to convert one of more than 4300 digits.
_WHOLE = re.compile(r"[+-]?(0[xX][0-9a-fA-F]{1,1000}|0[bB][01]{1,1000}|[0-9]{1,1000})")
_DECIMAL = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
#: Floating-point numbers that JSON has no notation for.
_NOT_FINITE = {"nan": math.nan, "inf": math.inf, "+inf": math.inf, "-inf": -math.inf}


class BadValue(ValueError):
    """A value is illegal for its field; the text names the field, the value and the rule."""


def default_of(value: Value) -> Native:
    """The native default of a field, None if a new message does not have it."""
    kind = value.type
    if not value.field.given:
        return None
    match kind:
        case Scalar():
            return native_from_raw(kind, kind.default)
        case Array():
            return [native_from_raw(kind.item, raw) for raw in kind.default]
        case Blob():
            return kind.default.decode("ascii") if kind.text else kind.default
        case Record():
            return defaults_of(kind.layout)
        case Records():
            return [defaults_of(kind.layout) for _ in range(kind.length.minimum)]
        case _:
            assert_never(kind)


def defaults_of(layout: Layout) -> Mapping[str, Native]:
    """The native defaults of a record."""
    found: dict[str, Native] = {}
    for value in layout.values:
        if found.get(value.name) is None:
            found[value.name] = default_of(value)
    return found


def native_from_raw(scalar: Scalar, raw: int) -> Item:
    """The native value of a raw integer."""
    return bool(raw) if scalar.meaning == "bool" else scalar.physical(raw)


def raw_from_native(value: Value, native: Native) -> int:
    """The raw integer of a native number: the nearest step, in range. Raises BadValue."""
    scalar = value.type
    assert isinstance(scalar, Scalar)
    return raw_number(value.name, scalar, native)


def raw_number(name: str, scalar: Scalar, native: Native) -> int:
    """Like `raw_from_native`, for a value or an item of a list."""
    if native is None or isinstance(native, bytes | str | Sequence | Mapping):
        raise BadValue(f"{name}: {_shown(native)} is not a number")
    if isinstance(scalar.meaning, Float):
        return _raw_float(name, scalar, scalar.meaning, native)
    if isinstance(native, float) and not math.isfinite(native):
        raise BadValue(f"{name}: {_shown(native)} is not a number")
    if isinstance(native, Decimal) and not native.is_finite():
        raise BadValue(f"{name}: {native} is not a number")
    exact = Fraction(native)
    if scalar.scaling is None and exact.denominator != 1:
        raise BadValue(f"{name}: {native} is not a whole number")
    raw = scalar.scaling.raw(exact) if scalar.scaling else int(exact)
    if not scalar.minimum <= raw <= scalar.maximum:
        raise _out_of_range(name, scalar, native)
    return raw


def _raw_float(name: str, scalar: Scalar, kind: Float, native: Item) -> int:
    try:
        value = float(native)
        raw = kind.raw(value)
    except OverflowError:
        raise BadValue(f"{name}: {native} is too large for {kind.name}") from None
    if not kind.allows(value):
        raise _out_of_range(name, scalar, native)
    return raw


def _out_of_range(name: str, scalar: Scalar, native: Item) -> BadValue:
    low, high = scalar.span
    unit = f" {scalar.unit}" if scalar.unit else ""
    return BadValue(f"{name}: {native} is out of range; {low}..{high}{unit} can be sent")


def to_json(value: Value, native: Native) -> Json:
    """The JSON value of a native value; a Decimal is kept, so that the writer can print all its digits."""
    kind = value.type
    if native is None:
        return None
    if isinstance(kind, Record):
        assert isinstance(native, Mapping)
        return {
            each.name: to_json(each, native[each.name]) for each in chosen(kind.layout.values, native.get)
        }
    if isinstance(kind, Records):
        assert isinstance(native, Sequence)
        one = replace(value, type=Record(kind.layout))
        return [to_json(one, each) for each in native]
    if isinstance(kind, Blob):
        assert isinstance(native, bytes | str)
        return native.hex() if isinstance(native, bytes) else native
    if isinstance(kind, Array):
        assert isinstance(native, list)
        return [_item_to_json(kind.item, item) for item in native]
    if isinstance(kind.meaning, Flags):
        assert isinstance(native, SupportsInt)
        return int(native)  # construct has a class of its own, which is a mapping too
    assert not isinstance(native, bytes | str | Sequence | Mapping)
    return _item_to_json(kind, native)


def _item_to_json(scalar: Scalar, native: Item) -> str | Item:
    if isinstance(scalar.meaning, Enum):
        assert isinstance(native, int)
        return scalar.meaning.name_of(native) or int(native)
    if isinstance(scalar.meaning, Flags):
        return int(native)
    if isinstance(native, float) and not math.isfinite(native):
        return str(native)
    return native


def from_json(value: Value, given: Json) -> Native:
    """The native value of a JSON value or a command line argument.

    Accepts the output of :func:`to_json`, enum numbers, lists of flag names, and numbers as text (also 0x and
    0b). Raises BadValue; ranges are checked by the encoder and by :func:`check_items`.
    """
    kind = value.type
    if value.field.conditional and given is None:
        return None
    if isinstance(kind, Record):
        return _record(value.name, kind.layout, _parsed(given, "{"))
    if isinstance(kind, Records):
        items = _parsed(given, "[")
        if not isinstance(items, Sequence) or isinstance(items, str):
            raise BadValue(f"{value.name}: {_shown(given)} is not a list of records")
        return [_record(f"{value.name}[{index}]", kind.layout, item) for index, item in enumerate(items)]
    if isinstance(kind, Blob):
        return _blob(value.name, kind, given)
    if isinstance(kind, Array):
        return [_item_from_json(value.name, kind.item, item) for item in _listed(value.name, given)]
    return _item_from_json(value.name, kind, given)


def natives_of(values: Sequence[Value], given: Mapping[str, Json], owner: str = "") -> dict[str, Native]:
    """The native values of those given, by name, and those that a condition on them decides.

    These are the default or None; of a choice, the value of the case which is sent.

    ``owner`` precedes the names in errors.
    """
    plain = [value for value in values if not value.field.slot]
    found = {each.name: _of_json(each, given, owner) for each in plain if each.name in given}
    numbers = {each.name: found.get(each.name, default_of(each)) for each in plain}
    for each in plain:
        if each.field.when and each.name not in given:
            numbers[each.name] = found[each.name] = _usual(each, numbers.get)
    for each in chosen(values, numbers.get):
        if each.field.slot:
            found[each.name] = (
                _of_json(each, given, owner) if each.name in given else _usual(each, numbers.get)
            )
    return found


def _usual(case: Value, native: Callable[[str], Native]) -> Native:
    """The default of a case that is sent."""
    sent = applies(case.field.when, native) and not case.type.required
    return default_of(replace(case, field=replace(case.field, given=sent)))


def _of_json(value: Value, given: Mapping[str, Json], owner: str) -> Native:
    return from_json(replace(value, name=owner + value.name), given[value.name])


def _item_from_json(name: str, scalar: Scalar, given: Json) -> Item:
    meaning = scalar.meaning
    if isinstance(meaning, Enum) and isinstance(given, str):
        names = {member.name: member.value for member in meaning.members}
        return names[given] if given in names else _named_or_number(name, given, names)
    if isinstance(meaning, Flags) and not isinstance(given, int):
        return _flags(name, meaning, given)
    if meaning == "bool":
        return _bool(name, given)
    if isinstance(meaning, Float) and isinstance(given, str) and given.lower() in _NOT_FINITE:
        return _NOT_FINITE[given.lower()]
    if scalar.number == "int":
        return _whole(name, given)
    return _number(name, given, exact=scalar.number == "decimal")


def check_items(value: Value, native: Native) -> None:
    """Check the number of items of a list, and the range of each. Raises BadValue."""
    kind = value.type
    if isinstance(kind, Record) and isinstance(native, Mapping):
        for each in chosen(kind.layout.values, native.get):
            check_items(_inside(value.name, each), native[each.name])
    if not isinstance(kind, Array | Records) or not isinstance(native, list):
        return
    number, low, high = len(native), kind.length.minimum, kind.length.maximum
    if not low <= number <= high:
        limit = f"at most {high}" if number > high else f"at least {low}"
        raise BadValue(f"{value.name}: {number} item{'' if number == 1 else 's'}; {limit}")
    if isinstance(kind, Records):
        for index, item in enumerate(native):
            assert isinstance(item, Mapping)
            check_items(replace(value, name=f"{value.name}[{index}]", type=Record(kind.layout)), item)
        return
    first, last = kind.item.span
    for index, item in enumerate(native):
        if not first <= item <= last and not (isinstance(item, float) and _takes_nan(kind.item)):
            raise BadValue(f"{value.name}[{index}]: {item} is out of range {first}..{last}")


def _takes_nan(scalar: Scalar) -> bool:
    return isinstance(scalar.meaning, Float) and scalar.meaning.bounds is None


def _inside(name: str, value: Value) -> Value:
    """A value of a record, named for errors."""
    return replace(value, name=f"{name}.{value.name}")


def _parsed(given: Json, opening: str) -> Json:
    """Text of a command line that is JSON."""
    if not isinstance(given, str) or not given.lstrip().startswith(opening):
        return given
    try:
        parsed: Json = json.loads(given, parse_float=Decimal)
    except ValueError:
        return given
    return parsed


def _record(name: str, layout: Layout, given: Json) -> Mapping[str, Native]:
    values = {value.name: value for value in layout.values}
    if not isinstance(given, Mapping):
        known = ", ".join(f'"{each}": VALUE' for each in values)
        raise BadValue(f"{name}: {_shown(given)} is not a record; write {{{known}}}")
    if unknown := [each for each in given if each not in values]:
        raise BadValue(f"{name}: a record {layout.name} has no '{unknown[0]}'; it has {', '.join(values)}")
    if missing := [each for each, value in values.items() if value.required and each not in given]:
        raise BadValue(f"{name}: {', '.join(missing)} has no default; add it")
    own = natives_of(layout.values, given, f"{name}.")
    numbers = {value.name: default_of(value) for value in layout.values if not value.field.slot} | own
    return {
        value.name: own.get(value.name, default_of(value)) for value in chosen(layout.values, numbers.get)
    }


def whole_number(text: str) -> int | None:
    """The value of a decimal, 0x or 0b number; None for other text."""
    if not _WHOLE.fullmatch(text):
        return None
    plain = text.lstrip("+-").lower()
    number = int(plain, {"0x": 16, "0b": 2}.get(plain[:2], 10))
    return -number if text.startswith("-") else number


def _shown(given: Json) -> str:
    """A value for an error text, in JSON notation."""
    if isinstance(given, str):
        return f"'{given}'"
    if isinstance(given, Decimal):
        return str(given)
    if isinstance(given, list | tuple):
        return f"[{', '.join(map(_shown, given))}]"
    if isinstance(given, Mapping):
        return f"{{{', '.join(f'{_shown(name)}: {_shown(each)}' for name, each in given.items())}}}"
    return given.hex() if isinstance(given, bytes) else json.dumps(given)


def _blob(name: str, kind: Blob, given: Json) -> bytes | str:
    if not isinstance(given, str):
        fix = "the characters" if kind.text else "hex digits"
        raise BadValue(f"{name}: {_shown(given)} is not text; write {fix}")
    if kind.text:
        return given
    try:
        return bytes.fromhex(given[2:] if given[:2].lower() == "0x" else given)
    except ValueError:
        raise BadValue(f"{name}: '{given}' is not a byte string; write pairs of hex digits") from None


def _listed(name: str, given: Json) -> Sequence[Json]:
    if isinstance(given, str):
        return _split(name, given)
    if isinstance(given, Sequence):
        return given
    raise BadValue(f"{name}: {_shown(given)} is not a list; write numbers with commas between them")


def _split(name: str, given: str) -> list[str]:
    """The items of `1,2`, `1 2`, `[1, 2]` or `["a", "b"]`."""
    text = given.strip()
    if text.startswith("["):
        if not text.endswith("]"):
            raise BadValue(f"{name}: '{given}' begins with [ but does not end with ]")
        text = text[1:-1]
    groups = [group.split() for group in text.split(",")] if text.strip() else []
    if not all(groups):
        raise BadValue(f"{name}: '{given}' has an empty item; write a value on both sides of each comma")
    items = [item for group in groups for item in group]
    return [item[1:-1] if len(item) > 1 and item[0] == item[-1] == '"' else item for item in items]


def _whole(name: str, given: Json) -> int:
    number = whole_number(given) if isinstance(given, str) else given
    if isinstance(number, bool) or not isinstance(number, int):
        raise BadValue(f"{name}: {_shown(given)} is not a whole number")
    return number


def _number(name: str, given: Json, *, exact: bool) -> int | float | Decimal:
    number = given
    if isinstance(given, str):
        whole = whole_number(given)
        number = (
            Decimal(whole) if whole is not None else Decimal(given) if _DECIMAL.fullmatch(given) else None
        )
    if isinstance(number, bool) or not isinstance(number, int | float | Decimal):
        raise BadValue(f"{name}: {_shown(given)} is not a number")
    return float(number) if isinstance(number, Decimal) and not exact else number


def _bool(name: str, given: Json) -> bool:
    known: Mapping[str | int, bool] = {"true": True, "false": False, "1": True, "0": False, 1: True, 0: False}
    key = given.lower() if isinstance(given, str) else given
    if isinstance(key, str | int) and key in known:
        return known[key]
    raise BadValue(f"{name}: {_shown(given)} is neither true nor false")


def _named_or_number(name: str, given: Json, names: Mapping[str, int]) -> int:
    number = whole_number(given) if isinstance(given, str) else given
    if isinstance(number, bool) or not isinstance(number, int):
        close = similar(given, names) if isinstance(given, str) else ()
        meant = f"did you mean {close[0]}? It is " if close else ""
        raise BadValue(f"{name}: {_shown(given)} is unknown; {meant}one of {', '.join(names)}, or a number")
    return number


def _flags(name: str, flags: Flags, given: Json) -> int:
    bits = {member.name: 1 << member.value for member in flags.members}
    total = 0
    for item in _listed(name, given.replace("|", ",") if isinstance(given, str) else given):
        total |= bits[item] if isinstance(item, str) and item in bits else _named_or_number(name, item, bits)
    return total
