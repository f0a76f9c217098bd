"""Floating-point numbers as text, where rounding is hard: the model, Python and construct agree."""

from __future__ import annotations

import math
import random
import struct

import pytest
from construct import ConstructError

from qlinkgen.backends.construct._ftexts import TextReal
from qlinkgen.backends.python._reals import read_real, real
from qlinkgen.model.scientific import Scientific

_FORMATS = {32: ">f", 64: ">d"}


def _value(bits: int, raw: int | None) -> float | None:
    if raw is None:
        return None
    return float(struct.unpack(_FORMATS[bits], raw.to_bytes(bits // 8, "big"))[0])


def _parsed(bits: int, text: bytes) -> float | None:
    try:
        return float(TextReal(bits).parse(text))
    except ConstructError:
        return None


def _read(bits: int, text: bytes) -> float | None:
    number = read_real(text, bits == 32)
    return None if math.isnan(number) else number


@pytest.mark.parametrize(
    ("text", "double", "single"),
    [
        (b"9007199254740993", 9007199254740992.0, 9007199254740992.0),  # a tie
        (b"9007199254740993.00001", 9007199254740994.0, 9007199254740992.0),
        (b"1.00000005960464477539", 1.0000000596046448, 1.0),  # below a tie of singles, at a double
        (b"1.00000005960464477540", 1.0000000596046448, 1.0000001192092896),
        (b"2.2250738585072011E-308", 2.2250738585072011e-308, 0.0),
        (b"4.9E-324", 5e-324, 0.0),
        (b"2.4E-324", 0.0, 0.0),
        (b"7.1E-46", 7.1e-46, 1.401298464324817e-45),
        (b"1.7976931348623158E+308", 1.7976931348623157e308, None),
        (b"1.7976931348623159E308", None, None),
        (b"3.40282356E+38", 3.40282356e38, 3.4028234663852886e38),
        (b"3.40282357E38", 3.40282357e38, None),
        (b"+.5", 0.5, 0.5),
        (b"5.", 5.0, 5.0),
        (b"-0e9999999", -0.0, -0.0),
        (b"1e-9999999", 0.0, 0.0),
        (b"1e9999999", None, None),
        (b".", None, None),
        (b"E5", None, None),
        (b"1E", None, None),
        (b"1_0", None, None),
        (b"nan", None, None),
        (b"--1", None, None),
    ],
)
def test_the_nearest_number_is_read(text: bytes, double: float | None, single: float | None) -> None:
    for bits, expected in ((64, double), (32, single)):
        found = [_value(bits, Scientific(bits).number(text)), _read(bits, text), _parsed(bits, text)]
        assert found == [expected] * 3
        signs = [None if each is None else math.copysign(1, each) for each in (*found, expected)]
        assert len({*signs}) == 1


@pytest.mark.parametrize("bits", [32, 64])
def test_the_fewest_digits_are_sent(bits: int) -> None:
    rng, form = random.Random(bits), Scientific(bits)
    for _ in range(200):
        raw = rng.getrandbits(bits)
        value = _value(bits, raw)
        assert value is not None
        if math.isfinite(value):
            text = form.text(raw)
            assert form.number(text) == raw
            assert {real(value, bits == 32), TextReal(bits).build(value)} == {text}
            if bits == 64:
                assert len(text.partition(b"E")[0]) <= len(f"{value:.17g}".partition("e")[0]) + 2
    assert form.text(0) == b"0E+00"
    assert form.number(form.text(form.highest)) is None  # NaN
