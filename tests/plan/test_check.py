"""Check values over bytes and over words, sent whole or in part."""

from __future__ import annotations

import binascii

import pytest

from qlinkgen.model.checksum import find
from qlinkgen.model.frame import Checksum
from qlinkgen.model.integer import Chunk, byte_chunks
from qlinkgen.plan.check import Check

_DATA = bytes(range(1, 8)) + b"\xff\xfe"


def _value(name: str) -> Checksum:
    algorithm = find(name)
    return Checksum(algorithm, byte_chunks((algorithm.width + 7) // 8, "big"), ("data",))


@pytest.mark.parametrize("name", ["sum8", "sum16", "sum8-inverted"])
def test_a_sum_is_of_bytes_unless_words_are_said(name: str) -> None:
    check = Check(_value(name))
    total = sum(_DATA) % (1 << check.algorithm.width)
    assert check.of(_DATA) == (255 - total if name == "sum8-inverted" else total)
    assert check.of(_DATA[:3], _DATA[3:]) == check.of(_DATA)


def test_words_of_a_sum_do_not_reach_from_one_run_into_the_next() -> None:
    check = Check(_value("sum16"), word=2, chained=True)
    assert check.of(b"\x12\x34\x56", b"\x78\x9a", start=5) == (5 + 0x1234 + 0x56 + 0x789A) % 0x10000
    assert check.of(b"\xff\xff", b"\x00\x02") == 1


def test_a_crc_is_of_all_bytes() -> None:
    check = Check(_value("crc-16/xmodem"))
    assert check.of(_DATA[:2], _DATA[2:]) == binascii.crc_hqx(_DATA, 0)


def test_a_value_in_part_is_not_complete() -> None:
    whole, part = _value("sum16"), Checksum(find("sum16"), (Chunk(8, 7), Chunk(0, 7)), ("data",))
    assert (Check(whole).complete, Check(part).complete) == (True, False)
    assert (Check(whole).regular, Check(part).regular) == ("big", None)
    assert Check(part).pack(0xFFFF) == b"\x7f\x7f"
    assert Check(part).unpack(b"\x7f\x01") == 0x7F01
    assert Check(part).mask == 0x7F7F
