"""Fault plans as text, valid and invalid."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.errors import QlinkgenError
from qlinkgen.sim import FaultPlan, FaultPlanError
from qlinkgen.sim.fault_kinds import KINDS, Rate


def test_parts() -> None:
    plan = FaultPlan.parse("drop=0.01, flip=.02:2-5 ,late=1e-2:0.05-0.2,silent=0.5:3,seed=3,to=master")
    assert plan.rates["drop"] == Rate(0.01, 0, 0)
    assert plan.rates["flip"] == Rate(0.02, 2, 5)
    assert plan.rates["late"] == Rate(0.01, 0.05, 0.2)
    assert plan.rates["silent"] == Rate(0.5, 3, 3)
    assert plan.rates["noise"] == Rate(0, 1, 20)
    assert (plan.seed, plan.to) == (3, "master")


def test_all_spreads_over_what_is_not_named() -> None:
    plan = FaultPlan.parse("late=0.5,all=0.09,drop=0")
    share = 0.09 / 9
    assert {name: rate.chance for name, rate in plan.rates.items()} == {
        **dict.fromkeys(KINDS, share),
        "late": 0.5,
        "drop": 0.0,
    }
    even = FaultPlan.parse("all=0.05")
    assert sum(rate.chance for rate in even.rates.values()) == pytest.approx(0.05)


def test_text_of_a_plan() -> None:
    assert str(FaultPlan()) == "seed=0"
    plan = FaultPlan(
        drop=0.01, late=(0.02, 0.05, 0.2), flip=(0.5, 1, 9), delay=(1, 0, 1e-05), seed=-4, to="slaves"
    )
    assert str(plan) == "drop=0.01,flip=0.5:1-9,delay=1:0-1e-05,late=0.02,to=slaves,seed=-4"
    assert repr(plan) == f"FaultPlan('{plan}')"


chances = st.floats(0, 1) | st.sampled_from([0, 1, 0.1, 1e-9])
counts = st.tuples(chances, st.integers(1, 9), st.integers(9, 99))
times = st.tuples(chances, st.floats(0, 1), st.floats(1, 1e6))


@given(
    st.fixed_dictionaries(
        {},
        optional={
            kind.name: chances if not kind.unit else chances | (counts if kind.whole else times)
            for kind in KINDS.values()
        }
        | {"seed": st.integers(), "to": st.sampled_from(["both", "slaves", "master"])},
    )
)
def test_text_comes_back(arguments: dict[str, Any]) -> None:
    plan = FaultPlan(**arguments)
    again = FaultPlan.parse(str(plan))
    assert str(again) == str(plan)
    assert (again.seed, again.to) == (plan.seed, plan.to)
    for name, rate in plan.rates.items():
        assert again.rates[name] == rate or not rate.chance


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "'' is not a part of a fault plan: a part is NAME=VALUE"),
        ("drop", "'drop' is not a part of a fault plan"),
        ("drop=", "'drop=' is not a part"),
        ("=0.1", "'=0.1' is not a part"),
        ("drop=0.1,", "'' is not a part"),
        ("dorp=0.1", "'dorp=0.1': unknown fault 'dorp'; did you mean drop?"),
        (
            "x=0.1",
            "known are drop, flip, truncate, delay, late, duplicate, stray, noise, silent, all, seed, to",
        ),
        ("drop=0.1,drop=0.2", "'drop=0.2': duplicate drop"),
        ("drop=much", "drop=much: not a probability from 0 to 1"),
        ("drop=nan", "drop=nan: not a probability"),
        ("drop=2", "drop must be a probability from 0 to 1, such as 0.02 for 2 %, not 2"),
        ("drop=-0.1", "drop must be a probability from 0 to 1, such as 0.02 for 2 %, not -0.1"),
        ("drop=2%", "drop=2%: not a probability from 0 to 1"),
        ("all=1.5", "all must be a probability from 0 to 1, such as 0.02 for 2 %, not 1.5"),
        ("all=x", "all=x: not a probability"),
        ("drop=0.1:1-2", "drop=(0.1, 1.0, 2.0): drop has no extent"),
        ("drop=0.1:x", "drop=0.1:x: it has no extent"),
        ("late=0.1:", "late=0.1:: after the colon comes its extent in seconds, LOW-HIGH or one number"),
        ("late=0.1:50ms", "after the colon comes its extent in seconds"),
        ("late=0.1:1-2-3", "after the colon"),
        ("late=0.1:2-1", "late must have bounds of 0 seconds or more in ascending order, not 2 to 1"),
        ("late=0.1:-2", "late must have bounds of 0 seconds or more in ascending order, not -2 to -2"),
        ("late=0.1:1e999", "late must have bounds of 0 seconds or more in ascending order, not inf to inf"),
        ("late=0.1:nan", "after the colon"),
        ("flip=0.1:0-3", "flip must have integer bounds of 1 bits or more, not 0 to 3"),
        ("noise=0.1:1.5-3", "noise must have integer bounds of 1 bytes or more, not 1.5 to 3"),
        ("seed=x", "seed=x: not an integer"),
        ("seed=1.5", "seed=1.5: not an integer"),
        ("to=me", "to must be one of both, slaves, master, not 'me'"),
    ],
)
def test_invalid_plans(text: str, reason: str) -> None:
    with pytest.raises(FaultPlanError) as caught:
        FaultPlan.parse(text)
    assert reason in str(caught.value)
    assert isinstance(caught.value, ValueError)
    assert isinstance(caught.value, QlinkgenError)


@pytest.mark.parametrize(
    "arguments",
    [{"drop": 1.1}, {"drop": float("nan")}, {"late": (0.1, 2, 1)}, {"late": (0.1, 2)}, {"to": "nodes"}],
)
def test_wrong_arguments(arguments: dict[str, Any]) -> None:
    with pytest.raises(FaultPlanError):
        FaultPlan(**arguments)


@given(st.text() | st.from_regex(r"[a-z]{1,9}=[-0-9.:e]{1,9}(,[a-z]{1,9}=[-0-9.:e]{1,9})*", fullmatch=True))
def test_any_text_is_a_plan_or_says_why_not(text: str) -> None:
    try:
        plan = FaultPlan.parse(text)
    except FaultPlanError:
        return
    assert str(FaultPlan.parse(str(plan))) == str(plan)
