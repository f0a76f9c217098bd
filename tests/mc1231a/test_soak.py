"""A random session against a model of the registers; `python -m tests.soak.host` is the long run."""

from __future__ import annotations

import pytest

from qlinkgen.sim import FaultPlan
from tests.soak import host
from tests.soak.host_model import Model
from tests.soak.host_run import Session

KINDS = ("drop", "flip", "truncate", "delay", "late", "duplicate", "stray", "noise", "silent")


@pytest.mark.slow
@pytest.mark.parametrize("forgets", [0.0, 0.005])
@pytest.mark.parametrize("faults", ["", "all=0.02", *(f"{kind}=0.02" for kind in KINDS)])
def test_host_and_chip_set_agree(faults: str, forgets: float) -> None:
    plan = FaultPlan.parse(",".join([*filter(None, [faults]), "seed=7"]))
    session = Session(plan, seed=7, forgets=forgets)
    result = session.run(600)
    assert result.complaints == []
    assert result.most_sent <= 1
    assert (result.faults > 0) == bool(faults)
    assert result.counters["out_of_step"] == result.counters["in_step"]
    if not faults:
        assert result.failed == result.made_up == result.counters["repeats"] == 0


def test_faults_to_the_host_alone_make_nothing_up() -> None:
    """What the host sends arrives as it was sent, so every action is carried out at most once for a call.

    Noise is left out: on the simulated line the chip set hears it too.
    """
    plan = FaultPlan(drop=0.01, flip=0.01, truncate=0.01, late=0.005, duplicate=0.01, to="master", seed=3)
    result = Session(plan, seed=3).run(2000)
    assert result.complaints == []
    assert result.faults > 50
    assert result.made_up == 0
    assert result.rewritten == 0


def test_the_session_notices_a_chip_set_that_holds_something_else() -> None:
    session = Session(FaultPlan())
    session.run(50)
    session.chip.axes[1].values["kp"] += 1
    session.chip.axes[2].auto_stop ^= True
    found = session.model.differences(session.chip)
    assert len(found) == 2
    assert found[0].startswith("axis 1: kp is")
    session._compare(1, "kp")
    assert session.result.complaints


def test_a_fresh_model_is_a_fresh_chip_set() -> None:
    session = Session(FaultPlan())
    assert Model().differences(session.chip) == []


def test_the_program(capsys: pytest.CaptureFixture[str]) -> None:
    assert host.main(["--commands", "100", "--faults", "drop=0.02"]) == 0
    assert capsys.readouterr().out.count("host and chip set agree") == 2
