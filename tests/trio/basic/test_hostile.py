"""Random programs: they are read and run, or refused by one class of error, and time goes on."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from qlinkgen.protocols.trio.basic import BasicError, ProgrammedNode, parse
from qlinkgen.protocols.trio.basic.lexer import WORDS
from qlinkgen.sim.virtual_ring import VirtualRing

PIECES = (
    *sorted(WORDS),
    *"+-*/=<>&()[],;:#.'\"\x00\u20ac\n",
    *("\n", "\n", "0", "1", "3", "10", "11", "255", "6.1", "1e308", "1e-308", "9" * 400, "a", "b", "loop"),
    *("loop:", "VR(", "CHR(", '"text"', "KEY#3", "#10,"),
)
EXPRESSIONS = (
    "a",
    "0",
    "1",
    "-1",
    "300",
    "VR(a)",
    "KEY#4",
    "NETSTAT",
    "COMMSERROR",
    "a+b*2",
    "a/b",
    "NOT a",
    "(a=b)",
    "1e200*a",
)
SHAPES = (
    *("PRINT #@,@[@]", "PRINT #10,CHR(@)", "PRINT #10,@[6.1],@;", "SEND(@,@,@,@)", "SEND(10,1,@,@)", "WA(@)"),
    *(
        "VR(@)=@",
        "a=@",
        "b=@",
        "GET #@,a",
        "GET #4,VR(@)",
        "DEFKEY(@,@)",
        "NETSTAT=@",
        "COMMSERROR=@",
        "WAIT UNTIL @",
    ),
    *("GOTO loop", "GOSUB sub", "GOSUB loop", "RETURN", "STOP", "REPEAT", "UNTIL @", "IF @ THEN GOTO loop"),
    *("IF @ THEN a=@ ELSE GOSUB sub", "REPEAT: a=a+1: UNTIL @"),
)


def tokens(chance: random.Random) -> str:
    return " ".join(chance.choices(PIECES, k=chance.randint(1, 40)))


def statements(chance: random.Random) -> str:
    lines = ["a=0", "b=1", "loop:"]
    for _ in range(chance.randint(1, 12)):
        made = chance.choice(SHAPES)
        while "@" in made:
            made = made.replace("@", chance.choice(EXPRESSIONS), 1)
        lines.append(made)
    lines.insert(chance.randint(2, len(lines)), "sub: a=a+1")
    return "\n".join(lines)


def damaged(chance: random.Random) -> str:
    text = statements(chance)
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(len(text))
        text = text[:at] + chance.choice((chance.choice(PIECES), "")) + text[at + chance.randint(0, 2) :]
    return text


@pytest.mark.parametrize(("make", "least_run"), [(tokens, 0), (statements, 150), (damaged, 15)])
def test_random_programs(make: Callable[[random.Random], str], least_run: int) -> None:
    ran, places = 0, {"x.bas"}
    for seed in range(300):
        text = make(random.Random(f"{make.__name__} {seed}"))
        try:
            program = parse(text, "x.bas")
        except BasicError as error:
            places.add(error.place.file)
            continue
        ran += 1
        node = ProgrammedNode(program)
        ring = VirtualRing([node, "coordinator"])
        ring.sleep(0.02)
        assert ring.now == 0.02
        failure = node.machine.failure
        assert failure is None or node.machine.ended
    assert ran >= least_run
    assert places == {"x.bas"}
