"""Conversion of scaled values to raw numbers."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.backends.python._digits import decimal, read_decimal
from qlinkgen.backends.python._support import OutOfRange, Scale
from qlinkgen.model.digits import Digits

SCALES = (
    Scale(0, 90_000_000, divisor=10_000),
    Scale(-999_999, 9_999_999, divisor=10),
    Scale(-(1 << 31), (1 << 31) - 1, factor=3, bias=-7, divisor=10_000_000),
    Scale(0, 255, factor=-2, bias=512),
    Scale(0, (1 << 64) - 1, divisor=1000),
    Scale(0, 255, factor=1 << 60, divisor=10**400),
)


@pytest.mark.parametrize("scale", SCALES, ids=range(len(SCALES)))
@given(data=st.data())
def test_floats_give_the_nearest_raw_number(scale: Scale, data: st.DataObject) -> None:
    """Also beside the middle of two, where the usual arithmetic errs, and at both ends."""
    steps = data.draw(st.integers(scale.low - 1, scale.high + 1))
    apart = data.draw(st.sampled_from((-0.5, -0.4999999, 0.0, 0.25, 0.4999999, 0.5)))
    try:
        value = (steps + apart) * scale.factor / scale.divisor + scale.bias / scale.divisor
    except OverflowError:
        value = 0.0
    exact = (Fraction(value) * scale.divisor - scale.bias) / scale.factor
    nearest = round(exact)
    if scale.low <= nearest <= scale.high:
        assert scale.raw(value) == nearest
    else:
        with pytest.raises(OutOfRange):
            scale.raw(value)


@given(number=st.integers(-(10**9), 10**9), least=st.integers(1, 12), point=st.integers(1, 6))
def test_decimal_texts(number: int, least: int, point: int) -> None:
    text = Digits(10, least, 20, point).text(number)
    assert decimal(number, least, point) == text
    assert read_decimal(text, point, -(10**9), 10**9) == number


@given(text=st.text("+-.0123456789", max_size=8), point=st.integers(0, 3), low=st.sampled_from((0, -99999)))
def test_texts_that_are_numbers(text: str, point: int, low: int) -> None:
    number = Digits(10, 1, 8, point).number(text.encode())
    signed = text[:1] in {"+", "-"} and low == 0
    found = read_decimal(text.encode(), point, low, 10**7)
    if number is not None and not signed and low <= number <= 10**7:
        assert found == number
    else:
        assert found > 10**7
