"""The master in C and that in Python, with the same faults of the line: the same course of transactions."""

from __future__ import annotations

import random
from typing import Any

import pytest

from qlinkgen.errors import LinkError
from qlinkgen.link.codec import Framed
from qlinkgen.model.naming import snake
from qlinkgen.sim import FaultPlan
from tests.bus.cases import called, numbers_of
from tests.bus.rig import Setting, make_rig
from tests.bus.settings import IN_C, NAMES_IN_C, VIRTUAL
from tests.bus.wires import codec_of
from tests.library.protocols import described
from tests.soak.buses import vary
from tests.support.cmaster_source import asks_of

TRANSACTIONS = 80
#: Chance of each kind of fault; one bit is changed, so that check values notice.
RATE = 0.06
RATES: dict[str, Any] = {
    **dict.fromkeys(("drop", "truncate", "delay", "noise", "silent"), RATE),
    "flip": (RATE, 1, 1),
}
#: Counters that both keep. What is damaged is counted by other rules where only its request tells that.
SAME = (
    "requests", "repeats", "answers", "timeouts", "failures", "refusals", "collisions", "partial_echoes",
    "missing_echoes",
)  # fmt: skip

#: Whether frames have a check value; without one, a damaged answer may be taken.
CHECKED = {name: name not in {"cobs", "slip"} for name in NAMES_IN_C}

#: What a transaction gave, and after how many attempts.
Course = list[tuple[str, int]]


def requests_of(name: str, rng: random.Random) -> list[Framed]:
    """Random requests of all commands to two nodes, and to one that is missing."""
    codec = codec_of(name)
    numbers: list[int] = numbers_of(codec)
    found: list[Framed] = []
    known = [each for each in called(codec, numbers[0]) if each[0].name != LEFT_OUT.get(name)]
    while len(found) < TRANSACTIONS:
        command, where, values = rng.choice(known)
        node = rng.choice([*numbers[:2] * 8, numbers[-1]])
        to = {command.request.ADDRESS: node} if where else {}
        plain, varied = command.request(**values, **to), command.request(**values, **to)
        vary(varied, rng, {command.request.ADDRESS})
        try:
            varied.to_frame()
        except ValueError:  # two of its values do not go together
            varied = plain
        found.append(varied)
    return found


def course(name: str, setting: Setting, seed: int, *, echoes: bool) -> tuple[Course, dict[str, int]]:
    """The outcomes of the same requests with the same faults, and the counters.

    Each answer must be one that a slave has made for its request.
    """
    found: Course = []
    with make_rig(setting, name, echoes=echoes) as rig:
        rig.script.drawn = FaultPlan(**RATES, seed=seed)
        for request in requests_of(name, random.Random(seed)):
            for node in rig.nodes:
                node.made.clear()
            try:
                reply = rig.master.transact(request)
                answer = reply.response.to_frame().hex() if reply.response is not None else "sent"
                made = [each.to_frame().hex() for node in rig.nodes for each in node.made]
                assert answer in {*made, "sent"} or not CHECKED[name]
                found.append((answer, reply.attempts))
            except LinkError as error:
                found.append((type(error).__name__, error.attempts))
        total = rig.master.engine.total
        return found, {each: getattr(total, each) for each in SAME}


in_c = pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.program) for name in NAMES_IN_C])


@in_c
def test_both_masters_take_the_same_course(name: str) -> None:
    in_python, in_c = (course(name, each, 1, echoes=False) for each in (VIRTUAL[0], IN_C))
    assert in_c == in_python
    assert len({each for each, _ in in_c[0]}) > 2


@in_c
def test_with_changed_echoes_both_masters_get_as_many_answers(name: str) -> None:
    """They differ in what they make of damaged frames among the bytes of an echo."""
    in_python, in_c = (course(name, each, 3, echoes=True) for each in (VIRTUAL[0], IN_C))
    assert abs(in_c[1]["answers"] - in_python[1]["answers"]) <= TRANSACTIONS / 20
    assert in_c[1]["requests"]


#: Commands of protocols that are left out, and why.
LEFT_OUT = dict.fromkeys(("modbus_ascii", "modbus_rtu"), "write_file_record")


@pytest.mark.parametrize("name", NAMES_IN_C)
def test_the_master_has_every_command(name: str) -> None:
    model = described(name).model
    commands = [snake(each.name) for each in model.commands if each.name != LEFT_OUT.get(name)]
    assert [each.name for each in asks_of(model)] == commands
