"""The soak of buses, with few transactions."""

from __future__ import annotations

import pytest

from tests.soak.buses import NAMES, NAMES_IN_C, TITLE, Outcome, as_section, run
from tests.soak.sections import put_section


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


def test_the_figures_replace_those_of_the_last_run() -> None:
    page = "# Soak\n\n## Figures\n\nOthers.\n"
    for answered in (99_000, 100_500):
        text = as_section([Outcome("ubx", answered)], 100_000, 1, 60.0)
        page = put_section(page, TITLE, text)
    assert page.startswith(f"# Soak\n\n## Figures\n\nOthers.\n\n{TITLE}\n\nThe typed bus of ")
    assert "| answered | 100 500 |" in page
    assert "99 000" not in page
    assert put_section(page + "\n## Last\n\nStays.\n", TITLE, "New.").endswith(
        f"{TITLE}\n\nNew.\n\n## Last\n\nStays.\n"
    )
