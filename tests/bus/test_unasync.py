"""Blocking modules are what their sources for asyncio say."""

from __future__ import annotations

import pytest

from tests import unasync
from tests.unasync import PAIRS, Pair, blocking, differences

pytestmark = pytest.mark.program


@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: pair.derived)
def test_a_derived_module_is_up_to_date(pair: Pair) -> None:
    assert not differences(pair), "run `python -m tests.unasync`"


def test_coroutines_become_functions() -> None:
    source = '''
async def read(bus: AsyncBus) -> AsyncGenerator[int]:
    """Tell `AsyncBus.read` of it, with `await bus.read()`."""
    async with aclosing(bus.each()) as each, bus.transaction():
        async for one in each:  # by AsyncNode
            yield (await one.value()) + AsyncMaster.asynchronous
'''
    assert (
        blocking(source)
        == '''
def read(bus: Bus) -> Generator[int]:
    """Tell `Bus.read` of it, with `bus.read()`."""
    with closing(bus.each()) as each, bus.transaction():
        for one in each:  # by Node
            yield (one.value()) + BlockingMaster.asynchronous
'''
    )


def test_a_text_that_the_source_lacks_is_told() -> None:
    pair = Pair("qlinkgen/bus/aio.py", "qlinkgen/bus/blocking.py", {"no such text": ""})
    with pytest.raises(ValueError, match="has no 'no such text'"):
        pair.text()


def test_a_change_of_a_derived_module_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(unasync.NAMES, "AsyncCalls", "Callers")
    assert "+class Callers(Watched, BlockingMaster):" in differences(PAIRS[0])
