"""Integers, scaling and bit fields against arithmetic written down here."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from math import lcm

import pytest

from qlinkgen.model.integer import Integer, byte_chunks
from qlinkgen.model.types import (
    Array,
    BitField,
    Blob,
    Constant,
    Count,
    Length,
    Reserved,
    Role,
    Scalar,
    Scaling,
    Settable,
)

_SCALES = [
    (scale, offset) for scale in ("1/10", "3/4", "7", "5/12", "-2") for offset in ("0", "1/6", "-9/4", "20")
]


def _scalar(bits: int = 8, scaling: Scaling | None = None) -> Scalar:
    chunks = byte_chunks(bits // 8, "big")
    return Scalar(bits=bits, chunks=chunks, minimum=0, maximum=(1 << bits) - 1, scaling=scaling)


@pytest.mark.parametrize(("scale", "offset"), _SCALES)
def test_scaling_is_exact(scale: str, offset: str) -> None:
    step, first = Fraction(scale), Fraction(offset)
    scaling = Scaling(step, first)
    assert scaling.divisor == lcm(step.denominator, first.denominator)
    for raw in (0, 1, 7, 200):
        exact = raw * step + first
        assert Fraction(raw * scaling.factor + scaling.bias, scaling.divisor) == exact
        assert [scaling.raw(exact + step * part / 10) for part in (-4, 0, 4)] == [raw] * 3


@pytest.mark.parametrize(("scale", "offset"), _SCALES)
def test_the_number_in_the_unit_is_as_exact_as_its_type(scale: str, offset: str) -> None:
    scaling = Scaling(Fraction(scale), Fraction(offset))
    for raw in (0, 3, 250):
        exact = raw * scaling.scale + scaling.offset
        short, long = _scalar(8, scaling), _scalar(64, scaling)
        if scaling.divisor == 1:
            assert (short.number, long.number) == ("int", "int")
            assert [short.physical(raw), long.physical(raw)] == [exact, exact]
            continue
        assert (short.number, short.physical(raw)) == ("float", float(exact))
        assert long.number == "decimal"
        assert abs(Fraction(Decimal(str(long.physical(raw)))) - exact) < Fraction(1, 10**15)


def test_a_number_without_scaling_is_what_it_is() -> None:
    assert (_scalar().number, _scalar(64).number) == ("int", "int")
    assert _scalar().physical(200) == 200


@pytest.mark.parametrize("bits", [1, 7, 8, 13, 16, 24])
def test_the_bounds_of_integers(bits: int) -> None:
    size = (bits + 7) // 8
    plain = Integer(bits, signed=False, chunks=byte_chunks(size, "big"))
    signed = Integer(bits, signed=True, chunks=byte_chunks(size, "big"))
    assert (plain.minimum, plain.maximum, plain.mask) == (0, 2**bits - 1, 2**bits - 1)
    assert (signed.minimum, signed.maximum, signed.mask) == (-(2**bits) // 2, 2**bits // 2 - 1, 2**bits - 1)
    for number in {signed.minimum, -1, 0, signed.maximum} - ({1} if bits == 1 else set()):
        assert signed.signed_value(number % 2**bits) == number
        assert plain.signed_value(number % 2**bits) == number % 2**bits


def test_the_mask_of_a_bit_field_is_in_its_place() -> None:
    for bits, shift in ((1, 0), (3, 0), (3, 5), (1, 7)):
        field = BitField("x", shift, Scalar(bits=bits, chunks=(), minimum=0, maximum=1))
        assert field.mask == sum(1 << at for at in range(shift, shift + bits))


def test_who_chooses_a_value() -> None:
    roles = (Settable(), Settable(required=True), Reserved(), Count("run", "items"))
    scalars = [Scalar(bits=8, chunks=(), minimum=0, maximum=1, role=role) for role in roles]
    assert [each.settable for each in scalars] == [True, True, False, False]
    assert [each.required for each in scalars] == [False, True, False, False]


def test_a_length_is_fixed_unless_it_is_counted() -> None:
    assert [Length(*each).fixed for each in ((2, 2), (1, 2), (2, 2, "n"), (1, 2, "n"))] == [
        True,
        False,
        False,
        False,
    ]


def test_a_default_that_is_not_given_is_nothing() -> None:
    assert (_scalar().default, _scalar().role) == (0, Settable())
    assert (Blob(text=False, length=Length(0, 1)).default, Array(_scalar(), Length(0, 1)).default) == (
        b"",
        (),
    )


def test_equal_layouts_are_equal() -> None:
    for one, other in zip(*(_roles() for _ in range(2)), strict=True):
        assert Scalar(bits=8, chunks=(), minimum=0, maximum=1, role=one) == Scalar(
            bits=8, chunks=(), minimum=0, maximum=1, role=other
        )
    assert len({*_roles(), *_roles()}) == len(_roles())


def _roles() -> list[Role]:
    return [
        Settable(),
        Settable(required=True),
        Constant(),
        Reserved(),
        Count("a", "items"),
        Count("a", "bytes"),
    ]
