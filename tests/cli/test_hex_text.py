"""The rule for hex text: the same for arguments, options and standard input, in any chunks."""

from __future__ import annotations

from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qlinkgen.cli.hex_text import HexError, HexReader
from tests.cli.conftest import Run

FRAME = bytes.fromhex("a5a504210315e8")  # motor_position.request of node 3


def read(*pieces: str) -> bytes:
    reader = HexReader()
    return b"".join(map(reader.feed, pieces)) + reader.finish()


#: Ways to write a byte that needs two digits, and one that needs one only.
WIDE = ["{:02x}", "{:02X}", "0x{:02x}", "0X{:02X}"]
NARROW = [*WIDE, "{:x}", "0x{:x}", "{:X}"]


@pytest.mark.parametrize("blank", [" ", "\n", "\t", "  \r\n"])
def test_every_mixture_of_words(blank: str) -> None:
    for wide, narrow, other in product(WIDE, NARROW, NARROW):
        words = [(narrow if each < 16 else wide).format(each) for each in FRAME[:-4]]
        words += [(other if each < 16 else wide).format(each) for each in FRAME[-4:]]
        assert read(blank.join(words)) == FRAME
        assert read(*f"{blank}{blank.join(words)}{blank}") == FRAME


def test_pairs_may_be_grouped() -> None:
    assert read("a5a504 2103", "15e8") == FRAME
    assert read("0xA5A504210315E8") == FRAME
    assert read("0xa5a504", "\n0x210315e8") == FRAME


@pytest.mark.parametrize(
    ("text", "message", "at"),
    [
        ("a5a", "'a5a' is a word with an odd number of hex digits; write two per byte", 0),
        ("a5 a5a 04", "'a5a' is a word with an odd number", 3),
        ("a5 0xa5a", "'0xa5a' is a word with an odd number", 3),
        ("0x", "'0x' has no digit", 0),
        ("a5 0x 4", "'0x' has no digit", 3),
        ("a5 g5", "'g' is not a hex digit; write bytes as pairs of 0-9 and a-f", 3),
        ("a50xa5", "'x' is not a hex digit", 3),
        ("0x0xa5", "'x' is not a hex digit", 3),
        ("x4", "'x' is not a hex digit", 0),
        ("a5-a5", "'-' is not a hex digit", 2),
        ("\u0664\u0662", "'\u0664' is not a hex digit", 0),  # digits, though not of hex
        ("a5 \x1b[0m", "character U+001B is not a hex digit", 3),
        ("\udcff", "byte ff is not a hex digit", 0),
    ],
)
def test_refusals(qlinkgen: Run, text: str, message: str, at: int) -> None:
    with pytest.raises(HexError) as caught:
        HexReader().feed(f"{text}\n")
    assert message in caught.value.message
    assert caught.value.at == at
    if "\udcff" not in text:
        for command in (["decode", "qlink"], ["explain", "qlink"], ["decode", "mc1231a", "00", "--request"]):
            result = qlinkgen(*command, text)
            assert result.code == 2
            assert f"{message}" in result.err
            assert f"(character {at + 1})" in result.err


def test_an_odd_word_in_pieces() -> None:
    with pytest.raises(HexError, match="the digit 'a' ends a word with an odd number"):
        read("a5", "a5a", " 04")


@settings(max_examples=300, deadline=None)
@given(data=st.data())
def test_however_it_is_cut(data: st.DataObject) -> None:
    text = data.draw(st.text("0123aAfFxXg \n", max_size=24))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(text)), max_size=6)))
    pieces = [text[start:end] for start, end in zip([0, *cuts], [*cuts, len(text)], strict=True)]

    def outcome(*pieces: str) -> object:
        try:
            return read(*pieces)
        except HexError as error:
            return "alone" if "odd number" in error.message else error.message

    assert outcome(*pieces) == outcome(text)


@pytest.mark.parametrize(
    "text", ["a5 a5 4 21 3 15 e8", "0xA5 0xA5 0x4 0x21 0x3 0x15 0xE8", "a5a5 4 2103 15e8"]
)
def test_a_good_frame_however_it_is_printed(qlinkgen: Run, text: str) -> None:
    shown = qlinkgen("decode", "qlink", FRAME.hex()).out
    assert '"motor_position.request"' in shown
    assert qlinkgen("decode", "qlink", text).out == shown
    assert qlinkgen("decode", "qlink", *text.split()).out == shown
    assert qlinkgen("decode", "qlink", "-", stdin=text.encode()).out == shown
    assert "no errors" in qlinkgen("explain", "qlink", text).out


def test_line_numbers_of_standard_input(qlinkgen: Run) -> None:
    for text, line in (("a5\n# g\na5a\n", 3), ("a5\n\n0xg", 3), ("a5 a", None), ("# a\na5 a5a # b", 2)):
        result = qlinkgen("decode", "qlink", "-", stdin=text.encode())
        assert (f"standard input, line {line}:" in result.err) is (line is not None)
        if line is None:
            assert "no frame in 2 bytes" in result.err
