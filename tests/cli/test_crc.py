"""``qlinkgen crc``: names of check values, and those that fit frames."""

from __future__ import annotations

import pytest

from tests.cli.conftest import Run


def test_every_check_value_is_listed(qlinkgen: Run) -> None:
    lines = qlinkgen("crc", "list").out.splitlines()
    names = [line.split()[0] for line in lines[3:] if line]
    assert {
        "crc-8/smbus",
        "xor8",
        "sum8-zero",
        "crc-16/modbus",
        "fletcher-8",
        "adler-32",
        "crc-64/xz",
    } <= set(names)
    assert len(names) == len(set(names))
    short = qlinkgen("crc", "list", "--width", "8").out
    assert "xor8" in short
    assert "crc-16" not in short


@pytest.mark.parametrize(
    ("frames", "found"),
    [
        (("01 03 00 6B 00 03 74 17", "010300000002c40b"), "crc-16/modbus 2 little all before it"),
        (("B5620A0400000E34", "B562010600000716"), "fletcher-8 2 little all before it from byte 2 on"),
        (
            ("68 03 01 04 16", "68 07 09 10 16", "68 ff 00 ff 16"),
            "sum8 1 all before it from byte 1 on 1 byte follows",
        ),
        (("056414f3010000040a3b",), "crc-16/dnp 2 little all before it"),
    ],
)
def test_what_fits_all_frames(qlinkgen: Run, frames: tuple[str, ...], found: str) -> None:
    result = qlinkgen("crc", *frames)
    assert result.code == 0
    assert found in [" ".join(line.split()) for line in result.out.splitlines()]


def test_nothing_fits(qlinkgen: Run) -> None:
    result = qlinkgen("crc", "0102030405060708", "1112131415161799", "21", "deadbeef00c0ffee")
    assert (result.code, result.out) == (1, "no check value fits: give whole frames, each in quotes\n")


def test_a_short_check_value_is_uncertain(qlinkgen: Run) -> None:
    assert "give more frames" in qlinkgen("crc", "680301040516").err
    assert qlinkgen("crc", "").code == 2
