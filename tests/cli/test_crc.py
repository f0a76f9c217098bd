"""``qlinkgen crc``: names of check values, and those that fit frames."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from typing import Literal

import pytest

from qlinkgen.cli.crc_unknown import recover
from qlinkgen.model.checksum import Algorithm, catalogue
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
    assert result.code == 1
    assert "no check value fits: give whole frames, each in quotes\n" in result.out


def test_a_short_check_value_is_uncertain(qlinkgen: Run) -> None:
    assert "give more frames" in qlinkgen("crc", "680301040516").err
    assert qlinkgen("crc", "").code == 2


ORDERS: tuple[Literal["big", "little"], ...] = ("big", "little")


def frames_of(
    crc: Algorithm, order: Literal["big", "little"], lengths: Sequence[int], seed: int
) -> list[bytes]:
    chance = random.Random(seed)
    found = []
    for size in lengths:
        data = chance.randbytes(size)
        found.append(data + crc.compute(data).to_bytes(crc.width // 8, order))
    return found


@pytest.mark.parametrize("width", [8, 16, 24, 32, 64])
@pytest.mark.parametrize("seed", range(8))
def test_parameters_without_a_name(width: int, seed: int) -> None:
    """Eight frames of three lengths tell all parameters, or those of a CRC that never differs."""
    chance = random.Random(1000 * width + seed)
    reflected = chance.random() < 0.5
    bits = chance.getrandbits
    crc = Algorithm("own", width, bits(width) | 1, bits(width), reflected, reflected, bits(width), 0)
    order = chance.choice(ORDERS)
    frames = frames_of(crc, order, (5, 5, 5, 5, 8, 8, 8, 9), seed)
    found = recover(frames, [width // 8])
    assert found is not None
    assert found.open_bits == 0
    assert (found.algorithm.poly, found.algorithm.refin) == (crc.poly, reflected)
    assert found.place.order == (order if width > 8 else "big")
    for size in range(1, 40):
        data = chance.randbytes(size)
        assert found.algorithm.compute(data) == crc.compute(data)
    one = recover(frames_of(crc, order, (9,) * 8, seed), [width // 8])
    assert one is not None
    assert one.open_bits > 0
    assert one.algorithm.poly == crc.poly


@pytest.mark.parametrize("name", [each.name for each in catalogue() if each.width in {8, 16, 32}][::3])
def test_names_are_among_the_first(qlinkgen: Run, name: str) -> None:
    crc = next(each for each in catalogue() if each.name == name)
    order: Literal["big", "little"] = "little" if crc.refin else "big"
    frames = frames_of(crc, order, (4, 7, 12), 1)
    lines = qlinkgen("crc", *(each.hex() for each in frames)).out.splitlines()
    assert name in [line.split()[0] for line in lines[2:5] if line]


def test_what_is_said_of_own_parameters(qlinkgen: Run) -> None:
    crc = Algorithm("own", 16, 0x1337, 0xBEEF, True, True, 0x5A5A, 0)
    frames = [b"\x55" + each for each in frames_of(crc, "little", (5, 5, 5, 8, 8, 9), 3)]
    done = qlinkgen("crc", *(each.hex() for each in frames))
    assert done.code == 0
    assert "algorithm: {width: 16, poly: 0x1337, init: 0x" in done.out
    assert "refin: true, refout: true, xorout: 0x" in done.out
    assert "byteorder: little" in done.out
    assert not done.err
    open_ = qlinkgen("crc", *(each.hex() for each in frames[:3]))
    assert re.search(r"\d+ bits of init and xorout are open: frames of 1 length fit", open_.err)


def test_data_without_a_check_value() -> None:
    chance = random.Random(9)
    for _ in range(30):
        assert recover([chance.randbytes(10) for _ in range(6)], [2, 4]) is None
    assert recover([b"", b"\1", b"\1\2"], [1]) is None
    assert recover([b"\1\2\3"] * 5, [1, 2]) is None
