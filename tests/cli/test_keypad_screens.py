"""Displays of keypads on a terminal."""

from __future__ import annotations

import pytest

from qlinkgen.cli.keypad_screens import DrawnScreens, JsonScreens
from qlinkgen.protocols.trio import Display


def test_drawn_over_the_last_state_unless_text_was_printed_below(capsys: pytest.CaptureFixture[str]) -> None:
    display = Display()
    screens = DrawnScreens({2: display}, 2, "")
    screens.show(0.0)
    assert "\x1b[8A" not in capsys.readouterr().out
    screens.show(0.1)
    assert capsys.readouterr().out == "", "nothing has changed"
    display.feed("a")
    screens.show(0.2)
    assert capsys.readouterr().out.startswith("\x1b[8A")
    screens.leave()
    display.feed("b")
    screens.show(0.3)
    shown = capsys.readouterr().out
    assert "\x1b[8A" not in shown
    assert "|ab                  |" in shown


def test_a_display_is_printed_when_it_stays_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    display = Display(1, 4)
    screens = JsonScreens({2: display})
    for at, text in enumerate(("", "a", "b", "", "c")):
        display.feed(text)
        screens.show(at)
    screens.show(5, last=True)
    assert capsys.readouterr().out.splitlines() == [
        '{"at": 3, "address": 2, "display": ["ab"]}',
        '{"at": 5, "address": 2, "display": ["abc"]}',
    ]
