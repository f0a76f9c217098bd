"""The display of a keypad."""

from __future__ import annotations

import pytest

from qlinkgen.protocols.trio import CHR, CURSOR, Display


def shown(*pieces: str) -> Display:
    display = Display()
    for piece in pieces:
        display.feed(piece)
    return display


def test_it_has_four_rows_of_twenty() -> None:
    display = shown("x" * 79, "y")
    assert [len(line) for line in display.lines] == [20] * 4
    assert display.text.endswith("y")
    assert display.place == 0
    display.feed("z")
    assert display.lines[0][0] == "z", "the cursor wraps around"


def test_clear_and_home() -> None:
    display = shown("old text", CHR(12))
    assert display.lines == [""] * 4
    display.feed("a" + CHR(14) + "b")
    assert display.lines[0] == "b"
    assert display.place == 1


def test_the_cursor_gets_invisible() -> None:
    display = shown("a")
    assert display.cursor_visible
    display.feed(CHR(20))
    assert not display.cursor_visible


def test_the_cursor_moves() -> None:
    display = shown(CURSOR(28) + "R", CHR(27) + CHR(72) + CHR(7) + "S")
    assert display.lines == [" " * 7 + "S", " " * 8 + "R", "", ""]
    display.feed(CURSOR(79) + "e")
    assert display.lines[3] == " " * 19 + "e"


@pytest.mark.parametrize("place", [12, 13, 14, 20, 27])
def test_a_place_that_looks_like_a_control_character(place: int) -> None:
    display = shown("keep", CURSOR(place), "x")
    assert display.place == place + 1
    assert display.lines[0].startswith("keep")


def test_a_sequence_may_be_spread_over_messages() -> None:
    assert shown(CHR(27), CHR(72), CHR(20), "x").lines[1] == "x"


def test_lines_end() -> None:
    assert shown("SPEED:\r\n", "LENGTH:\r\n").lines == ["SPEED:", "LENGTH:", "", ""]
    assert shown(CURSOR(65), "\r\nx").lines[0] == "x", "below the last row comes the first"


@pytest.mark.parametrize("text", [CHR(1), CHR(127), CHR(27) + "J", CURSOR(80)])
def test_what_means_nothing_is_counted(text: str) -> None:
    display = shown(text, "x")
    assert display.ignored == 1
    assert display.lines[0] == "x"


@pytest.mark.parametrize(("rows", "columns"), [(0, 20), (4, 0), (8, 20)])
def test_it_has_places(rows: int, columns: int) -> None:
    with pytest.raises(ValueError, match="1 to 128 places"):
        Display(rows, columns)
