"""Random whole schemas through every target: a fixed set, and a new one in each session.

The number of the new set is printed at the beginning of a session; QLINKGEN_SCHEMAS=NUMBER selects it again.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable

import pytest

from tests.support.whole.trial import Effort, Outcome, run

FIXED, NEW = 28, 16
#: Added to a seed whose schema lint rejects.
_NEXT = 1_000_000_000


def trial(seed: int) -> Outcome:
    """The trial of the first valid schema from a seed on; every second one is hostile."""
    seeds = itertools.count(seed, _NEXT)
    trials = (run(each, hostile=bool(seed % 2), effort=Effort(messages=4, streams=8)) for each in seeds)
    return next(outcome for outcome in trials if not outcome.refused)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(FIXED))
def test_every_output_agrees(seed: int, require_tool: Callable[..., str]) -> None:
    for compiler in ("gcc", "clang"):
        require_tool(compiler, package=compiler)
    outcome = trial(seed)
    assert not outcome.differences, outcome.report()


@pytest.mark.slow
@pytest.mark.parametrize("number", range(NEW))
def test_every_output_agrees_on_new_ones(number: int, require_tool: Callable[..., str]) -> None:
    for compiler in ("gcc", "clang"):
        require_tool(compiler, package=compiler)
    outcome = trial(int(os.environ["QLINKGEN_SCHEMAS"]) + number)
    assert not outcome.differences, outcome.report()
