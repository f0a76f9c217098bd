"""Values as a caller and a command line write them: what is taken, and what is said of the rest."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import pytest

from qlinkgen.model.integer import byte_chunks
from qlinkgen.model.message import Field, Value
from qlinkgen.model.types import Array, Blob, Enum, Flags, Length, NamedValue, Scalar, Scaling
from qlinkgen.model.values import (
    BadValue,
    Item,
    Json,
    check_items,
    from_json,
    raw_from_native,
    to_json,
    whole_number,
)

_U8 = Scalar(bits=8, chunks=byte_chunks(1, "big"), minimum=0, maximum=255)
_MODE = Enum("mode", 8, (NamedValue("slow", 1), NamedValue("fast", 4)), doc="")
_BITS = Flags("bits", 8, (NamedValue("ready", 0), NamedValue("hot", 3)), doc="")


def _value(kind: Scalar | Blob | Array) -> Value:
    return Value("x", kind, "", Field("x", kind))


def _scalar(
    minimum: int = 0,
    maximum: int = 255,
    scaling: Scaling | None = None,
    meaning: Enum | Flags | None = None,
    *,
    truth: bool = False,
    bits: int = 8,
) -> Value:
    return _value(
        Scalar(
            bits=bits,
            chunks=byte_chunks(bits // 8, "big"),
            minimum=minimum,
            maximum=maximum,
            scaling=scaling,
            meaning="bool" if truth else meaning,
        )
    )


_INT, _BOOL = _scalar(), _scalar(0, 1, truth=True)
_ENUM, _FLAGS = _scalar(meaning=_MODE), _scalar(meaning=_BITS)
_TENTHS, _LONG = _scalar(scaling=Scaling(Fraction(1, 10))), _scalar(scaling=Scaling(Fraction(1, 10)), bits=64)
_BYTES, _TEXT = _value(Blob(text=False, length=Length(0, 9))), _value(Blob(text=True, length=Length(0, 9)))
_LIST = _value(Array(Scalar(bits=8, chunks=_U8.chunks, minimum=2, maximum=9), Length(1, 3)))


@pytest.mark.parametrize(
    ("value", "given", "native"),
    [
        (_INT, 7, 7),
        (_INT, "0x1F", 31),
        (_INT, "-0b101", -5),
        (_INT, "+12", 12),
        (_BOOL, "TRUE", True),
        (_BOOL, "false", False),
        (_BOOL, "true", True),
        (_BOOL, "1", True),
        (_BOOL, "0", False),
        (_BOOL, 0, False),
        (_BOOL, 1, True),
        (_BOOL, False, False),
        (_ENUM, "fast", 4),
        (_ENUM, "0x09", 9),
        (_ENUM, 1, 1),
        (_FLAGS, "ready|hot", 9),
        (_FLAGS, "hot", 8),
        (_FLAGS, ["ready", 2], 3),
        (_FLAGS, 5, 5),
        (_TENTHS, "1.5", 1.5),
        (_TENTHS, "0x10", 16.0),
        (_LONG, "1.5", Decimal("1.5")),
        (_LONG, 3, 3),
        (_BYTES, "0XA501", b"\xa5\x01"),
        (_BYTES, "a5 01", b"\xa5\x01"),
        (_BYTES, "", b""),
        (_TEXT, "0x1", "0x1"),
        (_LIST, "1,2", [1, 2]),
        (_LIST, "1 2 ,3", [1, 2, 3]),
        (_LIST, " [1, 2] ", [1, 2]),
        (_LIST, '["1", "0x2"]', [1, 2]),
        (_LIST, "[]", []),
        (_LIST, "", []),
        (_LIST, [3, "4"], [3, 4]),
    ],
)
def test_what_is_taken(value: Value, given: Json, native: object) -> None:
    found = from_json(value, given)
    assert (found, type(found)) == (native, type(native))


@pytest.mark.parametrize(
    ("value", "given", "text"),
    [
        (_INT, "1.5", "'1.5' is not a whole number"),
        (_INT, True, "true is not a whole number"),
        (_INT, [1, "a"], "[1, 'a'] is not a whole number"),
        (_BOOL, "yes", "'yes' is neither true nor false"),
        (_ENUM, "quick", "'quick' is unknown; one of slow, fast, or a number"),
        (_FLAGS, ["cold"], "'cold' is unknown; one of ready, hot, or a number"),
        (_TENTHS, "ten", "'ten' is not a number"),
        (_BYTES, "a", "'a' is not a byte string; write pairs of hex digits"),
        (_BYTES, 5, "5 is not text; write hex digits"),
        (_TEXT, {"a": 1}, "{'a': 1} is not text; write the characters"),
        (_LIST, 5, "5 is not a list; write numbers with commas between them"),
        (_LIST, "[1, 2", "'[1, 2' begins with [ but does not end with ]"),
        (_LIST, "1,,2", "'1,,2' has an empty item; write a value on both sides of each comma"),
        (_LIST, '1,"', "'\"' is not a whole number"),
        (_LIST, '1,"2', "'\"2' is not a whole number"),
        (_LIST, "1,'2'", "''2'' is not a whole number"),
    ],
)
def test_what_is_refused(value: Value, given: Json, text: str) -> None:
    with pytest.raises(BadValue) as caught:
        from_json(value, given)
    assert str(caught.value) == f"x: {text}"


def test_json_has_names_where_there_are_any() -> None:
    assert [to_json(_ENUM, number) for number in (0, 1, 4, 5)] == [0, "slow", "fast", 5]
    assert to_json(_FLAGS, 9) == 9
    assert to_json(_LIST, [2, 3]) == [2, 3]
    assert (to_json(_BYTES, b"\xa5"), to_json(_TEXT, "a")) == ("a5", "a")
    assert to_json(_LONG, Decimal("0.1")) == Decimal("0.1")


@pytest.mark.parametrize(
    ("items", "text"),
    [
        ([2], ""),
        ([2, 9, 5], ""),
        ([], "x: 0 items; at least 1"),
        ([2, 2, 2, 2], "x: 4 items; at most 3"),
        ([2, 1], "x[1]: 1 is out of range 2..9"),
        ([10, 2], "x[0]: 10 is out of range 2..9"),
    ],
)
def test_items_are_counted_and_in_range(items: list[Item], text: str) -> None:
    _checked(_LIST, items, text)


def test_one_item_is_one_item() -> None:
    _checked(_value(Array(_U8, Length(2, 2))), [1], "x: 1 item; at least 2")
    _checked(_value(Array(_U8, Length(0, 0))), [1], "x: 1 item; at most 0")


def _checked(value: Value, items: list[Item], text: str) -> None:
    if not text:
        check_items(value, items)
        return
    with pytest.raises(BadValue) as caught:
        check_items(value, items)
    assert str(caught.value) == text


def test_numbers_go_to_the_nearest_step_in_range() -> None:
    tenths = _scalar(3, 9, Scaling(Fraction(1, 10), Fraction(1)))
    assert [raw_from_native(tenths, each) for each in (1.3, 1.44, Decimal("1.9"))] == [3, 4, 9]
    for wrong in (1.2, 2.0):
        with pytest.raises(BadValue, match=rf"x: {wrong} is out of range; 1\.3\.\.1\.9 can be sent"):
            raw_from_native(tenths, wrong)
    assert [raw_from_native(_scalar(3, 9), each) for each in (3, 9)] == [3, 9]
    for wrong in (2, 10):
        with pytest.raises(BadValue, match=rf"x: {wrong} is out of range; 3\.\.9 can be sent"):
            raw_from_native(_scalar(3, 9), wrong)
    with pytest.raises(BadValue, match=r"x: 3\.5 is not a whole number"):
        raw_from_native(_scalar(3, 9), 3.5)
    for odd in (float("nan"), Decimal("inf"), "3"):
        with pytest.raises(BadValue, match="is not a number"):
            raw_from_native(_scalar(3, 9), odd)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("7", 7),
        ("-0x10", -16),
        ("+0b11", 3),
        ("0X1f", 31),
        ("007", 7),
        ("", None),
        ("1.0", None),
        ("0xg", None),
    ],
)
def test_whole_numbers(text: str, number: int | None) -> None:
    assert whole_number(text) == number


def test_the_unit_of_a_list_is_that_of_its_items() -> None:
    metres = Scalar(bits=8, chunks=_U8.chunks, minimum=0, maximum=255, unit="m")
    values = [
        _value(each) for each in (metres, Array(metres, Length(1, 3)), Blob(text=True, length=Length(0, 9)))
    ]
    assert [each.unit for each in values] == ["m", "m", ""]
