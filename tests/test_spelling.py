"""Suggestions for unknown words: typing errors are recognised, and other words give no suggestion."""

from __future__ import annotations

import pytest

from qlinkgen.model.spelling import similar

TYPES = ["u8", "u16", "u24", "u32", "u64", "i8", "i16", "i32", "i64", "bool", "fixed32", "bytes", "text"]
ALGORITHMS = ["arc", "modbus", "xmodem", "b-crc-32", "kermit", "sum8", "sum16", "crc-16/ibm-3740"]


@pytest.mark.parametrize("word", ["algorithm", "payload", "motion", "counter", "node", "type", "unit"])
def test_every_single_typing_error(word: str) -> None:
    known = ["algorithm", "payload", "motion", "counter", "node", "type", "unit"]
    for at in range(len(word)):
        assert similar(word[:at] + word[at + 1 :], known)[:1] == (word,)
        for other in "xq_":
            assert similar(word[:at] + other + word[at:], known) == (word,)
            assert similar(word[:at] + other + word[at + 1 :], known) == (word,)
    for at in range(len(word) - 1):
        assert similar(word[:at] + word[at + 1] + word[at] + word[at + 2 :], known) == (word,)


@pytest.mark.parametrize(
    ("word", "known"),
    [
        ("f32", TYPES), ("f64", TYPES), ("d32", TYPES), ("float", TYPES), ("char", TYPES), ("hex", TYPES),
        ("bcd", TYPES), ("lrc", ALGORITHMS), ("bcc", ALGORITHMS), ("xor", ALGORITHMS), ("lsb", ALGORITHMS),
        ("fcs", ALGORITHMS), ("counts", ["unit", "type", "at"]), ("const", ["doc", "at", "type"]),
        ("", TYPES), ("x", TYPES), ("z" * 10_000, TYPES),
    ],
)  # fmt: skip
def test_other_words(word: str, known: list[str]) -> None:
    assert similar(word, known) == ()


def test_order_case_and_number() -> None:
    assert similar("U23", TYPES) == ("u32",)
    assert similar("crc-16/ibm-3741", ALGORITHMS) == ("crc-16/ibm-3740",)
    assert similar("positions", ["position_", "position", "motor"], most=3) == ("position", "position_")
    assert similar("positions", ["position_", "position"]) == ("position",)


def test_a_swap_is_one_error_anywhere_in_a_word() -> None:
    assert similar("alexnader", ["aexnadr", "alexander"]) == ("alexander",)
    assert similar("alexandre", ["aexandr", "alexander"]) == ("alexander",)
