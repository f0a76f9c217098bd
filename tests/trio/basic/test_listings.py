"""The listings of the source document: as printed, with what their misprints show, and corrected.

The document has comments in place of the routines that move the machine. Here they do nothing.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest

from qlinkgen.protocols.trio import KeypadNode
from qlinkgen.protocols.trio.basic import Pointed, ProgrammedNode, parse
from qlinkgen.sim.virtual_ring import VirtualRing

NAME = "trio-fibre-optic-network.txt"
BAUD = 38400
MORE, LESS, ENTER, START = 10, 11, 13, 20

pytestmark = pytest.mark.optional_tool(NAME)


def listing(text: str, begin: str, end: str) -> str:
    """The lines from one beginning to another, with both; comments broken in two are joined again."""
    found = re.search(rf"^{begin}.*?^{end}[^\n]*", text, re.MULTILINE | re.DOTALL)
    assert found is not None
    lines: list[str] = []
    for line in found[0].splitlines():
        if lines and "'" in lines[-1] and re.fullmatch(r"[A-Za-z0-9 ]+", line):
            lines[-1] += f" {line.strip()}"
        elif line.strip() and not line.startswith("```"):
            lines.append(line)
    return "\n".join(lines)


def completed(text: str) -> str:
    """End the program where the machine would move, and the last subroutine at once."""
    return re.sub(r"^moves:.*", "moves: STOP", text, flags=re.MULTILINE) + "\nRETURN"


def changed(text: str, pattern: str, new: str, *, times: int = 1) -> str:
    text, count = re.subn(pattern, new, text, flags=re.MULTILINE)
    assert count == times, pattern
    return text


class Rig:
    """A ring of programs and keypads."""

    def __init__(self, *places: str, pointed: Pointed = "before") -> None:
        nodes = [
            KeypadNode(baud=BAUD)
            if place == "keypad"
            else ProgrammedNode(parse(place, pointed=pointed), baud=BAUD)
            for place in places
        ]
        self.ring = VirtualRing(nodes, baud=BAUD)
        self.programs = [node for node in nodes if isinstance(node, ProgrammedNode)]
        self.keypads = [self.ring.keypad(at) for at, place in enumerate(places) if place == "keypad"]
        self.ring.sleep(0.5)

    def press(self, *keys: int, on: int = 0) -> list[str]:
        for key in keys:
            self.keypads[on].press(key)
            self.ring.sleep(0.2)
        assert [program.machine.failure for program in self.programs] == [None] * len(self.programs)
        return self.keypads[on].lines


@pytest.fixture
def first(document: Callable[[str], str]) -> str:
    return listing(document(NAME), "length=", "do_motion:")


@pytest.fixture
def second(document: Callable[[str], str]) -> tuple[str, str]:
    text = document(NAME)
    return listing(text, "init:", "initax:"), listing(text, "readinit:", "initax:")


def test_two_keypads_as_printed(first: str) -> None:
    rig = Rig(completed(first), "keypad", "keypad")
    assert rig.keypads[0].lines == ["", "SPEED:", "LENGTH:", ""]
    assert rig.press(1, 5, 0, MORE, MORE) == ["          150", "SPEED:       0.2", "LENGTH:", ""]
    assert rig.press(LESS, on=1) == ["          150", "SPEED:       0.2", "LENGTH:", ""], "never less"
    assert rig.press(9, 9) == ["            0", "SPEED:       0.2", "LENGTH:", ""], "beyond 9999"
    rig = Rig(completed(first), "keypad", "keypad")
    assert rig.press(LESS)[1] == "SPEED:       0.1", "more, from 0"


def test_two_keypads_corrected(first: str) -> None:
    text = changed(first, r"CHR\(20\)$", r"\g<0>;", times=2)
    text = changed(text, r"(\(k=11\).*)<(.*)\+", r"\1>\2-")
    rig = Rig(completed(text), "keypad", "keypad")
    rig.press(1, 5, MORE, MORE)
    assert rig.press(0, MORE, LESS, on=1) == ["SPEED:    150", "LENGTH:      0.2", "", ""]
    assert rig.keypads[0].lines == rig.keypads[1].lines


def test_without_the_routine_for_motion_it_says_so(first: str) -> None:
    rig = Rig(first, "keypad", "keypad")
    failure = rig.programs[0].machine.failure
    assert failure is not None
    assert failure.message == "the program has ended inside the subroutine do_motion; end that with RETURN"


def test_two_coordinators_as_printed(second: tuple[str, str]) -> None:
    master, slave = map(completed, second)
    rig = Rig(master, slave, "keypad")
    assert rig.keypads[0].lines == ["MACHINE READY", "FEED LENGTH:     0.0", "", ""]
    twice = "FEED LENGTH:     0.2"
    assert rig.press(MORE, MORE) == ["MACHINE READY", twice, twice, ""]
    assert rig.press(ENTER) == ["MACHINE READY", twice, twice, "SPEED:0.00"]
    assert rig.press(MORE) == ["MACHINE READY", twice, "FEED L0.01SPEED:0.01", "SPEED:0.00"]
    assert rig.press(ENTER, ENTER, START) == ["PRESS START TO RUN", "", "", ""]
    assert [program.machine.ended for program in rig.programs] == [True, True]
    assert [round(rig.programs[1].vr[number], 9) for number in (0, 1)] == [0.2, 0.01]
    assert rig.programs[1].machine.scope.names == {"speed": rig.programs[1].vr[1]}


def test_two_coordinators_corrected(second: tuple[str, str]) -> None:
    master, slave = map(completed, second)
    master = changed(master, r"^(setlen:)\n(.*)", r"\2\n\1")
    master = changed(master, r"^setsp:\n.*", r"\g<0>\nfurther:")
    master = changed(master, r"^GOTO setsp$", "GOTO further")
    rig = Rig(master, slave, "keypad")
    assert rig.press(*[MORE] * 26, LESS)[1] == "FEED LENGTH:     2.5"
    assert rig.press(ENTER, MORE, MORE, LESS) == ["MACHINE READY", "FEED LENGTH:     2.5", "SPEED:0.01", ""]
    rig.programs[0].vr[1] = 9.99
    assert rig.press(MORE)[2] == "SPEED:10.00"
    assert rig.press(LESS)[2] == "SPEED:9.990", "[2] has no width: the last digit of a longer number stays"


def test_six_places_in_all_would_not_fit(second: tuple[str, str]) -> None:
    master, slave = map(completed, second)
    rig = Rig(master, slave, "keypad", pointed="width")
    assert rig.keypads[0].lines == ["MACHINE READY", "FEED LENGTH:   0.0", "", ""]
    assert rig.press(ENTER)[1:3] == ["FEED LENGTH:   0.0SP", "EED:0.00"]
