"""The soak of buses, with few transactions."""

from __future__ import annotations

import pytest

from tests.soak.buses import NAMES, NAMES_IN_C, run


@pytest.mark.parametrize("asynchronous", [False, True], ids=["blocking", "asyncio"])
@pytest.mark.parametrize("name", NAMES)
def test_no_request_gets_the_answer_to_another(name: str, asynchronous: bool) -> None:
    outcome = run(name, 120 if asynchronous else 400, seed=2, asynchronous=asynchronous)
    assert not outcome.wrong
    assert outcome.faults > 2
    assert outcome.answered + outcome.told > 4 * outcome.failed


@pytest.mark.program
@pytest.mark.parametrize("name", NAMES_IN_C)
def test_no_request_of_the_master_in_c_gets_the_answer_to_another(name: str) -> None:
    outcome = run(name, 400, seed=3, in_c=True)
    assert not outcome.wrong
    assert outcome.answered + outcome.told > 4 * outcome.failed
